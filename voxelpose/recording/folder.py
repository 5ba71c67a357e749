"""Recording folder: videos, empty backgrounds, calibration and subject; see docs/recordings.md."""

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.camera import Camera, Rig
from calib.errors import InputError, check_name
from calib.files import read_rig
from calib.files.anipose import read_up
from calib.storage.documents import visible_entries
from calib.upright import UprightFrame, up_from_cameras
from voxelpose.recording.camera_files import (
    CALIBRATION_SUFFIXES,
    not_read,
    pictures_by_camera,
    renaming,
)
from voxelpose.recording.chapters import FilmReader, chapters_apart, open_camera
from voxelpose.recording.file_times import recorded_times
from voxelpose.recording.frame_reader import VIDEOS, Frame, FrameReader, other_size, read_together
from voxelpose.recording.mask_labels import cut_outs, open_masks
from voxelpose.recording.repeated_pictures import without_repeats
from voxelpose.recording.subject import Subject, read_subject
from voxelpose.recording.timestamps import TIMESTAMPS, matched_by_time, times_by_rate
from voxelpose.recording.unknown_places import (
    RECORDING_FILE,
    UnknownMasks,
    painted_mask,
    read_painting,
    unknown_polygons,
)

_CALIBRATIONS = tuple(f"calibration{end}" for end in (*CALIBRATION_SUFFIXES, ""))


