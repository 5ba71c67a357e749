"""Frames of one camera, read in order from a video, a folder of images or a single image."""

import os
import struct
import warnings
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from functools import cache
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any, BinaryIO, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.errors import InputError
from calib.storage.documents import visible_entries
from voxelpose.recording.ffmpeg import (
    CodedPictures,
    FieldCapture,
    coded_pictures,
    has_fields,
    video_address,
)
from voxelpose.recording.image_names import in_order

Frame = NDArray[np.uint8]
STILLS = frozenset(".png .jpg .jpeg .bmp .tif .tiff .pbm .pgm .ppm .webp".split())
VIDEOS = frozenset(
    ".mp4 .avi .mov .mkv .m4v .webm .mpg .mpeg .wmv .mts .m2ts .ts .3gp .ogv".split()
)
_COUNTED = frozenset(".avi .mp4 .mov .m4v .3gp".split())  # the others' numbers are estimates
_MOST_PX = 100_000_000
_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8\xff\xd9"  # begin and end
_BOXES = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip")
_LAST_BYTES = 4096
_LARGEST_BYTES = 8 * _MOST_PX
_FEW_FRAMES, _FEW_PERCENT = 3, 2  # frames, or share of them, that files promise and lack
_DEEP = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH
_ORIENTATION = 0x0112  # of EXIF
UNREADABLE = (OSError, ValueError, SyntaxError, EOFError, struct.error, KeyError, TypeError)
"""What Pillow raises where it cannot read a file."""
_ASKED = 16  # images of a sequence whose brightest values tell its bits
_SPARSE = 32  # rows of a picture, of which one is compared with the picture before
_AHEAD = 3  # frames that a camera may be read ahead of the others


