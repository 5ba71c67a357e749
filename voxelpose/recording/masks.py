"""Masks of whatever habit, read as silhouettes: which values are the person, a sequence as a whole
tells.

Opacity counts where it varies, else the values: of any type and scale, labels or colours.
`mask_labels.py` says which of several labels is the person's.
"""

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from calib.moments import even_moments
from voxelpose.recording.ffmpeg import video_address, words_on
from voxelpose.recording.frame_reader import UNREADABLE, Frame, FrameReader, pillow, read_image
from voxelpose.recording.mask_levels import (
    Layers,
    MaskForm,
    MaskLevels,
    Plane,
    codes_of,
    nearest_value,
)

_SAMPLES = 12  # pictures of a sequence that are looked at beforehand
_TABLE = 65536
_ALPHA_DECODERS = {"VP80": "libvpx", "VP90": "libvpx-vp9"}  # FFmpeg's own leave opacity out
_LOOKED_AT = 100  # images that are asked whether they have an opacity
_LAYERED = (".mov", ".webm", ".mkv", ".avi")  # videos that may have an opacity
_TRANSPARENT = re.compile(r"alpha_mode *: 1|Video: .*\b(yuva|rgba|bgra|argb|abgr|gbrap|ya)\w*")
_MOST_COLOURS = 64  # of a palette whose numbers are labels


@dataclass(frozen=True, eq=False)
class MaskRule:
    """Which pixels are the person."""

    form: MaskForm  #: what of the pictures counts.
    inside: NDArray[np.float64] | None
    """(N, C) values of the person; None: all that is not the background."""
    outside: NDArray[np.float64]  #: (M, C) other values, the background first.
    noise: float  #: largest difference from the background of what is background all the same.
    exact: bool  #: whether a colour is another one if it differs at all.

    def mask(self, layers: Layers) -> NDArray[np.bool_]:
        """The person (H, W) bool in a picture."""
        plane = self.form.plane(layers)
        if plane.shape[2] == 1:
            return self._table[plane[..., 0].astype(np.int32)]
        return self._inside(plane)

    @cached_property
    def _table(self) -> NDArray[np.bool_]:
        """Whether a value is the person's, of all that there are in one channel."""
        values = np.arange(_TABLE, dtype=np.float32)
        return self._inside(values.reshape(1, -1, 1))[0]

    def _inside(self, plane: Plane) -> NDArray[np.bool_]:
        if self.inside is None:
            background = self.outside[0].astype(np.float32)
            return np.abs(plane - background).max(axis=2) > self.noise
        if plane.shape[2] > 1 and self.exact:
            return np.isin(codes_of(plane), codes_of(self.inside[None].astype(np.float32)))
        return nearest_value(plane, np.concatenate([self.outside, self.inside])) >= len(
            self.outside
        )


@dataclass(frozen=True)
class MaskReader(FrameReader):
    """Masks of one camera; as frames they are white where the person is."""

    rule: MaskRule | None = field(default=None, compare=False)  #: which pixels are the person.

    def layers(self, numbers: Sequence[int]) -> Iterator[Layers]:
        """Yields pictures as the file has them, by their numbers in ascending order. InputError
        where one cannot be read.
        """
        if self.stills:
            return (_still_layers(self.stills[number]) for number in numbers)
        depth, words = _raw_words(self.path)
        return self._raw(numbers, depth, words) if depth else map(Layers.of, self._video(numbers))

    def samples(self) -> list[Layers]:
        """Some pictures of the sequence; all that are not empty count where these are."""
        numbers = even_moments(self.frame_count, _SAMPLES, margin=0).tolist()
        samples = list(self.layers(numbers))
        if not any(map(_holds_something, samples)):
            others = filter(_holds_something, self.layers(range(self.frame_count)))
            samples += [layers for layers, _ in zip(others, range(_SAMPLES), strict=False)]
        return samples

    @staticmethod
    def _size_of(still: Path, sensor: bool) -> tuple[int, int]:
        height, width = _still_layers(still).values.shape[:2]
        return width, height

    @staticmethod
    def _bits_of(stills: Sequence[Path]) -> int:
        return 8  # of masks, whose values are no brightness

    def _pictures(self, numbers: Sequence[int]) -> Iterator[Frame]:
        if self.rule is None:
            raise ValueError("masks need a rule before they are silhouettes")
        for number, layers in zip(numbers, self.layers(numbers), strict=True):
            if self.rule.form.alpha and layers.alpha is None:
                raise half_cut_out(self.stills[number] if self.stills else self.path)
            mask = self.rule.mask(layers).view(np.uint8) * np.uint8(255)
            yield np.repeat(mask[..., None], 3, axis=2)

    def _raw(self, numbers: Sequence[int], depth: int, words: list[str]) -> Iterator[Layers]:
        """Pictures of a video that OpenCV would rob of its opacity, or of its bits."""
        import imageio_ffmpeg

        width, height = self.size
        pictures = imageio_ffmpeg.read_frames(
            video_address(self.path),
            pix_fmt="rgba64le" if depth > 8 else "rgba",
            bits_per_pixel=4 * depth,
            input_params=words,
            output_params=["-fps_mode", "passthrough"],
        )
        try:
            position, data = 0, next(pictures)
            for number in numbers:
                while position <= number:
                    data, position = next(pictures, b""), position + 1
                if len(data) != width * height * depth // 2:
                    raise InputError(
                        f"{self.path} cannot be read beyond frame {number}: write it as FFV1 (.avi)"
                    )
                picture = np.frombuffer(data, f"<u{depth // 8}").reshape(height, width, 4)
                yield Layers.of(picture[..., [2, 1, 0, 3]])
        finally:
            pictures.close()


