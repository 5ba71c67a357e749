"""Clock offsets between a recording's cameras, and the timestamps.csv that corrects them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from calib.agreement import image_scale
from calib.board import Board, BoardView
from calib.camera import Camera, Rig
from calib.correlation import Signal, SignalSettings
from calib.errors import InputError
from calib.files import read_rig
from calib.pairs import board_poses
from calib.signals import SignalOffsets, checked_reference, offsets_from_signals
from calib.synchronise import Synchronisation, outline_signal, require_motion, synchronise
from calib.tuning import AGREEMENT
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.progress import Reporter, SilentReporter
from voxelpose.calibration.board_views import BoardFinder, check_lens_size
from voxelpose.calibration.check import LONG_SIDE_PX, outline_track
from voxelpose.recording.camera_files import not_read, pictures_by_camera
from voxelpose.recording.file_times import times_in_files
from voxelpose.recording.folder import Recording, calibration_path, open_readers
from voxelpose.recording.frame_reader import FrameReader
from voxelpose.recording.sound import STEP_S, has_sound, onsets
from voxelpose.recording.timestamps import Times, even_numbers, write_timestamps
from voxelpose.tuning import SYNCHRONISATION

_LEAST_VIEWS = 20
_BOARD_HZ = 12  # how often the board is looked for: enough on the boards of docs/results.md
_MAX_OFFSET_S = {"geometry": 2, "board": 20, "sound": 60, "silhouettes": 10}
_SECONDS = {"geometry": 12, "board": 60, "sound": 600, "silhouettes": 40}


def board_signals(
    board: Board,
    readers: Mapping[str, FrameReader],
    times: Mapping[str, Times],
    lenses: Rig,
    window_s: tuple[float, float],
    reporter: Reporter,
) -> list[Signal]:
    """Speed of a carried board in space, m/s, which is the same for all cameras.

    Args:
        readers: pictures by camera name.
        times: (frames,) float64, s, by each camera's clock.
        window_s: begin and end of the part that is used, by each camera's clock.

    Raises:
        InputError: a lens is missing or is of another picture size, or a camera hardly sees the
            board.
    """
    signals = []
    for name, reader in readers.items():
        camera = _lens(lenses, name, reader)
        inside = np.flatnonzero((times[name] >= window_s[0]) & (times[name] <= window_s[1]))
        rate = 1 / max(float(np.median(np.diff(times[name]))), 1e-9)
        numbers = inside[:: max(1, int(rate / _BOARD_HZ))]
        reporter.stage(f"looking for the board in {name}", len(numbers))
        find, views = BoardFinder(board, stills=False), []
        for picture in reader.select(numbers.tolist()):
            views.append(find(picture))
            reporter.advance()
        seen = [isinstance(view, BoardView) for view in views]
        if sum(seen) < _LEAST_VIEWS:
            raise InputError(
                f"{name} saw the board in {sum(seen)} of {len(views)} frames ({find.failure()}):"
                " carry it nearer and for longer, or choose another way with --by"
            )
        signals.append(board_speed(board, camera, times[name][numbers], views))
    return signals


def board_speed(board: Board, camera: Camera, time_s: Times, views: list) -> Signal:
    """Speed (T, 1), m/s, of a board's middle relative to a camera, of T views; NaN if unseen."""
    alone = replace(camera, rotation=np.eye(3), translation=np.zeros(3))
    places = np.full((len(time_s), 3), np.nan)
    for row, view in enumerate(views):
        poses = board_poses(board, alone, view) if isinstance(view, BoardView) else []
        if poses:
            best = min(poses, key=lambda pose: pose.error)
            places[row] = best.translation + best.rotation @ board.points_m.mean(axis=0)
    seen = np.flatnonzero(np.isfinite(places).all(axis=1))
    way, passed = np.diff(places[seen], axis=0), np.diff(time_s[seen])
    speed = np.linalg.norm(way, axis=1) / passed
    speed[passed > 3 / _BOARD_HZ] = np.nan
    middle_s = 0.5 * (time_s[seen][1:] + time_s[seen][:-1])
    return Signal(camera.name, middle_s, speed[:, None])


