"""A recording folder: videos, empty backgrounds, calibration, and who was filmed. See
docs/recordings.md.
"""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, Rig
from calib.errors import InputError
from calib.files import read_rig
from voxelpose.recording.frame_reader import STILLS, VIDEOS, Frame, FrameReader, together
from voxelpose.recording.timestamps import NAME, in_step, read_timestamps

_CALIBRATIONS = (
    "calibration.toml",
    "calibration.yml",
    "calibration.yaml",
    "calibration.json",
    "calibration.xml",
    "calibration",
)
_SUBFOLDERS = frozenset({"background", "masks", "regions", "calibration"})
_USUAL_FOCAL = (
    1.0  # focal length over the longer side: 53 degrees, between a telephone and a webcam
)
_RATE_TOLERANCE = 0.01  # cameras triggered together write average rates that differ a little


@dataclass(frozen=True)
class Subject:
    """Who was filmed, from subject.toml; None where it does not say.

    Attributes:
        stature_m: height.
        chest_girth_m: chest girth.
        sex: "male", "female" or "unknown".
        body: file of a body model.
    """

    stature_m: float | None = None
    chest_girth_m: float | None = None
    sex: str = "unknown"
    body: Path | None = None


@dataclass(frozen=True, eq=False)
class Recording:
    """Synchronous pictures of calibrated cameras. Open it with `Recording.open`; iterate as often
    as wanted.

    Attributes: folder: the recording folder. calibration_path: the calibration that was read; None
        where a single camera has none and the usual one stands in for it. rig: the cameras used, in
        the calibration's order. readers: the pictures by camera name. first: number of the first
        frame used. frame_count: how many frames are used. fps: frames per second. times_s:
        (frame_count,) float64, seconds since the recording's first frame. subject: who was filmed.
        silhouettes_given: the pictures are silhouettes already (white on black, from masks/), not
        camera images.
    """

    folder: Path
    calibration_path: Path | None
    rig: Rig
    readers: Mapping[str, FrameReader]
    first: int
    frame_count: int
    fps: float
    times_s: NDArray[np.float64]
    subject: Subject
    silhouettes_given: bool = False

    @classmethod
    def open(
        cls,
        folder: Path | str,
        frames: tuple[int | None, int | None] | None = None,
        cameras: Sequence[str] | None = None,
        unit: str | None = None,
        fps: float | None = None,
    ) -> "Recording":
        """Looks at every file of a recording and checks that they belong together. No frame but the
        first is decoded.

        Args: folder: the recording folder. frames: first frame and one past the last, as a Python
            slice (None: from the start, to the end); None means all. cameras: names of the cameras
            to use; None means all. unit: unit of the calibration's lengths, where the file does not
            state it. fps: frames per second, where folders of frames without timestamps.csv do not
            tell; otherwise it overrules them.

        Raises: InputError: something is missing, unreadable or does not fit, in one line that names
            it and the remedy.
        """
        folder = Path(folder)
        if not folder.is_dir():
            raise InputError(
                f"{folder} is not a recording: give a folder with a video per camera and"
                " calibration.toml"
            )
        paths = pictures_by_camera(folder)
        given = not paths and (folder / "masks").is_dir()
        if given:
            paths = pictures_by_camera(folder / "masks")
        if not paths:
            raise InputError(
                f"{folder} holds no video: put one per camera there, named as in the calibration"
                " (cam_1.mp4)"
            )
        if cameras is not None:
            filmed = ", ".join(paths)
            paths = {name: path for name, path in paths.items() if name in cameras}
            if not paths:
                raise InputError(
                    f"there is no video of {' or '.join(cameras)} in {folder}: its cameras are"
                    f" {filmed}"
                )
        readers = {name: FrameReader.open(path) for name, path in paths.items()}
        calibration = _calibration_path(folder)
        sizes = {one.size for one in readers.values()}
        if calibration is None and cameras is not None and len(cameras) == 1 and len(readers) == 1:
            rig = Rig((usual_camera(cameras[0], sizes.pop()),))
        elif calibration is None:
            raise InputError(
                f"{folder} holds no calibration: put calibration.toml there (or .yml, .json, .xml;"
                " see docs/recordings.md)"
            )
        else:
            rig = read_rig(calibration, unit=unit, size=sizes.pop() if len(sizes) == 1 else None)
            rig = _matching(rig, readers, calibration, cameras)
        readers = {name: readers[name] for name in rig.names}
        stamped = fps is None and (folder / NAME).exists()
        if stamped:
            readers, rate, times_s = _stamped(folder / NAME, readers)
            start, stop = _range(readers, frames)
        else:
            start, stop = _range(readers, frames)
            rate, times_s = _times(folder, readers, fps)
        subject = _read_subject(folder / "subject.toml")
        return cls(
            folder,
            calibration,
            rig,
            readers,
            start,
            stop - start,
            rate,
            times_s[start:stop],
            subject,
            given,
        )

    def __iter__(self) -> Iterator[tuple[int, float, dict[str, Frame]]]:
        """Yields the frame's number in the recording, its time in seconds, and (H, W, 3) uint8 BGR
        by camera name.

        Raises:
            InputError: a file cannot be read to its end.
        """
        for step, frames in enumerate(
            together(self.readers, self.first, self.first + self.frame_count)
        ):
            yield self.first + step, float(self.times_s[step]), frames

    def at(self, steps: Sequence[int]) -> Iterator[dict[str, Frame]]:
        """Yields the pictures, (H, W, 3) uint8 BGR by camera name, of some time steps only, counted
        from `first`, never falling.

        Raises:
            InputError: a file cannot be read so far.
        """
        wanted = [self.first + int(step) for step in steps]
        return together(
            {name: one.pick(wanted) for name, one in self.readers.items()}, 0, len(wanted)
        )

    def file_times(self) -> dict[str, NDArray[np.float64]]:
        """Returns when every frame of every camera's file was taken, s: by timestamps.csv, else at
        the file's rate from a common start.
        """
        files = {name: FrameReader.open(one.path) for name, one in self.readers.items()}
        if (self.folder / NAME).exists():
            return read_timestamps(self.folder / NAME, files)
        return {
            name: np.arange(one.frame_count) / (one.fps or self.fps) for name, one in files.items()
        }

    def backgrounds(self) -> dict[str, FrameReader]:
        """Returns the pictures of the empty view for each camera that has them in background/.

        Raises:
            InputError: one cannot be read or has another size than the camera.
        """
        found: dict[str, FrameReader] = {}
        paths = pictures_by_camera(self.folder / "background", stills=True)
        for camera in self.rig:
            if camera.name in paths and not self.silhouettes_given:
                found[camera.name] = FrameReader.open(paths[camera.name])
                if found[camera.name].size != camera.size:
                    raise InputError(
                        f"{paths[camera.name]} is {_by(found[camera.name].size)} px, camera"
                        f" {camera.name} {_by(camera.size)}: record the background with the same"
                        " settings, or remove it"
                    )
        return found

    def regions(self) -> dict[str, NDArray[np.bool_]]:
        """Returns the region of interest, (H, W) bool, for each camera that has one in regions/
        (white: the person may be there).

        Raises:
            InputError: one cannot be read or has another size than the camera.
        """
        found: dict[str, NDArray[np.bool_]] = {}
        for name, path in pictures_by_camera(self.folder / "regions", stills=True).items():
            if name in self.rig:
                image = next(iter(FrameReader.open(path)))
                if image.shape[1::-1] != self.rig[name].size:
                    raise InputError(
                        f"{path} is {_by(image.shape[1::-1])} px, camera {name}"
                        f" {_by(self.rig[name].size)}: draw it on a frame"
                    )
                found[name] = image.max(axis=2) > 127
        return found


