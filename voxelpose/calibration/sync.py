"""Clock offsets between a recording's cameras, and the timestamps.csv that corrects them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.agreement import OUTLINES_PX, image_scale
from calib.board import Board, BoardView
from calib.camera import Camera, Rig
from calib.errors import InputError
from calib.files import read_rig
from calib.pairs import board_poses, check_lens_size
from calib.signals import (
    Signal,
    SignalOffsets,
    SignalSettings,
    checked_reference,
    offsets_from_signals,
)
from calib.synchronise import Synchronisation, outline_signal, require_motion, synchronise
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.progress import Reporter, SilentReporter
from voxelpose.calibration.board_views import BoardFinder, as_printed
from voxelpose.calibration.check import LONG_SIDE_PX, outline_track
from voxelpose.findings import Finding
from voxelpose.recording.camera_files import not_read, pictures_by_camera
from voxelpose.recording.file_times import times_in_files
from voxelpose.recording.folder import Recording, calibration_path, open_readers
from voxelpose.recording.frame_reader import FrameReader
from voxelpose.recording.repeated_pictures import without_repeats
from voxelpose.recording.sound import STEP_S, has_sound, onsets
from voxelpose.recording.timestamps import Times, checked_rate, even_numbers, write_timestamps
from voxelpose.tuning import SYNCHRONISATION

_LEAST_VIEWS = 20
_BOARD_HZ = 12  # how often the board is looked for: enough on the boards of docs/results.md
_MAX_OFFSET_S = {"geometry": 2, "board": 20, "sound": 60, "silhouettes": 10}
_SECONDS = {"geometry": 12, "board": 60, "sound": 600, "silhouettes": 40}
_NAMES = {
    "board": "the board's speed",
    "sound": "sound",
    "silhouettes": "silhouettes moving up and down",
}
_REMEDIES = {
    "geometry": "the cameras agree at no offset: calibrate first, then synchronise, or give --by",
    "board": "carry the board so that all cameras see it, now faster and now slower",
    "sound": "clap where all cameras hear it, or try --by silhouettes",
    "silhouettes": (
        "let somebody squat, jump or raise the arms in view of all cameras, give --seconds and"
        " --most, or clap and try --by sound"
    ),
}


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


SyncMethod = Literal["geometry", "board", "sound", "silhouettes"]


@dataclass(frozen=True)
class SyncSettings:
    """Settings of the synchronisation.

    Attributes:
        max_offset_s: largest offset between two cameras, s; None: as `_MAX_OFFSET_S` says.
        seconds: length of the part of the recording that is used, s, from its beginning for sound,
            else about its middle; None: as `_SECONDS` says.
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
        """Checks that there is a board where one is needed."""
        if self.by == "board" and self.board is None:
            raise InputError("what does the board look like? give --board, as in --board 8x5")


@dataclass(frozen=True, eq=False)
class Sync:
    """Synchronisation of a recording.

    Attributes:
        times: times of every camera's frames by its own clock, s, as the files tell, else from
            their rates and a common start; those of repeated pictures, too.
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
    InputError where something is missing, or nothing that all cameras recorded tells their offsets.

    Args:
        folder: the recording folder; its videos may differ in length and rate. Only geometry needs
            a calibration.
        cameras: names of the cameras used; None for all.
    """
    settings, reporter = settings or SyncSettings(), reporter or SilentReporter()
    films = _Films.open(Path(folder), settings, cameras)
    by = settings.by or ("board" if settings.board else "geometry" if films.calibrated else None)
    if by == "board":
        return _by_board(films, reporter)
    if by == "sound":
        return _by_sound(films, reporter)
    if by is None and all(has_sound(reader.path) for reader in films.readers.values()):
        sync = _by_sound(films, reporter)
        if sync.result.agreed:
            return sync
        reporter.note("the sound of the videos is not clearly the same: their silhouettes are used")
    return _by_outlines(films, by or "silhouettes", reporter)


