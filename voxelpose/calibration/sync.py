"""Clock offsets between a recording's cameras, and the timestamps.csv that corrects them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.agreement import image_scale
from calib.errors import InputError
from calib.synchronise import Synchronisation, synchronise
from calib.tangency import Outline, OutlineTrack
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.progress import Reporter, SilentReporter
from voxelpose.calibration.check import LONG_SIDE_PX
from voxelpose.recording.folder import Recording, pictures_by_camera
from voxelpose.recording.frame_reader import FrameReader
from voxelpose.recording.timestamps import Times, write_timestamps

_DOUBTFUL_PX = 0.8  # of a picture of 480 x 360


@dataclass(frozen=True)
class SyncSettings:
    """Settings of the synchronisation.

    Attributes:
        max_offset_s: largest offset between two cameras, s.
        seconds: length of the middle part of the recording that is used, s.
        reference: camera whose clock is the reference; None for the first.
        rates: frames per second by camera name, if missing or wrong in the files.
        unit: unit of the calibration's lengths, if the file does not state it.
    """

    max_offset_s: float = 2.0
    seconds: float = 12.0
    reference: str | None = None
    rates: dict[str, float] | None = None
    unit: str | None = None

    def __post_init__(self) -> None:
        """Checks the values."""
        if not (np.isfinite(self.max_offset_s) and self.max_offset_s > 0):
            raise InputError(
                f"offsets of at most {self.max_offset_s:g} s cannot be looked for: give a positive"
                " number of seconds"
            )
        if not (np.isfinite(self.seconds) and self.seconds > 0):
            raise InputError(
                f"{self.seconds:g} s of a recording cannot be looked at: give a positive number"
            )


@dataclass(frozen=True, eq=False)
class Sync:
    """Synchronisation of a recording.

    Attributes:
        result: the offsets.
        times: times of every camera's frames by its own clock, s, from the files' rates and a
            common start.
        fps: rate of each camera.
        notes: limitations of this result.
    """

    result: Synchronisation
    times: dict[str, Times]
    fps: dict[str, float]
    notes: tuple[str, ...]

    def write(self, path: Path) -> None:
        """Writes timestamps.csv in the reference's time."""
        write_timestamps(
            path,
            {name: times_s - self.result.offset_s[name] for name, times_s in self.times.items()},
        )


def sync_recording(
    folder: Path | str,
    settings: SyncSettings | None = None,
    cameras: Sequence[str] | None = None,
    reporter: Reporter | None = None,
) -> Sync:
    """Estimates the clock offsets of a recording's cameras. An existing timestamps.csv is ignored.

    Args:
        folder: the recording folder; its videos may differ in length and rate.
        settings: settings; None for the defaults.
        cameras: names of the cameras used; None for all.
        reporter: receives the progress.

    Raises:
        InputError: something is missing, or nobody moves.
    """
    settings, reporter = settings or SyncSettings(), reporter or SilentReporter()
    folder = Path(folder)
    pictures = pictures_by_camera(folder) or pictures_by_camera(folder / "masks")
    names = list(pictures) if cameras is None else list(cameras)
    if len(names) < 2:
        raise InputError(f"{folder} has one camera: there is nothing that it could be in step with")
    recordings = {name: _open(folder, name, settings) for name in names}
    times = {
        name: np.arange(recording.readers[name].frame_count) / recording.fps
        for name, recording in recordings.items()
    }
    begin, end = _window(times, settings)
    tracks, without_background = [], []
    for name, recording in recordings.items():
        used = np.flatnonzero((times[name] >= begin) & (times[name] <= end))
        reporter.stage(f"silhouettes of {name}", len(used))
        silhouettes = Silhouettes(recording, long_side_px=LONG_SIDE_PX)
        without_background += silhouettes.without_background
        outlines, unknown = [], silhouettes.unknown.get(name)
        for frame in recording.readers[name].frames(int(used[0]), int(used[-1]) + 1):
            mask = silhouettes.of({name: frame})[name]
            outlines.append(Outline.from_mask(recording.rig[name], mask, unknown))
            reporter.advance()
        tracks.append(OutlineTrack(recording.rig[name], times[name][used], tuple(outlines)))
    reporter.stage("offsets")
    shortest = min(float(track.time_s[-1] - track.time_s[0]) for track in tracks)
    result = synchronise(tracks, min(settings.max_offset_s, 0.5 * shortest), settings.reference)
    notes = (
        [
            f"no empty view of {', '.join(without_background)}: it was estimated from the"
            " recording's own frames"
        ]
        if without_background
        else []
    )
    if result.agreed and result.after_px > _DOUBTFUL_PX * image_scale(tracks):
        notes.append(
            "a camera does not agree with the others even so, and its offset is unsure: `voxelpose"
            " calibrate check` names it"
        )
    return Sync(
        result, times, {name: recording.fps for name, recording in recordings.items()}, tuple(notes)
    )


def _open(folder: Path, name: str, settings: SyncSettings) -> Recording:
    """One camera of a recording, with its own rate."""
    rate = (settings.rates or {}).get(name)
    if rate is None:
        path = (pictures_by_camera(folder) or pictures_by_camera(folder / "masks")).get(name)
        rate = None if path is None else FrameReader.open(path).fps
    if rate is None:
        raise InputError(f"how fast {name} filmed is not known: say it, as in --rates {name}=30")
    recording = Recording.open(folder, cameras=[name], unit=settings.unit, fps=rate)
    if recording.calibration_path is None:
        raise InputError(
            f"{folder} holds no calibration: calibrate first, or put calibration.toml there"
        )
    return recording


def _window(times: dict[str, Times], settings: SyncSettings) -> tuple[float, float]:
    """Start and end of the part of the recording that is used, s."""
    shortest = min(float(times_s[-1]) for times_s in times.values())
    middle = 0.5 * shortest
    return middle - 0.5 * settings.seconds, middle + 0.5 * settings.seconds