@dataclass(frozen=True, eq=False)
class Recording:
    """Synchronous frames of calibrated cameras, opened by `Recording.open`.

    Iterating yields the frames in order and may be repeated.
    """

    folder: Path
    calibration_path: Path | None
    """The calibration file; None where a single camera has none and `default_camera` is assumed."""
    rig: Rig  #: the cameras in use, in the calibration's order.
    readers: Mapping[str, FrameReader]  #: frame readers by camera name.
    first: int  #: where the first frame in use is among those of the readers.
    frame_count: int  #: number of frames in use.
    fps: float  #: frames per second.
    times_s: NDArray[np.float64]
    """(frame_count,) float64, seconds since the recording's first frame."""
    subject: Subject
    silhouettes_given: bool = False
    """Whether the frames are silhouettes already (white on black, from masks/) and not camera
    images."""
    up: NDArray[np.float64] | None = None
    """(3,) float64, unit, direction of up in the world as the calibration states it; None: not
    stated."""
    camera_names: tuple[str, ...] = ()  #: all cameras of the recording, in use or not.
    notes: tuple[str, ...] = ()  #: what is worth telling about its files.
    numbers: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """(frame_count,) int64, numbers of the frames, increasing; those that a camera lost are left
    out."""
    label: str | None = None  #: of the person in masks/ as it was asked for.

    @classmethod
    def open(
        cls,
        folder: Path | str,
        frames: tuple[int | None, int | None] | None = None,
        cameras: Sequence[str] | None = None,
        unit: str | None = None,
        fps: float | None = None,
        label: str | None = None,
    ) -> "Recording":
        """Opens a recording folder and checks that its files fit each other. InputError where a
        file is missing, unreadable or does not fit the others.

        The first frame of every video is decoded, some of masks, and all where a file tells that
        pictures may be repeated.

        Args:
            frames: first frame and one past the last, either None as in a Python slice; None
                selects all frames.
            cameras: names of the cameras to use; None selects all.
            unit: unit of the calibration's lengths, where the file does not state it.
            fps: frames per second; needed for folders of images without timestamps.csv, and takes
                precedence over both the videos' rates and timestamps.csv.
            label: of the person in masks/, see `open_masks`; None: found.
        """
        folder = Path(folder)
        readers, silhouettes_given, mask_notes = open_readers(folder, cameras, label)
        calibration = calibration_path(folder)
        sizes = {reader.size for reader in readers.values()}
        if calibration is None and cameras is not None and len(cameras) == 1 and len(readers) == 1:
            rig = Rig((default_camera(cameras[0], sizes.pop()),))
            names, notes = tuple(_paths(folder, None)[0]), ()
        elif calibration is None:
            raise _no_calibration(folder, tuple(readers))
        else:
            size = sizes.pop() if len(sizes) == 1 else None
            rig = read_rig(calibration, unit, size, cameras)
            names = tuple(dict.fromkeys((*rig.names, *_paths(folder, None)[0])))
            notes = rig.notes
            rig = _select_cameras(rig, readers, calibration, cameras)
        readers = {name: readers[name] for name in rig.names}
        notes += mask_notes + _notes_on_files(readers, fps)
        whole = frames is None or frames[1] is None
        timed, time_notes = recorded_times(folder, readers, fps, together=whole)
        if not silhouettes_given:
            in_step = timed is None
            distinct, timed, repeats = without_repeats(readers, timed, fps)
            if repeats and in_step and whole:
                _frame_range(readers, None)  # refuses other lengths
            readers, time_notes = distinct, time_notes + repeats
        if timed is None:
            start, stop = _frame_range(readers, frames)
            rate, times_s = times_by_rate(folder, readers, fps)
            numbers = np.arange(stop)
        else:
            earliest = fps is not None or not (folder / TIMESTAMPS).exists()
            readers, numbers, rate, times_s = matched_by_time(folder, readers, timed, earliest)
            first, last = _frame_range(readers, frames, int(numbers[-1]) + 1)
            start, stop = np.searchsorted(numbers, (first, last)).tolist()
            if start == stop:
                raise InputError(f"{folder}: a camera lost frames {first}:{last}: give others")
        return cls(
            folder,
            calibration,
            rig,
            readers,
            start,
            stop - start,
            rate,
            times_s[start:stop],
            read_subject(folder / "subject.toml"),
            silhouettes_given,
            None if calibration is None else read_up(calibration),
            names,
            notes + time_notes,
            numbers[start:stop],
            label,
        )

    @classmethod
    def without_frames(
        cls, folder: Path | str, cameras: Sequence[str] | None = None, unit: str | None = None
    ) -> "Recording":
        """Opens a folder of which calibration, background, regions and subject are wanted alone.
        InputError where the folder or its calibration is missing, or lacks a camera.
        """
        folder = Path(folder)
        calibration = calibration_path(folder)
        if calibration is None:
            raise _no_calibration(folder)
        whole = read_rig(calibration, unit, cameras=cameras)
        rig, up = _chosen(whole, calibration, cameras), read_up(calibration)
        subject, none, names = read_subject(folder / "subject.toml"), np.zeros(0), whole.names
        return cls(
            folder, calibration, rig, {}, 0, 0, 1.0, none, subject, up=up, camera_names=names
        )

    def __iter__(self) -> Iterator[tuple[int, float, dict[str, Frame]]]:
        """Yields the frame number, its time in seconds, and (H, W, 3) uint8 BGR by camera name.
        InputError where a file cannot be read to its end.
        """
        stop = self.first + self.frame_count
        for step, frames in enumerate(read_together(self.readers, self.first, stop)):
            yield int(self.numbers[step]), float(self.times_s[step]), frames

    def at(self, steps: Sequence[int]) -> Iterator[dict[str, Frame]]:
        """Yields the frames of time steps in ascending order, counted from `first`: (H, W, 3) uint8
        BGR by camera name. InputError where a file cannot be read as far as requested.
        """
        numbers = [self.first + int(step) for step in steps]
        readers = {name: reader.select(numbers) for name, reader in self.readers.items()}
        return read_together(readers, 0, len(numbers))

    def upright_frame(self, up: ArrayLike | None = None) -> UprightFrame:
        """The frame with z up, as far as it is known without looking for a person.

        Args:
            up: direction of up in the world; None: as the calibration states, else as the cameras
                stand.
        """
        if up is not None:
            return UprightFrame.from_up(up)
        return UprightFrame.from_up(up_from_cameras(self.rig) if self.up is None else self.up)

    def file_times(self) -> dict[str, NDArray[np.float64]]:
        """Time of every frame of every camera's file, s, by timestamps.csv, the files or
        rate, by camera.
        """
        readers = {name: open_camera(reader.path) for name, reader in self.readers.items()}
        times, _ = recorded_times(self.folder, readers)
        return times or {
            name: np.arange(reader.frame_count) / (reader.fps or self.fps)
            for name, reader in readers.items()
        }

    def backgrounds(self) -> dict[str, FrameReader]:
        """Returns readers of the empty view for the cameras that have one in background/.
        InputError where a file cannot be read or differs in size from the camera.
        """
        backgrounds: dict[str, FrameReader] = {}
        paths = {} if self.silhouettes_given else self._pictures_in("background")
        for name, path in paths.items():
            backgrounds[name] = open_camera(path)
            if backgrounds[name].size != self.rig[name].size:
                remedy = "record the background with the same settings, or remove it"
                raise other_size(path, backgrounds[name].size, self.rig[name], remedy)
        return backgrounds

    def _pictures_in(self, subfolder: str) -> dict[str, Path]:
        """Pictures or videos in a subfolder, by camera in use. InputError where one is of no
        camera, and a camera has none: its name may be wrong.
        """
        paths = pictures_by_camera(self.folder / subfolder, stills=True)
        others = {name: path for name, path in paths.items() if name not in self.camera_names}
        lacking = [name for name in self.camera_names if name not in paths]
        if others and lacking:
            remedy = renaming(others, lacking) or "name it as its camera is named"
            raise InputError(
                f"{next(iter(others.values()))} is of none of the cameras"
                f" {', '.join(self.camera_names)}: {remedy}, or remove it"
            )
        return {camera.name: paths[camera.name] for camera in self.rig if camera.name in paths}

    def regions(self) -> dict[str, NDArray[np.bool_]]:
        """Returns the region of interest, (H, W) bool, of the cameras that have one in regions/.
        InputError where a file cannot be read or differs in size from the camera.

        What is opaque in a layer, else what is not black, is where the person may be.
        """
        return self.paintings("regions")

    def paintings(self, subfolder: str) -> dict[str, NDArray[np.bool_]]:
        """Returns what is painted, (H, W) bool, in a subfolder's pictures by camera in use.
        InputError where one cannot be read, differs in size from the camera, or is of none.
        """
        return {
            name: read_painting(path, self.rig[name])
            for name, path in self._pictures_in(subfolder).items()
        }

    def unknown(self) -> UnknownMasks:
        """Returns where nothing is known, (H, W) bool, of the cameras for which something is marked
        in unknown/ or recording.toml. InputError where a file cannot be read, does not fit its
        camera, or names none.
        """
        masks = self.paintings("unknown")
        drawn = unknown_polygons(self.folder / RECORDING_FILE, self.camera_names)
        for name in drawn.keys() & set(self.rig.names):
            mask = painted_mask(drawn[name], self.rig[name].size)
            masks[name] = masks[name] | mask if name in masks else mask
        return {name: mask for name, mask in masks.items() if mask.any()}


