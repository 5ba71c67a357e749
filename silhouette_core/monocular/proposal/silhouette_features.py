"""From silhouettes over time to what the network of the proposal reads.

A silhouette becomes a grid of coverage and a finer one of its lowest part, the first a few codes of
a convolutional encoder and the second a few principal components, and these are read at several
instants within 0.4 s, stated in seconds so that any frame rate will do. The feet tell whether a
person is seen from the front or from behind. Where colours are known, a third grid holds what has
the colours of the head: mostly the hands and arms, which a silhouette does not show before the
trunk; and a fourth one how bright every place is relative to others of its colour, which tells
limbs that point toward the camera from those that point away, and those before the trunk from those
behind it. Both are read by a second encoder. Where a pose network sees joints in the picture, their
places are read as they are.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.checks import (
    BoolArray,
    ByteArray,
    Float32Array,
    FloatArray,
    IndexArray,
    IntArray,
    RealArray,
    check_array,
)
from silhouette_core.body.joints import EXCHANGED_LANDMARKS, LANDMARK_NAMES
from silhouette_core.image.cleanup import reduce_silhouette
from silhouette_core.monocular.window import SIZE, STATURE_PX

GRID = SIZE[1] // 4, SIZE[0] // 4  #: Rows and columns of the grid of coverage, (60, 80).
FEET_GRID = (28, 48)  #: Rows and columns of the grid of the lowest part, of half the cell size.
STATURE_CELLS = STATURE_PX / 4  #: Cells of a stature at the assumed distance.
FULL = 4  #: Coverage of a cell inside the silhouette.
NEUTRAL = 32  #: Shading of a cell as bright as others of its colour, or outside the silhouette.
OFFSETS_S = np.array([-12, -8, -5, -2, 2, 5, 8, 12]) / 30  #: Instants read beside a frame's own, s.
OUTLINE_CODES, FEET_COMPONENTS, INSIDE_CODES = 128, 48, 96
"""Codes of the outline, principal components of the feet, codes of what lies inside."""
SEEN_CODES = 3 * len(LANDMARK_NAMES)  #: Numbers that state where joints are seen, see `seen_codes`.
# Codes that are read of the instants beside a frame's own.
_OUTLINE_BESIDE, _INSIDE_BESIDE = 48, 40
_SHADES = 48  # levels of a factor of e
_CONTRAST = 1 / 16  # of levels, as the second encoder reads them
_BLOCK = 256  # larger inner dimensions are split by BLAS, and otherwise with other threads


@dataclass(frozen=True, eq=False)
class SilhouetteCodes:
    """Codes of T silhouettes, from `PoseProposal.codes`: float32, or float16 while a proposal is
    learned, which takes half the memory.
    """

    outline: RealArray  #: (T, K), of the whole silhouette.
    feet: RealArray  #: (T, K'), of its lowest part.
    inside: RealArray  #: (T, K''), of what lies inside it; 0 where colours are not known.
    coloured: BoolArray  #: (T,) bool, where they are known.
    joints: RealArray  #: (T, 45), of the joints that are seen, see `seen_codes`; 0 where none are.

    @classmethod
    def joined(cls, parts: "Sequence[SilhouetteCodes]") -> "SilhouetteCodes":
        """Codes of several sequences of silhouettes, one after the other."""
        return cls(*map(np.concatenate, zip(*(vars(part).values() for part in parts), strict=True)))

    def __getitem__(self, rows: IndexArray | slice) -> "SilhouetteCodes":
        """Codes of some of the silhouettes."""
        return SilhouetteCodes(*(codes[rows] for codes in vars(self).values()))

    def __len__(self) -> int:
        """Number of silhouettes."""
        return len(self.outline)


@dataclass(frozen=True, eq=False)
class InsideGrids:
    """What lies inside silhouettes."""

    skin: ByteArray  #: (..., 60, 80) uint8, 0 to 4, what has the colours of the head.
    shading: ByteArray  #: (..., 60, 80) uint8, see `shading_grid`.

    def with_mirror_image(self) -> "InsideGrids":
        """Grids (2, 60, 80): these (60, 80) and their mirror image."""
        return InsideGrids(*(np.stack([one, one[:, ::-1]]) for one in (self.skin, self.shading)))


@dataclass(frozen=True, eq=False)
class FrameFeatures:
    """Silhouettes of one person in T frames, as seen by a camera turned toward each."""

    codes: SilhouetteCodes
    pitch_rad: RealArray  #: (T,) float32, angle of the optical axis below the horizontal.
    heading_rad: RealArray
    """(T,) float32, direction of the optical axis from above, atan2(y, x); not the person's."""
    anchor: RealArray
    """(T, 3) float32, the point of the optical axis at the assumed distance, in the world in
    statures, the floor at height 0."""
    time_s: RealArray  #: (T,) float64, increasing.

    def __post_init__(self) -> None:
        """Checks the arrays. Raises ValueError where an array has another shape than stated, or
        holds NaN.
        """
        count = len(self.codes)
        check_array("outline", self.codes.outline, ("T", "K"), finite=True)
        check_array("anchor", self.anchor, (count, 3), finite=True)
        for name in ("pitch_rad", "heading_rad", "time_s"):
            check_array(name, getattr(self, name), (count,), finite=True)
        if (np.diff(self.time_s) <= 0).any():
            raise ValueError("time_s must increase")

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.codes)


