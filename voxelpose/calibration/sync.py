"""By how much the cameras of a recording are out of step, and timestamps.csv to put them in step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.agreement import picture_scale
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
    """How offsets are looked for.

    Attributes:
        most_s: the largest offset between two cameras, s.
        seconds: how much of the recording is looked at, from its middle.
        reference: the camera whose clock counts; None for the first.
        rates: frames per second by camera name, where the files do not tell or are wrong.
        unit: unit of the calibration's lengths, where the file does not say it.
    """

    most_s: float = 2.0
    seconds: float = 12.0
    reference: str | None = None
    rates: dict[str, float] | None = None
    unit: str | None = None

    def __post_init__(self) -> None:
        """Checks what the user gave."""
        if not (np.isfinite(self.most_s) and self.most_s > 0):
            raise InputError(
                f"offsets of at most {self.most_s:g} s cannot be looked for: give a positive number"
                " of seconds"
            )
        if not (np.isfinite(self.seconds) and self.seconds > 0):
            raise InputError(
                f"{self.seconds:g} s of a recording cannot be looked at: give a positive number"
            )


@dataclass(frozen=True, eq=False)
class Sync:
    """A recording's synchronisation.

    Attributes: found: the offsets. times: when every camera's frames were taken by its own clock,
        s: the files' rates from a common start. fps: each camera's rate. notes: what makes the
        answer less sure.
    """

    found: Synchronisation
    times: dict[str, Times]
    fps: dict[str, float]
    notes: tuple[str, ...]

    def write(self, path: Path) -> None:
        """Writes timestamps.csv in the reference's time."""
        write_timestamps(
            path, {name: one - self.found.late_s[name] for name, one in self.times.items()}
        )


def sync_recording(
    folder: Path | str,
    settings: SyncSettings | None = None,
    cameras: Sequence[str] | None = None,
    reporter: Reporter | None = None,
) -> Sync:
    """Finds the offsets between a recording's cameras. A timestamps.csv that is there already is
    not looked at.

    Args:
        folder: the recording folder; its videos may differ in length and rate.
        settings: how.
        cameras: names of the cameras to use; None means all.
        reporter: told of every stage.

    Returns:
        The offsets.

    Raises:
        InputError: something is missing, or nobody moves.
    """
    settings, reporter = settings or SyncSettings(), reporter or SilentReporter()
    folder = Path(folder)
    known = pictures_by_camera(folder) or pictures_by_camera(folder / "masks")
    names = list(known) if cameras is None else list(cameras)
    if len(names) < 2:
        raise InputError(f"{folder} has one camera: there is nothing that it could be in step with")
    alone = {name: _open(folder, name, settings) for name in names}
    times = {
        name: np.arange(one.readers[name].frame_count) / one.fps for name, one in alone.items()
    }
    begin, end = _window(times, settings)
    tracks, guessed = [], []
    for name, recording in alone.items():
        used = np.flatnonzero((times[name] >= begin) & (times[name] <= end))
        reporter.stage(f"silhouettes of {name}", len(used))
        silhouettes = Silhouettes(recording, long_side_px=LONG_SIDE_PX)
        guessed += silhouettes.without_background
        outlines = []
        for frame in recording.readers[name].frames(int(used[0]), int(used[-1]) + 1):
            outlines.append(
                Outline.from_mask(recording.rig[name], silhouettes.of({name: frame})[name])
            )
            reporter.advance()
        tracks.append(OutlineTrack(recording.rig[name], times[name][used], tuple(outlines)))
    reporter.stage("offsets")
    shortest = min(float(track.time_s[-1] - track.time_s[0]) for track in tracks)
    found = synchronise(tracks, min(settings.most_s, 0.5 * shortest), settings.reference)
    notes = (
        [f"no empty view of {', '.join(guessed)}: the temporal median served as background"]
        if guessed
        else []
    )
    if found.agreed and found.after_px > _DOUBTFUL_PX * picture_scale(tracks):
        notes.append(
            "a camera does not agree with the others even so, and its offset is unsure: `voxelpose"
            " calibrate check` names it"
        )
    return Sync(found, times, {name: one.fps for name, one in alone.items()}, tuple(notes))


def _open(folder: Path, name: str, settings: SyncSettings) -> Recording:
    """Opens one camera of a recording, by its own rate."""
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
    """Returns the part of the recording to look at, s."""
    shortest = min(float(one[-1]) for one in times.values())
    middle = 0.5 * shortest
    return middle - 0.5 * settings.seconds, middle + 0.5 * settings.seconds