@dataclass(frozen=True, eq=False)
class _Films:
    """The pictures of all cameras, each with its own rate."""

    folder: Path  #: the recording folder.
    settings: SyncSettings
    calibrated: bool  #: whether it holds a calibration.
    readers: dict[str, FrameReader]  #: frame readers by camera name, without repeated pictures.
    times: dict[str, Times]  #: (frames,) float64, s, by each camera's clock.
    file_times: dict[str, Times]  #: of all frames of the files, the repeated ones too.
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
            raise InputError(
                f"{folder} has {count}: there is nothing that it could be in step with"
                + not_read(folder, " ({})")
            )
        checked_reference(names, settings.reference)
        readers, given, _ = open_readers(folder, names, settings.label)
        fps = {name: _rate(name, readers[name], settings) for name in names}
        for reader in readers.values():
            if reader.frame_count < 3:
                raise InputError(f"{reader.path} has {reader.frame_count} frames: film for longer")
        times = {name: np.arange(readers[name].frame_count) / fps[name] for name in names}
        notes = []
        for name in names:
            one = {name: readers[name]}
            file_times, _ = times_in_files(one, (settings.rates or {}).get(name))
            if file_times is not None:
                times |= file_times.times
                fps[name] = 1 / even_numbers(times[name])[1]
                notes.append(file_times.note)
        calibrated, distinct, used = calibration_path(folder) is not None, dict(readers), times
        if not given:
            distinct, timed, repeats = without_repeats(readers, times, None)
            used, notes = timed or times, [*notes, *repeats]
        return cls(folder, settings, calibrated, distinct, used, times, fps, tuple(notes))

    @property
    def shortest_s(self) -> float:
        """Length of the shortest video, s."""
        return min(float(times_s[-1]) for times_s in self.times.values())

    def seconds(self, by: SyncMethod) -> float:
        """Length of the part that is used, s."""
        return _SECONDS[by] if self.settings.seconds is None else self.settings.seconds

    def inside(self, name: str, by: SyncMethod) -> NDArray[np.int64]:
        """Numbers of a camera's frames in that part, which is about the middle."""
        apart_s = np.abs(self.times[name] - 0.5 * self.shortest_s)
        return np.flatnonzero(apart_s <= 0.5 * self.seconds(by))

    def max_offset_s(self, by: SyncMethod) -> float:
        """Largest offset that is looked for, s: half of what is used at most."""
        most = self.settings.max_offset_s
        most = _MAX_OFFSET_S[by] if most is None else most
        return min(most, 0.5 * min(self.shortest_s, self.seconds(by)))

    def by_signals(
        self,
        by: SyncMethod,
        signals: Sequence[Signal],
        settings: SignalSettings,
        notes: Sequence[str] = (),
    ) -> Sync:
        """Offsets at which signals correlate."""
        offsets = offsets_from_signals(signals, settings, self.settings.reference)
        return Sync(offsets, by, self.file_times, self.fps, (*self.notes, *notes))


def _rate(name: str, reader: FrameReader, settings: SyncSettings) -> float:
    """Frames per second of a camera."""
    rate = (settings.rates or {}).get(name, reader.fps)
    if rate is None:
        raise InputError(f"how fast {name} filmed is not known: say it, as in --rates {name}=30")
    return checked_rate(rate, name, "correct --rates")


def _by_outlines(films: _Films, by: SyncMethod, reporter: Reporter) -> Sync:
    """Offsets from silhouettes, with the calibration or without."""
    settings = films.settings
    if by == "geometry" and not films.calibrated:
        raise InputError(
            f"{films.folder} holds no calibration: make one, beginning with `voxelpose calibrate"
            " board` (docs/calibration.md), or choose --by silhouettes"
        )
    tracks, without_background = [], []
    for name, reader in films.readers.items():
        rate, label = films.fps[name], settings.label
        recording = Recording.open(films.folder, None, [name], settings.unit, rate, label)
        used = films.inside(name, by)
        if len(used) < 3:
            raise InputError(
                f"{films.seconds(by):g} s of {name} are {len(used)} frames: give more with"
                " --seconds"
            )
        reporter.stage(f"silhouettes of {name}", len(used))
        silhouettes = Silhouettes(recording, long_side_px=LONG_SIDE_PX)
        without_background += silhouettes.without_background
        frames = reader.frames(int(used[0]), int(used[-1]) + 1)
        camera, times = recording.rig[name], films.times[name][used]
        tracks.append(outline_track(camera, frames, times, silhouettes, reporter))
    reporter.stage("offsets")
    shortest = min(float(track.time_s[-1] - track.time_s[0]) for track in tracks)
    most = min(films.max_offset_s(by), 0.5 * shortest)
    notes = []
    if without_background:
        notes.append(
            f"no empty view of {', '.join(without_background)}: it was estimated from the"
            " recording's own frames"
        )
    if by == "silhouettes":
        for track in tracks:
            require_motion(track)
        signals = [outline_signal(track) for track in tracks]
        return films.by_signals(by, signals, SignalSettings(most), notes)
    result = synchronise(tracks, most, settings.reference)
    if result.agreed and result.after_px > 2 * OUTLINES_PX * image_scale(tracks):
        notes.append(
            "a camera does not agree with the others even so, and its offset is unsure: `voxelpose"
            " calibrate check` names it"
        )
    return Sync(result, by, films.file_times, films.fps, (*films.notes, *notes))