def one_camera(recording: Path, camera: str | None = None) -> tuple[Path, str]:
    """Folder of a recording, or of a single video, and the name of its only camera. InputError
    where there are others, or none, or the video is another camera's.

    Args:
        camera: name of the camera that was chosen; None: the only one.
    """
    if recording.is_file() and recording.suffix.lower() in VIDEOS:
        if camera not in (None, recording.stem):
            raise InputError(f"{recording} is one video, not of {camera}: leave out --camera")
        return recording.parent, recording.stem
    if camera is not None:
        return recording, camera
    names = [*_paths(recording, None)[0]]
    if len(names) > 1:
        remedy = chapters_apart(names) or f"choose one with --camera: {', '.join(names)}"
        raise InputError(f"{recording} has {len(names)} cameras: {remedy}")
    return recording, names[0]


def frame_range(
    text: str | None, setting: str = "--frames {}"
) -> tuple[int | None, int | None] | None:
    """Reads A:B as a Python slice (10:50, 10:, :50); a single number is that frame alone.
    InputError where the text is none of these.

    Args:
        setting: how it is given, with {} in its place, for messages.
    """
    if text is None:
        return None
    first, colon, last = text.partition(":")
    try:
        if not colon:
            return int(first), int(first) + 1
        return (int(first) if first else None), (int(last) if last else None)
    except ValueError:
        raise InputError(
            f"{setting.format(text)} is not understood: give first:last, as in"
            f" {setting.format('0:100')} (the last is not included)"
        ) from None