def pictures_by_camera(folder: Path, stills: bool = False) -> dict[str, Path]:
    """Returns videos and folders of frames (and stills) in a folder by camera name, which is the
    file's stem.
    """
    found: dict[str, Path] = {}
    if not folder.is_dir():
        return found
    for path in sorted(folder.iterdir()):
        suffix = path.suffix.lower()
        if path.name.startswith(".") or path.name in _SUBFOLDERS:
            continue
        if path.is_dir():
            if not any(file.suffix.lower() in STILLS for file in path.iterdir()):
                continue
            name = path.name
        elif suffix in VIDEOS or (stills and suffix in STILLS):
            name = path.stem
        else:
            continue
        if name in found:
            raise InputError(
                f"{folder} has both {found[name].name} and {path.name} for camera {name}:"
                " remove one"
            )
        found[name] = path
    return found


def _calibration_path(folder: Path) -> Path | None:
    return next((folder / name for name in _CALIBRATIONS if (folder / name).exists()), None)


def usual_camera(name: str, size: tuple[int, int]) -> Camera:
    """Returns the camera that is assumed where one alone has no calibration: level, a metre above
    the ground, of a usual field of view.

    Args:
        name: of the camera.
        size: (width, height) of its pictures, px.
    """
    focal = _USUAL_FOCAL * max(size)
    matrix = np.array(
        [[focal, 0.0, (size[0] - 1) / 2], [0.0, focal, (size[1] - 1) / 2], [0.0, 0.0, 1.0]]
    )
    camera_from_world = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    return Camera(
        name,
        size,
        matrix,
        np.zeros(0),
        camera_from_world,
        camera_from_world @ np.array([0.0, 0.0, -1.0]),
    )