def _by_board(films: _Films, reporter: Reporter) -> Sync:
    """Offsets from the speed of a carried board."""
    settings = films.settings
    lenses, path = settings.lenses, calibration_path(films.folder)
    if lenses is None and path is not None:
        lenses = read_rig(path, settings.unit, lenses=True)
    if settings.board is None or lenses is None:
        raise InputError(
            "how fast a board moves is seen through known lenses: give --intrinsics, as written by"
            " `voxelpose calibrate intrinsics`, or choose another way with --by"
        )
    signals, board = [], as_printed(settings.board, films.readers, reporter)
    for name, reader in films.readers.items():
        if name not in lenses:
            raise InputError(
                f"no lens for {name}: the calibration has {', '.join(lenses.names)}; add it, or"
                " choose with --cameras"
            )
        check_lens_size(lenses[name], reader.size)
        inside = films.inside(name, "board")
        numbers = inside[:: max(1, int(films.fps[name] / _BOARD_HZ))]
        reporter.stage(f"looking for the board in {name}", len(numbers))
        find, views = BoardFinder(board, stills=False), []
        for picture in reader.select(numbers.tolist()):
            views.append(find(picture))
            reporter.advance()
        seen = sum(isinstance(view, BoardView) for view in views)
        if seen < _LEAST_VIEWS:
            raise InputError(
                f"{name} saw the board in {seen} of {len(views)} frames ({find.failure()}): carry"
                " it nearer and for longer, or choose another way with --by"
            )
        times = films.times[name][numbers]
        signals.append(board_speed(board, lenses[name], times, views))
    reporter.stage("offsets")
    return films.by_signals("board", signals, SignalSettings(films.max_offset_s("board")))


def _by_sound(films: _Films, reporter: Reporter) -> Sync:
    """Offsets from sound."""
    reporter.stage("sound", len(films.readers))
    if silent := [name for name, reader in films.readers.items() if not has_sound(reader.path)]:
        raise InputError(
            f"{', '.join(silent)} recorded no sound: choose another way with --by, such as"
            " --by silhouettes"
        )
    signals = []
    for name, reader in films.readers.items():
        signals.append(onsets(reader.path, name, films.seconds("sound")))
        reporter.advance()
    reporter.stage("offsets")
    most, sigma_s = films.max_offset_s("sound"), SYNCHRONISATION.sound_sigma_s
    note = (
        "sound travels 0.34 m in a millisecond: offsets are wrong by 2.9 ms for each metre that a"
        " camera is nearer to it, or farther, than the reference; the table allows for one metre"
    )
    settings = SignalSettings(most, STEP_S, sigma_s, lasting=False)
    sync = films.by_signals("sound", signals, settings, [note])
    metre_s = 0.003  # of sound's way: some cameras are nearer to it than others
    lines = [
        line
        if line.camera == sync.result.reference
        else replace(
            line,
            error_s=float(np.hypot(line.error_s, metre_s)),
            frames=line.offset_s * films.fps[line.camera],
        )
        for line in sync.result.offsets
    ]
    return replace(sync, result=replace(sync.result, offsets=tuple(lines)))


def sync_findings(sync: Sync) -> list[Finding]:
    """What offsets were found from, and how well the cameras agree: bad where they are not sure."""
    agreed = sync.result.agreed
    level, remedy = ("good", "") if agreed else ("bad", _REMEDIES[sync.by])
    return [Finding("Offsets", level, words, remedy=remedy) for words in _words(sync)]


def _words(sync: Sync) -> Iterator[str]:
    result = sync.result
    if not isinstance(result, SignalOffsets):
        yield (
            f"outlines met within {result.before_px:.1f} px as filmed, {result.after_px:.1f} px"
            " with these offsets"
        )
        if not result.agreed:
            yield (
                "the cameras agree at no offset: the offsets above follow from the motion of the"
                " outlines only, and are rough; check the calibration first"
            )
        return
    pairs = f"by {_NAMES[sync.by]}: pairs of cameras correlate by {result.correlation:.2f}"
    if result.disagreement_s == result.disagreement_s:
        pairs += f", and their offsets agree within {1000 * result.disagreement_s:.1f} ms"
    yield pairs
    if result.unlike:
        yield f"{', '.join(result.unlike)} recorded nothing like the others: not synchronised"
    if result.ambiguous:
        yield (
            f"other offsets are nearly as likely for {', '.join(result.ambiguous)}: motion that"
            " repeats itself, or too little of it"
        )