def half_cut_out(path: Path) -> InputError:
    """Error that names a picture, or all of a camera, without the opacity that others have."""
    which = "holds some that have" if path.is_dir() else "has"
    return InputError(
        f"{path} {which} no opacity, and others have: cut out all, or take the opacity out of all"
    )


def may_be_transparent(reader: FrameReader) -> bool:
    """Whether any of the frames, of some that are looked at, has an opacity; none is decoded."""
    if not reader.stills:
        if reader.path.suffix.lower() not in _LAYERED or not _raw_words(reader.path)[0]:
            return False
        return _TRANSPARENT.search(words_on(reader.path)) is not None
    step = -(-len(reader.stills) // _LOOKED_AT)
    return any(_has_alpha(still) for still in reader.stills[::step])


def _has_alpha(file: Path) -> bool:
    with suppress(*UNREADABLE, pillow().DecompressionBombError), pillow().open(file) as image:
        return "A" in image.getbands() or "transparency" in image.info
    return False


def painted(path: Path) -> NDArray[np.bool_]:
    """What is painted (H, W) bool in a picture that marks places, or in a video's first: what is
    opaque in a layer, else what is not black. InputError where it cannot be read.
    """
    layers = next(iter(MaskReader.open(path).layers([0])))
    if layers.alpha is not None and not layers.alpha.any() and not _holds_something(layers):
        return np.zeros(layers.alpha.shape, np.bool_)
    form = MaskForm.of([layers], labels=False)
    plane = form.plane(layers)
    values = MaskLevels.of([plane]).values
    marked = values[values > 0]
    return plane[..., 0] > (marked.min() if len(marked) else plane.max()) / 2


def _holds_something(layers: Layers) -> bool:
    """Whether a picture is not of one value all over."""
    return any(one is not None and one.min() < one.max() for one in layers)


def _still_layers(file: Path) -> Layers:
    """Layers of an image; the numbers of a palette whose colours tell less than they do."""
    jpeg = file.suffix.lower() in (".jpg", ".jpeg")  # may be turned, as its tags say
    picture = read_image(file, cv2.IMREAD_COLOR if jpeg else cv2.IMREAD_UNCHANGED)
    numbers = _palette_numbers(file)
    if numbers is not None and numbers.shape == picture.shape[:2]:
        return Layers(numbers, None)
    return Layers.of(picture)


def _palette_numbers(file: Path) -> NDArray[np.uint8] | None:
    """Numbers (H, W) of the palette's colours; None where there is none, where it is grey or
    transparent, or where it has as many colours as pictures have.
    """
    if file.suffix.lower() not in (".png", ".bmp", ".tif", ".tiff"):
        return None
    try:
        with pillow().open(file) as image:
            if image.mode != "P" or "transparency" in image.info:
                return None
            numbers = np.asarray(image)
            palette = np.array(image.getpalette()).reshape(-1, 3)
    except UNREADABLE:
        return None
    used = np.unique(numbers)
    colours = palette[used[used < len(palette)]]
    grey = bool((colours == colours[:, :1]).all())
    told_apart = len(np.unique(colours, axis=0)) == len(used)
    return None if len(used) > _MOST_COLOURS or (grey and told_apart) else numbers


def _raw_words(path: Path) -> tuple[int, list[str]]:
    """Bits of a channel and words for FFmpeg, of a video that OpenCV does not read as it is; 0: it
    does.
    """
    capture = cv2.VideoCapture(video_address(path))
    try:
        tags = [cv2.CAP_PROP_CODEC_PIXEL_FORMAT, cv2.CAP_PROP_FOURCC]
        pixels, codec = (int(capture.get(tag)).to_bytes(4, "little", signed=True) for tag in tags)
    finally:
        capture.release()
    decoder = _ALPHA_DECODERS.get(codec.decode("ascii", "replace").upper())
    if decoder is not None:
        return 8, ["-c:v", decoder]
    if pixels[3] in range(9, 17) and pixels[2] < 32:  # such tags hold the number of bits
        return 16, []
    return (8, []) if b"A" in pixels or pixels[2:] == b"\x0b\x08" else (0, [])