def _matching(
    rig: Rig, readers: Mapping[str, FrameReader], calibration: Path, cameras: Sequence[str] | None
) -> Rig:
    """Returns the cameras to use, each of which has calibration and pictures of the right size."""
    wanted = list(rig.names) if cameras is None else list(cameras)
    filmed, calibrated = ", ".join(readers), ", ".join(rig.names)
    for name in readers:
        if name not in rig:
            raise InputError(
                f"camera {name} has no calibration: {calibration} knows {calibrated}; add it, or"
                " choose with --cameras"
            )
    for name in wanted:
        if name not in rig:
            raise InputError(f"there is no camera {name}: {calibration} knows {calibrated}")
        if name not in readers:
            raise InputError(
                f"camera {name} of {calibration} has no video (found: {filmed}): add it, or choose"
                " with --cameras"
            )
        if readers[name].size != rig[name].size:
            raise InputError(
                f"{readers[name].path} is {_by(readers[name].size)} px, but camera {name} was"
                f" calibrated at {_by(rig[name].size)}: calibrate at the size of the recording"
            )
    return rig.select([name for name in rig.names if name in wanted])


def _range(
    readers: Mapping[str, FrameReader], frames: tuple[int | None, int | None] | None
) -> tuple[int, int]:
    counts = {name: one.frame_count for name, one in readers.items()}
    shortest = min(counts.values())
    start, stop = frames or (None, None)
    first, last = start or 0, shortest if stop is None else stop
    if stop is None and len(set(counts.values())) > 1:
        lengths = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise InputError(
            f"videos differ in length ({lengths} frames): if they start together, give --frames"
            f" {first}:{shortest}; if not, `voxelpose calibrate sync` finds by how much, and writes"
            f" {NAME}"
        )
    if not 0 <= first < last <= shortest:
        short = min(counts, key=lambda name: counts[name])
        raise InputError(
            f"frames {first}:{last} are not in the recording: {readers[short].path} has {shortest}"
            f" frames (0:{shortest})"
        )
    return first, last


def _times(
    folder: Path, readers: Mapping[str, FrameReader], fps: float | None
) -> tuple[float, NDArray[np.float64]]:
    """Returns the rate and the time of every frame since the first."""
    count = min(one.frame_count for one in readers.values())
    if fps is not None:
        if not (np.isfinite(fps) and fps > 0):
            raise InputError(
                f"{fps} frames per second are impossible: give --fps as a positive number"
            )
        return fps, np.arange(count) / fps
    rates = {name: one.fps for name, one in readers.items() if one.fps is not None}
    if not rates:
        if count > 1:
            raise InputError(
                f"{folder}: folders of frames do not tell how fast they were taken: give --fps, or"
                " add timestamps.csv"
            )
        return 1.0, np.zeros(count)
    if max(rates.values()) > min(rates.values()) * (1 + _RATE_TOLERANCE):
        listed = ", ".join(f"{name} {rate:g}" for name, rate in rates.items())
        raise InputError(
            f"videos differ in rate ({listed} frames per second): `voxelpose calibrate sync --out"
            f" {folder / NAME}` puts them in step; or use the cameras of one rate with --cameras,"
            " or give --fps (and --frames A:B) if frame n was taken at the same moment in all"
        )
    rate = float(np.median(list(rates.values())))
    return rate, np.arange(count) / rate


def _stamped(
    path: Path, readers: Mapping[str, FrameReader]
) -> tuple[dict[str, FrameReader], float, NDArray[np.float64]]:
    """Puts the frames in step that were taken at the same moment; returns them, their rate, and
    their times since the first.
    """
    moments, numbers = in_step(read_timestamps(path, readers), path)
    steps = {name: one.pick(numbers[name].tolist()) for name, one in readers.items()}
    rate = 1 / float(np.median(np.diff(moments))) if len(moments) > 1 else 1.0
    return steps, rate, moments - moments[0]


def _read_subject(path: Path) -> Subject:
    if not path.exists():
        return Subject()
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
        raise InputError(f"{path} cannot be read as TOML: {error}") from None
    for key in table:
        if key not in ("stature", "chest_girth", "sex", "body"):
            raise InputError(
                f"{path}: {key} is not known: use stature, chest_girth (metres), sex, body"
            )
    for key in ("stature", "chest_girth"):
        value = table.get(key)
        if value is not None and (
            isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < 3
        ):
            raise InputError(
                f"{path}: {key} = {value!r} is impossible: give metres, for example {key} = 1.02"
            )
    sex = table.get("sex", "unknown")
    if sex not in ("male", "female", "unknown"):
        raise InputError(f'{path}: sex = {sex!r} is not known: use "male", "female" or "unknown"')
    body = None if table.get("body") is None else path.parent / str(table["body"])
    if body is not None and not body.exists():
        raise InputError(
            f"{path}: body file {body} is missing: correct the path or remove the line"
        )
    return Subject(table.get("stature"), table.get("chest_girth"), sex, body)


def _by(size: tuple[int, ...]) -> str:
    return f"{size[0]} x {size[1]}"
