"""What a recipe makes of a data set: cameras, pictures, masks and truth of one take.

A recipe only reads; `write.py` turns its `Take` into a recording folder. All that a recipe needs of
the project is imported here.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.camera import Camera, Rig  # noqa: F401
from calib.files import read_rig, write_rig  # noqa: F401
from voxelpose import InputError, Recording  # noqa: F401

FloatArray = NDArray[np.float64]

VIDEOS = (".mp4", ".avi", ".mov", ".mkv", ".m4v", ".webm", ".mpg", ".mpeg", ".wmv")
STILLS = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pbm", ".pgm", ".ppm", ".webp")

# Rows: the new x, y and z in the old axes; the axis that points up in the data set becomes z.
_UPRIGHT = {
    "z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "y": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    "x": [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
    "-z": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    "-y": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "-x": [[0, -1, 0], [0, 0, 1], [-1, 0, 0]],
}
UP_AXES = tuple(_UPRIGHT)


@dataclass(frozen=True)
class Pictures:
    """The pictures of one camera: a video, or the stills of a folder in the order of their numbers.

    Attributes:
        path: the video or the folder.
        stills: the frames' files; empty for a video.
    """

    path: Path
    stills: tuple[Path, ...] = ()

    @classmethod
    def open(cls, path: Path) -> "Pictures":
        """Looks at a video, a still or a folder of stills.

        Raises:
            InputError: it is missing or holds no pictures.
        """
        if path.is_dir():
            stills = sorted(
                (f for f in path.iterdir() if f.suffix.lower() in STILLS), key=numbers_of
            )
            if not stills:
                raise InputError(f"{path} holds no images: extract the data set's frames there")
            return cls(path, tuple(stills))
        if not path.is_file():
            raise InputError(
                f"{path} is missing: download it, or leave this camera out (--cameras)"
            )
        return cls(path, (path,) if path.suffix.lower() in STILLS else ())

    @cached_property
    def _probed(self) -> tuple[tuple[int, int], int, float | None]:
        if self.stills:
            image = read_image(self.stills[0])
            return (image.shape[1], image.shape[0]), len(self.stills), None
        capture = cv2.VideoCapture(str(self.path))
        try:
            good, frame = capture.read()
            if not good or frame is None:
                raise InputError(f"{self.path} cannot be read as a video: download it again")
            count, fps = round(capture.get(cv2.CAP_PROP_FRAME_COUNT)), capture.get(cv2.CAP_PROP_FPS)
        finally:
            capture.release()
        return (
            (frame.shape[1], frame.shape[0]),
            count,
            fps if np.isfinite(fps) and fps > 0 else None,
        )

    @property
    def is_video(self) -> bool:
        """Whether the path is a video."""
        return not self.stills

    @property
    def size(self) -> tuple[int, int]:
        """(width, height), px, of the first picture."""
        return self._probed[0]

    @property
    def count(self) -> int:
        """How many frames there are."""
        return self._probed[1]

    @property
    def fps(self) -> float | None:
        """Frames per second, as the video says; None for stills."""
        return self._probed[2]

    def frames(self, begin: int, count: int) -> Iterator[NDArray[np.uint8]]:
        """Yields frames from `begin` on, (H, W, 3) uint8 BGR; a video is decoded from its start.

        Raises:
            InputError: one is missing or cannot be read.
        """
        if self.stills:
            yield from map(read_image, self.stills[begin : begin + count])
            return
        capture = cv2.VideoCapture(str(self.path))
        try:
            good = all(capture.grab() for _ in range(begin))
            for number in range(begin, begin + count):
                good, frame = capture.read() if good else (False, None)
                if not good:
                    raise InputError(
                        f"{self.path} cannot be read beyond frame {number}: download it again, "
                        "or choose earlier frames (--frames)"
                    )
                yield np.asarray(frame, np.uint8)
        finally:
            capture.release()


@dataclass(frozen=True)
class View:
    """What one camera saw.

    Attributes:
        camera: in metres, in a world whose z points up.
        pictures: its video or stills; None where the data set has masks only.
        start: the file's frame that is frame 0 of the take, where files begin at different moments.
            Frame 0 is the first moment that all cameras filmed: one of them starts with it.
        masks: silhouettes of the same frames; a pixel is the person where any channel exceeds
            `mask_above`.
        mask_above: see `masks`.
        background: the same view empty.
    """

    camera: Camera
    pictures: Pictures | None
    start: int = 0
    masks: Pictures | None = None
    mask_above: int = 127
    background: Pictures | None = None


@dataclass(frozen=True, eq=False)
class Take:
    """One recording, as a recipe read it.

    Attributes:
        views: the cameras.
        fps: frames per second; None where the videos say it.
        truth: (T, 15, 3) float64, m, world with z up, joints in the order of `truth.JOINTS`; NaN
            where unknown; None where the data set has none. Row 0 belongs to frame 0 of the take.
        approximate: joints of `truth` that the data set does not have and that were constructed.
        notes: which part of the data set it is, for the calibration's [metadata].
    """

    views: tuple[View, ...]
    fps: float | None = None
    truth: FloatArray | None = None
    approximate: tuple[str, ...] = ()
    notes: dict[str, str] = field(default_factory=dict)


def upright(axis: str) -> FloatArray:
    """Returns the rotation, (3, 3), of a world whose `axis` points up to one whose z does."""
    return np.array(_UPRIGHT[axis], dtype=np.float64)


def placed(camera: Camera, up: str, unit_m: float = 1.0, name: str | None = None) -> Camera:
    """Returns the camera in a world in metres whose z points up.

    Args:
        camera: its translation in the data set's unit, its rotation from the data set's world.
        up: the axis that points up in the data set's world.
        unit_m: the data set's unit, m.
        name: a new one.
    """
    return made(
        "",
        name=name or camera.name,
        size=camera.size,
        matrix=camera.matrix,
        distortion=camera.distortion,
        rotation=camera.rotation @ upright(up).T,
        translation=unit_m * camera.translation,
        fisheye=camera.fisheye,
    )


def made(
    where: object,
    *,
    name: str,
    size: Sequence[float],
    matrix: ArrayLike,
    distortion: ArrayLike,
    rotation: ArrayLike,
    translation: ArrayLike,
    fisheye: bool = False,
) -> Camera:
    """Makes a camera, its rotation freed from the file's rounding.

    Args:
        where: the file it comes from, for messages.
        name: of the camera.
        size: (width, height), px.
        matrix: (3, 3), px.
        distortion: (n,), OpenCV's order.
        rotation: (3, 3), camera from world, or a Rodrigues vector (3,), rad.
        translation: (3,), camera from world.
        fisheye: whether the distortion is OpenCV's fisheye model.

    Raises:
        InputError: a value has the wrong shape or is impossible.
    """
    try:
        turn = np.asarray(rotation, dtype=np.float64)
        if turn.size == 3:
            turn = cv2.Rodrigues(turn.reshape(3, 1))[0]
        u, stretch, vt = np.linalg.svd(turn.reshape(3, 3))
        if np.abs(stretch - 1).max() > 0.01 or np.linalg.det(u @ vt) < 0:
            raise ValueError(f"camera {name}: rotation is no rotation: {turn.tolist()}")
        return Camera(
            name,
            (round(size[0]), round(size[1])),
            np.asarray(matrix, dtype=np.float64).reshape(3, 3),
            np.asarray(distortion, dtype=np.float64).reshape(-1),
            u @ vt,
            np.asarray(translation, dtype=np.float64).reshape(3),
            fisheye,
        )
    except (ValueError, TypeError, IndexError, np.linalg.LinAlgError) as error:
        raise InputError(f"{where}: {error}: download the calibration again") from None


def camera_name(own: str) -> str:
    """Returns the name of a camera in the recording: the data set's own, with cam_ before it."""
    plain = re.sub(r"[^A-Za-z0-9_-]+", "_", own).strip("_")
    return plain if plain.lower().startswith("cam") else f"cam_{plain}"