def is_recording(folder: Path) -> bool:
    """Whether a folder holds a calibration, or videos, so that it is meant as a recording."""
    if not folder.is_dir():
        return False
    files = any(p.is_file() and p.suffix.lower() in VIDEOS for p in visible_entries(folder))
    return files or calibration_path(folder) is not None or (folder / "masks").is_dir()


def _notes_on_files(readers: Mapping[str, FrameReader], fps: float | None) -> tuple[str, ...]:
    """What files promise and do not hold, which are interlaced, or slow motion of which no rate is
    given.
    """
    notes = tuple(
        f"{reader.path} promises {reader.promised} frames and holds {reader.frame_count}: "
        + ("the recording ends with them" if reader.nearly_whole else "it seems to be damaged")
        for reader in readers.values()
        if reader.promised > reader.frame_count
    )
    if fields := ", ".join(name for name, reader in readers.items() if reader.coded.interlaced):
        words = "flagged as interlaced: where a picture's lines are of two moments, those of the"
        notes = *notes, f"{fields}: {words} first are taken"
    filmed = {name: one.coded.filmed_fps or 0.0 for name, one in readers.items() if fps is None}
    if slow := [name for name in filmed if filmed[name] >= 2 * (readers[name].fps or np.inf)]:
        rate = f"{filmed[slow[0]]:.4g}"
        words = f"filmed at {rate} frames per second by what the file says, and plays slower"
        notes = *notes, f"{', '.join(slow)} {words}: where it is slow motion, give --fps {rate}"
    return notes


def open_readers(
    folder: Path, cameras: Sequence[str] | None = None, label: str | None = None
) -> tuple[Mapping[str, FrameReader], bool, tuple[str, ...]]:
    """Readers of a recording's pictures by name, of all or some cameras, whether they are
    silhouettes, and what is worth telling about these. InputError where it is no folder, there are
    no pictures, or some cannot be read.

    Args:
        label: of the person, see `open_masks`.
    """
    if not folder.is_dir():
        remedy = "give a folder with a video per camera and calibration.toml"
        if folder.suffix.lower() in VIDEOS and folder.exists():
            remedy = f"it is one video: `voxelpose track {folder}`, or {remedy}"
        raise InputError(f"{folder} is not a recording: {remedy}")
    paths, given = _paths(folder, cameras)
    for path in (folder.resolve(), *paths.values()):
        check_name(path)
    if given:
        readers, notes = open_masks(paths, label)
        return readers, True, notes
    with ThreadPoolExecutor() as pool:  # each reads its file once, without decoding
        opened = pool.map(open_camera, paths.values())
        readers = dict(zip(paths, opened, strict=True))
    silhouettes, notes = cut_outs(readers)
    notes += tuple(one.note for one in readers.values() if isinstance(one, FilmReader))
    return silhouettes or readers, bool(silhouettes), notes


def _paths(folder: Path, cameras: Sequence[str] | None) -> tuple[dict[str, Path], bool]:
    """Videos or image folders by camera name, and whether they are silhouettes, from masks/."""
    paths = pictures_by_camera(folder)
    silhouettes_given = not paths and (folder / "masks").is_dir()
    if silhouettes_given:
        paths = pictures_by_camera(folder / "masks")
    if not paths:
        raise InputError(
            f"{folder} holds no video: put one per camera there, or a folder of frames, named as in"
            " the calibration (cam_1.mp4, or cam_1/0001.png ...)" + not_read(folder)
        )
    if cameras is not None:
        filmed = ", ".join(paths)
        paths = {name: path for name, path in paths.items() if name in cameras}
        if not paths:
            raise InputError(
                f"there is no video of {' or '.join(cameras)} in {folder}: its cameras, for"
                f" --cameras, are {filmed}"
            )
    return paths, silhouettes_given