@dataclass(frozen=True, eq=False)
class SilhouetteBasis:
    """Mean and principal components of P cells, see `fit_basis`."""

    mean: Float32Array  #: (P,) float32, of grids divided by 4.
    components: Float32Array  #: (P, K) float32.

    def encode(self, grids: ByteArray) -> Float32Array:
        """Codes (N, K) float32, (grid / 4 - mean) @ components, of grids (N, h, w)."""
        rows = grids.reshape(len(grids), -1).astype(np.float32) / FULL
        return product(rows - self.mean, self.components)


def coverage_grid(masks: BoolArray) -> ByteArray:
    """Coverage (…, 60, 80) uint8, 0 to 4, of silhouettes (…, 240, 320) bool in the library's
    window: of 2 x 2 pixels two must be set, of these 2 x 2 are counted.
    """
    check_array("masks", masks.reshape(-1, *masks.shape[-2:]), ("N", *SIZE[::-1]), np.bool_)
    return counted(reduce_silhouette(masks).view(np.uint8))


def counted(masks: NDArray) -> NDArray:
    """Coverage (…, h / 2, w / 2), 0 to 4, of masks (…, h, w), 0 or 1: the sums of 2 x 2 pixels."""
    a, b, c, d = (masks[..., y::2, x::2] for y in range(2) for x in range(2))
    return a + b + c + d


def shading_grid(sums: RealArray) -> ByteArray:
    """Shading (..., 60, 80) uint8 of the sums (..., 60, 80) over the 2 x 2 pixels of every cell of
    the logarithm of their relative brightness, 0 outside the silhouette: 48 levels are a factor of
    e, from 0 to 64.
    """
    return np.clip(np.rint(NEUTRAL + _SHADES / FULL * sums), 0, 2 * NEUTRAL).astype(np.uint8)


def outline_images(coverage: ByteArray) -> Float32Array:
    """What the first encoder reads (N, 60, 80, 1) of grids of coverage (N, 60, 80)."""
    return coverage[..., None].astype(np.float32) / np.float32(FULL)


def inside_images(skin: ByteArray, shading: ByteArray) -> Float32Array:
    """What the second encoder reads (N, 60, 80, 2) of grids (N, 60, 80) as in `InsideGrids`."""
    images = np.empty((*skin.shape, 2), np.float32)
    np.divide(skin, FULL, out=images[..., 0])
    np.subtract(shading, NEUTRAL, out=images[..., 1], dtype=np.float32)
    images[..., 1] *= _CONTRAST
    return images


def feet_grid(masks: BoolArray) -> ByteArray:
    """Lowest parts (N, 28, 48) uint8, 0 or 4, of silhouettes (N, h, w) bool at half the window's
    resolution: the rows that end with the lowest pixel, about their middle column.
    """
    rows, columns = FEET_GRID
    grids = np.zeros((len(masks), rows, columns), np.uint8)
    for mask, grid in zip(masks, grids, strict=True):
        occupied = np.flatnonzero(mask.any(axis=1))
        if not len(occupied):
            continue
        part = mask[max(occupied[-1] + 1 - rows, 0) : occupied[-1] + 1]
        count = part.sum(axis=0)
        middle = int(np.round(count @ np.arange(len(count)) / count.sum()))
        left = middle - columns // 2
        part = part[:, max(left, 0) : left + columns]
        start = max(-left, 0)
        grid[rows - len(part) :, start : start + part.shape[1]] = part * np.uint8(FULL)
    return grids


def seen_codes(joints: RealArray, visibility: RealArray) -> Float32Array:
    """Codes (..., 45) float32 of joints that are seen.

    Args:
        joints: (..., 15, 2) from the window's middle, right and down, statures at its distance.
        visibility: (..., 15), 0 to 1.
    """
    flat = 3 * joints.reshape(*joints.shape[:-2], -1)
    return np.concatenate([flat, visibility], axis=-1, dtype=np.float32)


def mirrored_seen_codes(codes: RealArray) -> RealArray:
    """Codes (..., 45) of the same joints in a mirror."""
    count = len(LANDMARK_NAMES)
    joints, visibility = codes[..., : 2 * count], codes[..., 2 * count :]
    exchanged = np.array(EXCHANGED_LANDMARKS)
    pairs = joints.reshape(*joints.shape[:-1], count, 2)[..., exchanged, :] * np.array(
        [-1, 1], codes.dtype
    )
    return np.concatenate([pairs.reshape(joints.shape), visibility[..., exchanged]], axis=-1)