@dataclass(frozen=True)
class FrameReader:
    """Frames of one camera; iterating reads them from the start and may be repeated."""

    path: Path  #: video, image, or folder of images.
    stills: tuple[Path, ...]
    """The image files where path is an image or a folder; empty for a video."""
    size: tuple[int, int]  #: image (width, height), px, after the rotation stated in the video.
    frame_count: int  #: number of frames that can be read.
    fps: float | None  #: frames per second; None where the files do not state it.
    numbers: tuple[int, ...] | None = None
    """Selected frames of the file in ascending order, possibly repeated; None selects all."""
    promised: int = 0  #: number of frames that the file says it has; 0 where it says none.
    shown_s: NDArray[np.float64] | None = field(default=None, compare=False)
    """(frame_count,) float64, s, when a video shows its frames; None where it does not tell."""
    bits: int = 8
    """Of the brightest value in images of 16 bits, of which the upper 8 are used; else 8."""
    sensor: bool = False
    """Whether images are read as the sensor has them, since their EXIF data turn them differently:
    a lens belongs to the sensor."""
    coded: CodedPictures = field(default=CodedPictures(), compare=False)
    """What the file tells of its pictures; one that is interlaced is read by FFmpeg."""

    @classmethod
    def open(cls, path: Path) -> Self:
        """Opens a video, an image or a folder of images. InputError where it is missing, empty or
        cannot be read.
        """
        if not path.exists():
            raise InputError(f"{path} is missing")
        stills = ()
        if path.is_dir():
            images = (file for file in visible_entries(path) if file.suffix.lower() in STILLS)
            stills = in_order([*images])
            if not stills:
                raise InputError(
                    f"{path} holds no frames: put images there ({', '.join(sorted(STILLS))}) or"
                    " remove the folder"
                )
        elif path.suffix.lower() in STILLS:
            stills = (path,)
        if stills:
            bits, sensor = cls._bits_of(stills), turned_differently(stills)
            size = cls._size_of(stills[0], sensor)
            lengths = [still.stat().st_size for still in stills]
            alike = any(length == other for length, other in pairwise(lengths))
            count = len(stills)
            coded = CodedPictures(may_repeat=alike)
            return cls(path, stills, size, count, None, bits=bits, sensor=sensor, coded=coded)
        return cls(path, (), **_probe(path))

    @property
    def nearly_whole(self) -> bool:
        """Whether the file lacks hardly any of the frames that it promises."""
        few = max(_FEW_FRAMES, _FEW_PERCENT * self.promised / 100)
        return self.promised - self.frame_count <= few

    def __iter__(self) -> Iterator[Frame]:
        """Yields every frame, (H, W, 3) uint8, BGR."""
        return self.frames(0, self.frame_count)

    def frames(self, start: int, stop: int) -> Iterator[Frame]:
        """Yields the frames start, start + 1, ..., stop - 1. InputError where a frame is missing,
        unreadable, or of another size.
        """
        numbers = range(start, stop) if self.numbers is None else self.numbers[start:stop]
        for number, frame in zip(numbers, self._pictures(numbers), strict=True):
            if frame.shape[1::-1] != self.size:
                raise InputError(
                    f"{self.path}: frame {number} is {size_text(frame.shape[1::-1])} px, the first"
                    f" {size_text(self.size)}: make all the same size"
                )
            yield frame

    def select(self, numbers: Sequence[int]) -> Self:
        """Reader of frames with these numbers, in ascending order, perhaps repeated."""
        selected = tuple(
            int(number) if self.numbers is None else self.numbers[number] for number in numbers
        )
        shown_s = None if self.shown_s is None else self.shown_s[list(numbers)]
        count = len(selected)
        return replace(self, numbers=selected, frame_count=count, promised=0, shown_s=shown_s)

    @staticmethod
    def _size_of(still: Path, sensor: bool) -> tuple[int, int]:
        height, width = read_still(still, sensor=sensor).shape[:2]
        return width, height

    @staticmethod
    def _bits_of(stills: Sequence[Path]) -> int:
        """Bits, 8 to 16, that the values of images of 16 bits have: 10 or 12 of many cameras."""
        if read_image(stills[0], _DEEP).dtype != np.uint16:
            return 8
        asked = stills[:: -(-len(stills) // _ASKED)]
        return max(8, *(int(read_image(still, _DEEP).max()).bit_length() for still in asked))

    def _pictures(self, numbers: Sequence[int]) -> Iterator[Frame]:
        """Yields frames of the file by their numbers, whatever their size."""
        if self.stills:
            stills = (self.stills[number] for number in numbers)
            return (read_still(still, self.bits, self.sensor) for still in stills)
        return self._video(numbers)

    def _video(self, numbers: Sequence[int]) -> Iterator[Frame]:
        capture = FieldCapture(self.path, self.size) if self.coded.interlaced else None
        capture = capture or cv2.VideoCapture(video_address(self.path))
        position, frame, rows = 0, None, b""
        try:
            for number in numbers:
                # Skip by decoding: seeking lands on a wrong frame in some containers.
                good = all(capture.grab() for _ in range(position, number - 1))
                position = max(position, number - 1)
                while good and (position <= number or frame is None):
                    good, frame = capture.read()
                    position += 1
                    before, rows = rows, b"" if frame is None else frame[::_SPARSE].tobytes()
                    # OpenCV may have left the picture before where it converted none.
                    if rows and rows == before and self._has_fields(capture):
                        capture.release()
                        capture = FieldCapture(self.path, self.size)
                        good = all(capture.grab() for _ in range(position - 1))
                        position -= 1
                if not good or frame is None:
                    raise InputError(
                        f"{self.path} cannot be read beyond frame {number}: repair it, or give"
                        f" --frames 0:{number}"
                    )
                # A repeated frame must not carry what the caller drew on it the first time.
                yield _three_channels(frame if self.numbers is None else frame.copy())
        finally:
            capture.release()

    def _has_fields(self, capture: object) -> bool:
        """Whether a file that OpenCV reads has pictures that it does not convert."""
        opened = isinstance(capture, FieldCapture)
        return not opened and has_fields(self.path, self.path.stat().st_mtime_ns)


def read_together(
    readers: Mapping[str, FrameReader], start: int, stop: int
) -> Iterator[dict[str, Frame]]:
    """Reads several cameras in parallel, one thread each, a few frames ahead at most. InputError
    where a camera's frames cannot be read. Yields frames by camera name.
    """
    with ExitStack() as pools:
        ahead = {}
        for name, reader in readers.items():
            pool, frames = ThreadPoolExecutor(1, f"read {name}"), reader.frames(start, stop)
            pools.callback(pool.shutdown, cancel_futures=True)
            ahead[name] = pool, frames, deque(pool.submit(next, frames) for _ in range(_AHEAD))
        for _ in range(start, stop):
            step: dict[str, Frame] = {}
            for name, (pool, frames, waiting) in ahead.items():
                step[name] = waiting.popleft().result()
                waiting.append(pool.submit(next, frames))
            yield step


def _probe(path: Path) -> dict[str, Any]:
    """What a `FrameReader` knows of a video, by name."""
    capture = cv2.VideoCapture(video_address(path))
    try:
        good, frame = capture.read()
        if not good or frame is None:
            remedy = "convert it, for example with ffmpeg to .mp4 (H.264)"
            raise InputError(f"{path} cannot be read as a video: {cut_off(path) or remedy}")
        count = promised = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        fps = float(capture.get(cv2.CAP_PROP_FPS))
        # Some containers announce more frames than they hold, or fewer: only then all are counted.
        coded, counted = coded_pictures(path), path.suffix.lower() in _COUNTED
        if count > 1:
            capture.set(cv2.CAP_PROP_POS_FRAMES, count - 1)
        if count < 1 or (count > 1 and not capture.grab()) or (count < coded.count and not counted):
            capture.release()
            capture = cv2.VideoCapture(video_address(path))
            count = 0
            while capture.grab():
                count += 1
    finally:
        capture.release()
    count = min(count, coded.count or count)  # a header may count empty pieces, or lost frames
    height, width = frame.shape[:2]
    return {
        "size": (width, height),
        "frame_count": count,
        "fps": fps if np.isfinite(fps) and fps > 0 else None,
        "promised": promised - coded.cut_off if counted else count,
        "shown_s": coded.shown_s if coded.count == count else None,
        "coded": coded,
    }


def turned_differently(stills: Sequence[Path]) -> bool:
    """Whether EXIF data turn some images otherwise than others, as of a telephone that is held now
    upright and now across.
    """
    return len({_orientation(still) for still in stills}) > 1


def _orientation(file: Path) -> int:
    """Number by which EXIF data turn an image; 1: they do not."""
    with suppress(*UNREADABLE), pillow().open(file) as image:
        # Pillow would read all of a PNG to look for them.
        if image.format != "PNG" or "exif" in image.info:
            return int(image.getexif().get(_ORIENTATION, 1))
    return 1


def read_still(file: Path, bits: int = 8, sensor: bool = False) -> Frame:
    """Reads an image file as (H, W, 3) uint8, BGR. InputError where the file is missing or is not
    an image.

    Args:
        bits: as of `FrameReader`; `sensor` likewise.
    """
    as_is = cv2.IMREAD_IGNORE_ORIENTATION if sensor else 0
    if bits == 8:
        return _three_channels(read_image(file, cv2.IMREAD_COLOR | as_is))
    return _three_channels(np.minimum(read_image(file, _DEEP | as_is) >> (bits - 8), 255))


def read_image(file: Path, flags: int) -> np.ndarray:
    """Reads an image file as OpenCV's `imdecode` does with these flags. InputError where the file
    is missing or is not an image.
    """
    try:
        if file.stat().st_size > _LARGEST_BYTES:
            raise InputError(f"{file} is larger than any camera's image: convert it to PNG")
        # Not imread: it cannot open names with letters outside the code page on Windows.
        data = np.fromfile(file, np.uint8)
        image = cv2.imdecode(data, flags) if _is_decodable(data, file) else None
    except (OSError, cv2.error):
        image = None
    if image is None:
        remedy = cut_off(file) or "convert it to PNG"
        raise InputError(f"{file} cannot be read as an image: {remedy}")
    return image


def _is_decodable(data: NDArray[np.uint8], file: Path) -> bool:
    """Whether an image says that it is of a size that a camera's may have, before it is decoded:
    few bytes may decode to gigabytes. InputError where it is too large.
    """
    try:
        # Not the file: a network drive opens it slowly.
        with pillow().open(BytesIO(data.tobytes())) as image:
            size, count = image.size, getattr(image, "n_frames", 1)
            if count > 1 and image.format != "MPO":  # a telephone's second picture is no other one
                raise InputError(f"{file} holds {count} images: give each a file of its own")
    except pillow().DecompressionBombError:
        size = None
    except UNREADABLE:
        # Pillow does not know all TIFF files that OpenCV decodes.
        return file.suffix.lower() in (".tif", ".tiff")
    if size is None or size[0] * size[1] > _MOST_PX:
        raise InputError(
            f"{file} says that it has {'very many' if size is None else size_text(size)} pixels:"
            f" give an image of at most {_MOST_PX / 1e6:.0f} megapixels"
        )
    return _has_its_chunks(data)


@cache
def pillow() -> Any:
    """Pillow, loaded with the first image, without its warnings: what matters is told here."""
    from PIL import Image

    warnings.filterwarnings("ignore", module=r"PIL\.")
    return Image


def cut_off(file: Path) -> str:
    """Words on a video or image that ends early, as one does that was copied in part; "" where that
    cannot be seen.
    """
    try:
        size = file.stat().st_size
        with file.open("rb") as opened:
            start = opened.read(12)
            if start[4:8] in _BOXES:
                whole = _has_its_boxes(opened, size)
            elif start[:4] == b"RIFF":
                whole = size >= 8 + int.from_bytes(start[4:8], "little")
            elif start[:2] == _JPEG[:2]:
                opened.seek(-min(size, _LAST_BYTES), os.SEEK_END)
                whole = _JPEG[2:] in opened.read()
            else:
                whole = size > 0 and not (
                    start.startswith(_PNG)
                    and not _has_its_chunks(np.frombuffer(file.read_bytes(), np.uint8))
                )
    except OSError:
        return ""
    if whole:
        return ""
    return f"it {'ends early, or was not finished' if size else 'is empty'}: copy it again"


def _has_its_boxes(opened: BinaryIO, size: int) -> bool:
    """Whether an MP4 holds its boxes to their ends, and among them its table of frames."""
    position, kinds = 0, set()
    while position + 8 <= size:
        opened.seek(position)
        header = opened.read(16)
        length, kind = int.from_bytes(header[:4], "big"), header[4:8]
        if length == 1:
            length = int.from_bytes(header[8:16], "big")
        kinds.add(kind)
        position = size if length == 0 else position + max(length, 8)
    return position <= size and b"moov" in kinds


def _has_its_chunks(data: NDArray[np.uint8]) -> bool:
    """Whether the chunks of a PNG are in the file: OpenCV makes room before it looks."""
    position = len(_PNG)
    if data[:position].tobytes() != _PNG:
        return True
    while position + 8 <= len(data):
        header = data[position : position + 8].tobytes()
        position += 12 + int.from_bytes(header[:4], "big")
        if header[4:] == b"IEND":
            return True
    return position <= len(data)


def _three_channels(image: np.ndarray) -> Frame:
    if image.ndim == 2:
        image = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    return np.ascontiguousarray(image, np.uint8)


def other_size(path: Path, size: tuple[int, int], camera: Camera, remedy: str) -> InputError:
    """Error that names pictures (width, height) px of another size than their camera's."""
    if size == camera.size[::-1]:
        remedy = "is one of them in portrait? Turn it, as with ffmpeg -vf transpose=1"
    return InputError(
        f"{path} is {size_text(size)} px, but camera {camera.name} was calibrated at"
        f" {size_text(camera.size)}: {remedy}"
    )


def size_text(size: tuple[int, ...]) -> str:
    """Returns an image size as text for messages: "640 x 480"."""
    return f"{size[0]} x {size[1]}"