def choose(
    found: Iterable[str], wanted: Sequence[str] | None, what: str, where: object
) -> list[str]:
    """Returns the wanted names of those found; all where None is wanted.

    Raises:
        InputError: nothing was found, or a wanted name is not among it.
    """
    names = list(found)
    if not names:
        raise InputError(f"{where} holds no {what}: give the folder that the card describes")
    missing = [name for name in wanted or () if name not in names]
    if missing:
        listed = ", ".join(names[:40]) + (" ..." if len(names) > 40 else "")
        raise InputError(f"there is no {what} {missing[0]!r} in {where}: it has {listed}")
    return names if wanted is None else [name for name in names if name in wanted]


def one_of(folder: Path, *relative: str) -> Path:
    """Returns the first of several files or folders that exists.

    Raises:
        InputError: none does.
    """
    for name in relative:
        if (folder / name).exists():
            return folder / name
    raise InputError(
        f"{folder / relative[0]} is missing: download it, or correct the source folder"
    )


def find_pictures(path: Path) -> Path | None:
    """Returns the video, folder of stills or still that a path without suffix means; None: none."""
    if path.is_dir():
        return path if any(f.suffix.lower() in STILLS for f in path.iterdir()) else None
    known = (*VIDEOS, *STILLS)
    if path.is_file():
        return path if path.suffix.lower() in known else None
    beside = sorted(path.parent.glob("*")) if path.parent.is_dir() else []
    return next((f for f in beside if f.stem == path.name and f.suffix.lower() in known), None)


def read_image(file: Path) -> NDArray[np.uint8]:
    """Returns an image file's picture, (H, W, 3) uint8 BGR.

    Raises:
        InputError: it is missing or no image.
    """
    try:
        image = cv2.imdecode(np.fromfile(file, np.uint8), cv2.IMREAD_COLOR)
    except (OSError, cv2.error):
        image = None
    if image is None:
        raise InputError(f"{file} cannot be read as an image: extract or download it again")
    return np.asarray(image, np.uint8)


def read_text(file: Path) -> str:
    """Returns a text file's content.

    Raises:
        InputError: it is missing, or no text.
    """
    try:
        return file.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{file} is missing: download it, or correct the source folder") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file} cannot be read as text: {error}: download it again") from None


def read_numbers(
    words: Iterable[str], file: Path, what: str, count: int | None = None
) -> FloatArray:
    """Returns words as finite float64 numbers.

    Args:
        words: the numbers' text.
        file: where they stand, for messages.
        what: they are, for messages.
        count: how many there have to be.

    Raises:
        InputError: one is no number, or there are too many or too few.
    """
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError as error:
        raise InputError(f"{file}: {what} cannot be read ({error}): download it again") from None
    if (count is not None and len(numbers) != count) or not np.isfinite(numbers).all():
        raise InputError(
            f"{file}: {what} must be {count or 'finite'} numbers, got {len(numbers)}: "
            "download it again"
        )
    return numbers


def numbers_of(path: Path) -> list[tuple[int, str]]:
    """Sorts frame_2 before frame_10."""
    words = re.split(r"(\d+)", path.name)
    return [(int(word), "") if word.isdigit() else (-1, word) for word in words if word]


def number_in(name: str) -> int | None:
    """Returns the last whole number in a name; None where it has none."""
    found = re.findall(r"\d+", name)
    return int(found[-1]) if found else None