def level_axes(heading_rad: RealArray) -> FloatArray:
    """Right, away and up (T, 3, 3), as rows, of level cameras along headings (T,), atan2(y, x)."""
    heading = np.asarray(heading_rad, float)
    cosine, sine, none = np.cos(heading), np.sin(heading), np.zeros(len(heading))
    return np.stack(
        [
            np.stack([sine, -cosine, none], axis=-1),
            np.stack([cosine, sine, none], axis=-1),
            np.stack([none, none, none + 1], axis=-1),
        ],
        axis=1,
    )


def nearby_frames(time_s: RealArray) -> IntArray:
    """Frames (T, 8) nearest to the instants `OFFSETS_S` about every frame; of two equally near the
    earlier. Instants before a frame give no later one, and the other way round.
    """
    time = np.asarray(time_s, float)
    wanted = time[:, None] + OFFSETS_S
    after = np.clip(np.searchsorted(time, wanted), 1, max(len(time) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(time) - 1)
    later = time[after] - wanted < wanted - time[before]
    return np.where(later, after, before)


def network_inputs(
    features: FrameFeatures,
    frames: IndexArray,
    nearby: IntArray,
    causal: BoolArray,
    coloured: BoolArray | None = None,
    jointed: BoolArray | None = None,
) -> Float32Array:
    """Inputs (n, I) of the network.

    Args:
        frames: (n,), frames whose poses are asked for.
        nearby: (n, 8), frames at `OFFSETS_S` about each.
        causal: (n,), whether only the earlier of those are read.
        coloured: (n,), whether the colours are read, where they are known; None: they are.
        jointed: (n,), whether the joints that are seen are read; None: they are.
    """
    codes = features.codes
    coloured, jointed = (
        np.ones(len(frames), bool) if read is None else read for read in (coloured, jointed)
    )
    known = (coloured & codes.coloured[frames])[:, None]
    later = causal[:, None] & (OFFSETS_S > 0)  # which are replaced by the frame itself
    nearby = np.where(later, np.asarray(frames)[:, None], nearby)
    axes = level_axes(features.heading_rad[frames])
    moved = features.anchor[nearby] - features.anchor[frames][:, None]
    return np.concatenate(
        [
            codes.outline[frames],
            codes.outline[nearby, :_OUTLINE_BESIDE].reshape(len(frames), -1),
            codes.feet[frames],
            codes.inside[frames] * known,
            codes.inside[nearby, :_INSIDE_BESIDE].reshape(len(frames), -1) * known,
            known,
            3 * np.matmul(moved, axes.transpose(0, 2, 1)).reshape(len(frames), -1),
            2 * features.pitch_rad[frames][:, None],
            features.anchor[frames, 2:],
            causal[:, None],
            codes.joints[frames] * jointed[:, None],
            codes.joints[nearby].reshape(len(frames), -1) * jointed[:, None],
        ],
        axis=1,
        dtype=np.float32,
        casting="unsafe",
    )


def input_count(outline: int, feet: int, inside: int) -> int:
    """Number I of the inputs of `network_inputs` from the numbers of codes."""
    beside = min(outline, _OUTLINE_BESIDE) + min(inside, _INSIDE_BESIDE) + 3 + SEEN_CODES
    return outline + feet + inside + len(OFFSETS_S) * beside + 4 + SEEN_CODES


def fit_basis(grids: ByteArray, components: int) -> SilhouetteBasis:
    """Mean and principal components of grids; the same on every machine if BLAS runs in one thread.

    Args:
        grids: (N, h, w) uint8, 0 to 4.
        components: largest number of components.

    Returns:
        The basis. Its components are scaled by the square root of their deviation, so that the
        first ones count most, but less than in the picture.
    """
    rows = grids.reshape(len(grids), -1).astype(np.float32) / FULL
    mean = rows.mean(axis=0)
    basis = scaled_components(rows.astype(float) - mean)
    count = min(components, max(1, len(rows) - 1))
    return SilhouetteBasis(mean, basis[:, :count].astype(np.float32))


def scaled_components(rows: FloatArray) -> FloatArray:
    """Principal components (K, K) of rows (N, K) whose mean is 0, the largest first, divided by the
    square root of their deviation relative to that of the first.
    """
    variance, turn = np.linalg.eigh(rows.T @ rows / len(rows))
    deviation = np.sqrt(np.maximum(variance[::-1], 1e-12))
    return turn[:, ::-1] / np.sqrt(deviation * deviation[0])


def product(left: NDArray, right: NDArray) -> NDArray:
    """Matrix product (n, m) of (n, k) and (k, m) float32, the same for any number of threads.

    BLAS divides long inner dimensions otherwise with other threads, so they are divided here.
    """
    total = left[:, :_BLOCK] @ right[:_BLOCK]
    for start in range(_BLOCK, left.shape[1], _BLOCK):
        total += left[:, start : start + _BLOCK] @ right[start : start + _BLOCK]
    return total