def sound_signals(paths: Mapping[str, Path], seconds: float, reporter: Reporter) -> list[Signal]:
    """Onsets of all videos' sound.

    Args:
        paths: videos by camera name.
        seconds: length of the part, from the beginning, that is used.

    Raises:
        InputError: a camera recorded no sound.
    """
    reporter.stage("sound", len(paths))
    if silent := [name for name in paths if not has_sound(paths[name])]:
        raise InputError(
            f"{', '.join(silent)} recorded no sound: choose another way with --by, such as"
            " --by silhouettes"
        )
    signals = []
    for name, path in paths.items():
        signals.append(onsets(path, name, seconds))
        reporter.advance()
    return signals


def _lens(lenses: Rig, name: str, reader: FrameReader) -> Camera:
    """The lens of a camera, of the size of its pictures."""
    if name not in lenses:
        raise InputError(
            f"no lens for {name}: the calibration has {', '.join(lenses.names)}; add it, or choose"
            " with --cameras"
        )
    check_lens_size(lenses[name], reader)
    return lenses[name]


SyncMethod = Literal["geometry", "board", "sound", "silhouettes"]


@dataclass(frozen=True)
class SyncSettings:
    """Settings of the synchronisation.

    Attributes:
        max_offset_s: largest offset between two cameras, s; None: 2 s by geometry, 20 s by a board,
            60 s by sound, 10 s by silhouettes.
        seconds: length of the part of the recording that is used, s, from its beginning for sound,
            else about its middle; None: 12 s by geometry, 60 s by a board, 600 s by sound, 40 s by
            silhouettes.
        reference: camera whose clock is the reference; None for the first.
        rates: frames per second by camera name, if missing or wrong in the files.
        unit: unit of the calibration's lengths, if the file does not state it.
        by: what offsets are found from: "geometry", tangent planes of the silhouettes, which needs
            a calibration; "board", a carried board's speed, which needs lenses; "sound";
            "silhouettes", their vertical velocities. None: the first of a board, if one is given, a
            calibration, common sound and silhouettes that there is.
        lenses: the cameras' lenses; None: those of the recording's calibration.
        label: of the person in masks/; None: found.
    """

    max_offset_s: float | None = None
    seconds: float | None = None
    reference: str | None = None
    rates: dict[str, float] | None = None
    unit: str | None = None
    by: SyncMethod | None = None
    board: Board | None = None
    lenses: Rig | None = None
    label: str | None = None

    def __post_init__(self) -> None:
        """Checks the values."""
        most, seconds = self.max_offset_s, self.seconds
        if most is not None and not (np.isfinite(most) and most > 0):
            raise InputError(
                f"offsets of at most {most:g} s cannot be looked for: give a positive number of"
                " seconds"
            )
        if seconds is not None and not (np.isfinite(seconds) and seconds > 0):
            raise InputError(
                f"{seconds:g} s of a recording cannot be looked at: give a positive number"
            )
        if self.by == "board" and self.board is None:
            raise InputError("what does the board look like? give --board, as in --board 8x5")