def calibration_path(folder: Path) -> Path | None:
    """The calibration in a recording folder; None if there is none."""
    return next((folder / name for name in _CALIBRATIONS if (folder / name).exists()), None)


def default_camera(name: str, size: tuple[int, int]) -> Camera:
    """Camera assumed for a single video of a size (width, height), px, without calibration.

    It is level and one metre above the ground; its field of view along the longer image side is
    53 degrees.
    """
    focal = max(size)  # 53 degrees are between a telephone and a webcam
    matrix = np.array([[focal, 0.0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])
    camera_from_world = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    centre_m = np.array([0.0, 0, 1])
    return Camera(name, size, matrix, np.zeros(0), camera_from_world, -camera_from_world @ centre_m)


def _no_calibration(folder: Path, cameras: Sequence[str] = ()) -> InputError:
    """Error that leads to a calibration, or to `track` where a single camera filmed."""
    remedy = (
        "put one there as calibration.toml (or .yml, .json, .xml, .txt, .xcp, .mat), or make one,"
        " beginning with `voxelpose calibrate board` (docs/calibration.md)"
    )
    if len(cameras) == 1:
        remedy = (
            f"one camera needs none, with `voxelpose track {folder} --camera {cameras[0]}`; for"
            " several begin with `voxelpose calibrate board` (docs/calibration.md)"
        )
    return InputError(f"{folder} holds no calibration: {remedy}{not_read(folder)}")


def _select_cameras(
    rig: Rig, readers: Mapping[str, FrameReader], calibration: Path, cameras: Sequence[str] | None
) -> Rig:
    """Returns the cameras to use, each with a calibration and a video of the calibrated size."""
    filmed, calibrated = ", ".join(readers), ", ".join(rig.names)
    others = {name: reader.path for name, reader in readers.items() if name not in rig}
    renamed = renaming(others, [name for name in rig.names if name not in readers])
    for name in others:
        remedy = chapters_apart(others) or renamed or "add it, or choose with --cameras"
        raise InputError(
            f"camera {name} has no calibration: {calibration} knows {calibrated}; {remedy}"
        )
    chosen = _chosen(rig, calibration, cameras)
    for camera in chosen:
        reader = readers.get(camera.name)
        if reader is None:
            raise InputError(
                f"camera {camera.name} of {calibration} has no video (found: {filmed}): add it, or"
                f" choose with --cameras{not_read(calibration.parent, ' ({})')}"
            )
        if reader.size != camera.size:
            remedy = "calibrate at the size of the recording"
            raise other_size(reader.path, reader.size, camera, remedy)
    return chosen


def _chosen(rig: Rig, calibration: Path, cameras: Sequence[str] | None) -> Rig:
    """The cameras of these names, all for None. InputError where one is not calibrated."""
    for name in cameras or ():
        if name not in rig:
            known = ", ".join(rig.names)
            raise InputError(
                f"there is no camera {name}, of --cameras: {calibration} knows {known}"
            )
    return rig.select([name for name in rig.names if cameras is None or name in cameras])


def _frame_range(
    readers: Mapping[str, FrameReader],
    frames: tuple[int | None, int | None] | None,
    moments: int | None = None,
) -> tuple[int, int]:
    """First frame and one past the last, of files in step, or of moments that are counted."""
    counts = {name: moments or reader.frame_count for name, reader in readers.items()}
    shortest = min(counts.values())
    start, stop = frames or (None, None)
    first, last = start or 0, shortest if stop is None else stop
    meant = {
        max(reader.frame_count, reader.promised if reader.nearly_whole else 0)
        for reader in readers.values()
    }
    if stop is None and moments is None and len(meant) > 1:
        lengths = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise InputError(
            f"videos differ in length ({lengths} frames): if they start together, give --frames"
            f" {first}:{shortest}; if not, `voxelpose calibrate sync` finds by how much, and writes"
            f" {TIMESTAMPS}"
        )
    if not 0 <= first < last <= shortest:
        short = min(counts, key=lambda name: counts[name])
        raise InputError(
            f"--frames {first}:{last} are not in the recording: {readers[short].path} has"
            f" {shortest} frames (0:{shortest})"
        )
    return first, last