@dataclass(frozen=True, eq=False)
class Sync:
    """Synchronisation of a recording.

    Attributes:
        times: times of every camera's frames by its own clock, s, as the files tell, else from
            their rates and a common start.
    """

    result: Synchronisation | SignalOffsets
    by: SyncMethod
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
        folder: the recording folder; its videos may differ in length and rate. Only geometry needs
            a calibration.
        cameras: names of the cameras used; None for all.

    Raises:
        InputError: something is missing, or nothing that all cameras recorded tells their offsets.
    """
    settings, reporter = settings or SyncSettings(), reporter or SilentReporter()
    films = _Films.open(Path(folder), settings, cameras)
    if settings.by is None and settings.board is None and not films.calibrated:
        sync = _by_sound_if_common(films, settings, reporter)
        if sync is not None:
            return sync
    by = settings.by or (
        "board" if settings.board else "geometry" if films.calibrated else "silhouettes"
    )
    if by == "board":
        return _by_board(films, settings, reporter)
    if by == "sound":
        return _by_sound(films, settings, reporter)
    return _by_outlines(films, settings, by, reporter)


@dataclass(frozen=True, eq=False)
class _Films:
    """The pictures of all cameras, each with its own rate."""

    folder: Path  #: the recording folder.
    calibrated: bool  #: whether it holds a calibration.
    readers: dict[str, FrameReader]  #: frame readers by camera name.
    times: dict[str, Times]  #: (frames,) float64, s, by each camera's clock.
    fps: dict[str, float]  #: rates.
    notes: tuple[str, ...]  #: what files tell of their frames' times.

    @classmethod
    def open(cls, folder: Path, settings: SyncSettings, cameras: Sequence[str] | None) -> _Films:
        if not folder.is_dir():
            raise InputError(f"{folder} is not a recording: give a folder with a video per camera")
        paths = pictures_by_camera(folder) or pictures_by_camera(folder / "masks")
        names = list(paths) if cameras is None else list(cameras)
        if missing := [name for name in names if name not in paths]:
            raise InputError(
                f"there is no video of {', '.join(missing)} in {folder}: its cameras are"
                f" {', '.join(paths)}"
            )
        if len(names) < 2:
            count = "one camera" if names else "no video"
            hint = not_read(folder)
            raise InputError(
                f"{folder} has {count}: there is nothing that it could be in step with"
                + (f" ({hint})" if hint else "")
            )
        checked_reference(names, settings.reference)
        readers = dict(open_readers(folder, names, settings.label)[0])
        fps = {name: _rate(name, readers[name], settings) for name in names}
        for reader in readers.values():
            if reader.frame_count < 3:
                raise InputError(f"{reader.path} has {reader.frame_count} frames: film for longer")
        times = {name: np.arange(readers[name].frame_count) / fps[name] for name in names}
        notes = []
        for name in names:
            found = times_in_files({name: readers[name]}, (settings.rates or {}).get(name))
            if found is not None:
                times |= found.times
                fps[name] = 1 / even_numbers(times[name])[1]
                notes.append(found.note)
        calibrated = calibration_path(folder) is not None
        return cls(folder, calibrated, readers, times, fps, tuple(notes))

    @property
    def shortest_s(self) -> float:
        """Length of the shortest video, s."""
        return min(float(times_s[-1]) for times_s in self.times.values())

    def window(self, by: SyncMethod, settings: SyncSettings) -> tuple[float, float]:
        """Begin and end of the part about the middle that is used, s."""
        seconds = _SECONDS[by] if settings.seconds is None else settings.seconds
        middle = 0.5 * self.shortest_s
        return middle - 0.5 * seconds, middle + 0.5 * seconds

    def max_offset_s(self, by: SyncMethod, settings: SyncSettings) -> float:
        """Largest offset that is looked for, s: half of what is used at most."""
        most = _MAX_OFFSET_S[by] if settings.max_offset_s is None else settings.max_offset_s
        begin, end = self.window(by, settings)
        return min(most, 0.5 * min(self.shortest_s, end - begin))


def _rate(name: str, reader: FrameReader, settings: SyncSettings) -> float:
    """Frames per second of a camera."""
    rate = (settings.rates or {}).get(name, reader.fps)
    if rate is None:
        raise InputError(f"how fast {name} filmed is not known: say it, as in --rates {name}=30")
    if not (np.isfinite(rate) and rate > 0):
        raise InputError(f"{name} cannot have filmed {rate:g} frames per second: correct --rates")
    return rate


def _by_outlines(films: _Films, settings: SyncSettings, by: SyncMethod, reporter: Reporter) -> Sync:
    """Offsets from silhouettes, with the calibration or without."""
    if by == "geometry" and not films.calibrated:
        raise InputError(
            f"{films.folder} holds no calibration: make one, beginning with `voxelpose calibrate"
            " board` (docs/calibration.md), or choose --by silhouettes"
        )
    begin, end = films.window(by, settings)
    tracks, without_background = [], []
    for name, reader in films.readers.items():
        recording = Recording.open(
            films.folder,
            cameras=[name],
            unit=settings.unit,
            fps=films.fps[name],
            label=settings.label,
        )
        used = np.flatnonzero((films.times[name] >= begin) & (films.times[name] <= end))
        if len(used) < 3:
            raise InputError(
                f"{end - begin:g} s of {name} are {len(used)} frames: give more with --seconds"
            )
        reporter.stage(f"silhouettes of {name}", len(used))
        silhouettes = Silhouettes(recording, long_side_px=LONG_SIDE_PX)
        without_background += silhouettes.without_background
        frames = reader.frames(int(used[0]), int(used[-1]) + 1)
        camera, times = recording.rig[name], films.times[name][used]
        tracks.append(outline_track(camera, frames, times, silhouettes, reporter))
    reporter.stage("offsets")
    shortest = min(float(track.time_s[-1] - track.time_s[0]) for track in tracks)
    most = min(films.max_offset_s(by, settings), 0.5 * shortest)
    notes = [*films.notes]
    if without_background:
        notes.append(
            f"no empty view of {', '.join(without_background)}: it was estimated from the"
            " recording's own frames"
        )
    if by == "silhouettes":
        for track in tracks:
            require_motion(track)
        signals = [outline_signal(track) for track in tracks]
        offsets = offsets_from_signals(signals, SignalSettings(most), settings.reference)
        return Sync(offsets, by, films.times, films.fps, tuple(notes))
    result = synchronise(tracks, most, settings.reference)
    if result.agreed and result.after_px > 2 * AGREEMENT.good_px * image_scale(tracks):
        notes.append(
            "a camera does not agree with the others even so, and its offset is unsure: `voxelpose"
            " calibrate check` names it"
        )
    return Sync(result, by, films.times, films.fps, tuple(notes))


def _by_board(films: _Films, settings: SyncSettings, reporter: Reporter) -> Sync:
    """Offsets from the speed of a carried board."""
    lenses, path = settings.lenses, calibration_path(films.folder)
    if lenses is None and path is not None:
        lenses = read_rig(path, settings.unit, lenses=True)
    if settings.board is None or lenses is None:
        raise InputError(
            "how fast a board moves is seen through known lenses: give --intrinsics, as written by"
            " `voxelpose calibrate intrinsics`, or choose another way with --by"
        )
    window = films.window("board", settings)
    signals = board_signals(settings.board, films.readers, films.times, lenses, window, reporter)
    reporter.stage("offsets")
    how = SignalSettings(films.max_offset_s("board", settings))
    result = offsets_from_signals(signals, how, settings.reference)
    return Sync(result, "board", films.times, films.fps, films.notes)


def _by_sound(films: _Films, settings: SyncSettings, reporter: Reporter) -> Sync:
    """Offsets from sound."""
    seconds = _SECONDS["sound"] if settings.seconds is None else settings.seconds
    paths = {name: reader.path for name, reader in films.readers.items()}
    signals = sound_signals(paths, seconds, reporter)
    reporter.stage("offsets")
    how = SignalSettings(
        films.max_offset_s("sound", settings), STEP_S, SYNCHRONISATION.sound_sigma_s, lasting=False
    )
    result = offsets_from_signals(signals, how, settings.reference)
    metre_s = 0.003  # of sound's way: some cameras are nearer to it than others
    lines = [
        line
        if line.camera == result.reference
        else replace(
            line,
            error_s=float(np.hypot(line.error_s, metre_s)),
            frames=line.offset_s * films.fps[line.camera],
        )
        for line in result.offsets
    ]
    note = (
        "sound travels 0.34 m in a millisecond: offsets are wrong by 2.9 ms for each metre that a"
        " camera is nearer to it, or farther, than the reference; the table allows for one metre"
    )
    return Sync(
        replace(result, offsets=tuple(lines)), "sound", films.times, films.fps, (*films.notes, note)
    )


def _by_sound_if_common(films: _Films, settings: SyncSettings, reporter: Reporter) -> Sync | None:
    """Offsets from sound, if all cameras recorded the same."""
    if not all(has_sound(reader.path) for reader in films.readers.values()):
        return None
    sync = _by_sound(films, settings, reporter)
    if sync.result.agreed:
        return sync
    reporter.note("the sound of the videos is not clearly the same: their silhouettes are used")
    return None
