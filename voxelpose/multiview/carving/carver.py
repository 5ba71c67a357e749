"""Visual hull of silhouettes, as voxels; cameras and masks packed for the kernels."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from threading import local
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, Rig
from calib.checks import BoolArray, ByteArray, FloatArray, IntArray, check_array
from calib.lens import FisheyeLens, RationalLens
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.kernels import blocks

Masks = Mapping[str, BoolArray] | Sequence[BoolArray]

_MOST_CAMERAS = 62  # a set of cameras is the bits of an int64
_BINS = 256
_ANGLES = 24
_WIDEST = 100  # tangent of 89.4 degrees

_reused = local()


def _taken(name: str, dtype: type, count: int) -> NDArray[Any]:
    """An array (count,) with arbitrary contents, kept for the thread's next call: allocating memory
    would take longer than filling it.
    """
    array = getattr(_reused, name, None)
    if array is None or len(array) < count:
        array = np.empty(count, dtype)
        setattr(_reused, name, array)
    return array[:count]


@lru_cache(maxsize=64)
def pack_rig(rig: Rig) -> tuple[FloatArray, IntArray, FloatArray]:
    """Rows, kinds and bounds of all cameras, as in `blocks.carve_blocks`; cached."""
    if len(rig) > _MOST_CAMERAS:
        raise ValueError(f"at most {_MOST_CAMERAS} cameras, got {len(rig)}")
    rows, kinds, bounds = zip(*map(_packed, rig), strict=True)
    return np.stack(rows), np.array(kinds, dtype=np.int64), np.stack(bounds)


def mask_list(rig: Rig, masks: Masks) -> list[ByteArray]:
    """Masks in the order of the rig, checked against their cameras. Raises ValueError where a mask
    is missing, or differs in size from its camera's image; TypeError where a mask is not bool.

    Returns:
        (h, w) uint8 each, 0 or 1.
    """
    if isinstance(masks, Mapping):
        missing = [name for name in rig.names if name not in masks]
        if missing:
            raise ValueError(f"no mask for {', '.join(missing)}")
        masks = [masks[name] for name in rig.names]
    if len(masks) != len(rig):
        raise ValueError(f"{len(rig)} cameras but {len(masks)} masks")
    for camera, mask in zip(rig, masks, strict=True):
        check_array(f"mask of {camera.name}", mask, camera.size[::-1], np.bool_)
    return [np.ascontiguousarray(mask).view(np.uint8) for mask in masks]


def pack_masks(
    masks: list[ByteArray], unknown: Sequence[BoolArray] | None = None
) -> tuple[IntArray, NDArray[np.uint16], ByteArray]:
    """Frames, sums and pixels of all masks, as in `blocks.carve_blocks`, cropped to the foreground
    and to what is unknown, (h, w) bool each.

    The last two are overwritten by the next call in the same thread.
    """
    counts = [1] * len(masks)
    if unknown is not None:
        counts = [2 if where.any() else 1 for where in unknown]
        masks = [
            np.where(where, np.uint8(blocks.BLIND), mask) if count > 1 else mask
            for mask, where, count in zip(masks, unknown, counts, strict=True)
        ]
    frames = np.zeros((len(masks), 9), dtype=np.int64)
    pixel_count, sum_count = 3, 0
    for frame, mask, count in zip(frames, masks, counts, strict=True):
        left, top, wide, high = cv2.boundingRect(mask)
        # One pixel more on every side, even beyond the image: the rim is empty, and no crop is.
        frame[:] = (
            mask.shape[1],
            mask.shape[0],
            left - 1,
            top - 1,
            wide + 2,
            high + 2,
            pixel_count,
            sum_count,
            count,
        )
        pixel_count += (wide + 2) * (high + 2)
        sum_count += (wide + 3) * (high + 3)
    pixels = _taken("pixels", np.uint8, pixel_count)
    sums = _taken("sums", np.uint16, sum_count)
    pixels[:3] = blocks.OBJECTS, blocks.AGREES, blocks.BLIND
    for (_, _, left, top, wide, high, pixel, total, count), mask in zip(
        frames.tolist(), masks, strict=True
    ):
        crop = pixels[pixel : pixel + wide * high].reshape(high, wide)
        crop[0], crop[-1], crop[:, 0], crop[:, -1] = 0, 0, 0, 0
        crop[1:-1, 1:-1] = mask[top + 1 : top + high - 1, left + 1 : left + wide - 1]
        counted = crop if count == 1 else np.where(crop == blocks.BLIND, np.uint8(1), 2 * crop)
        sums[total : total + (wide + 1) * (high + 1)].reshape(high + 1, wide + 1)[:] = cv2.integral(
            counted
        )  # wraps around
    return frames, sums, pixels


@lru_cache(maxsize=16)
def block_order(count: int) -> IntArray:
    """Order of `count` blocks, as in `blocks.carve_blocks`.

    Neighbouring blocks have similar cost; sorting by multiples of the golden section distributes
    them evenly over the threads.
    """
    return np.argsort(np.arange(count) * 0.6180339887498949 % 1.0)


@lru_cache(maxsize=512)
def _packed(camera: Camera) -> tuple[FloatArray, int, FloatArray]:
    """Row, kind and bound of a camera, which take milliseconds; see the columns in `blocks`."""
    row = np.zeros(blocks.COLUMNS)
    bound = np.zeros((2, _BINS))
    if camera.is_pinhole:
        row[:12] = camera.projection.ravel()
        return row, blocks.PINHOLE, bound
    row[:12] = np.column_stack([camera.rotation, camera.translation]).ravel()
    row[blocks.FX : blocks.CY + 1] = camera.matrix[np.triu_indices(3)][:5]
    lens = camera.lens
    distortion = np.zeros(14)
    distortion[: len(camera.distortion)] = camera.distortion
    if camera.fisheye:
        row[[blocks.K1, blocks.K2, blocks.K3, blocks.K4]] = distortion[:4]
    else:
        k1, k2, p1, p2, *rest = distortion[:12]
        row[[blocks.K1, blocks.K2, blocks.P1, blocks.P2]] = k1, k2, p1, p2
        row[blocks.K3 : blocks.K3 + 8] = rest
        if isinstance(lens, RationalLens) and lens._tilt is not None:
            row[blocks.TILT : blocks.TILT + 9] = lens._tilt.ravel()
    row[blocks.FIELD_SQUARED] = lens.field_radius**2
    row[blocks.SEEN_RADIUS] = _seen_radius(camera)
    row[blocks.REACH] = min(lens.field_radius * (1 - 1e-6), 2 * row[blocks.SEEN_RADIUS], _WIDEST)
    bound[:] = _lens_bound(lens, row[blocks.REACH])
    return row, blocks.FISHEYE if camera.fisheye else blocks.RATIONAL, bound


def _seen_radius(camera: Camera) -> float:
    """Radius of ideal coordinates, by the image's border, beyond which nothing is projected."""
    width, height = camera.size
    x, y = np.arange(-1.0, width + 1), np.arange(-1.0, height + 1)
    border = np.concatenate(
        [np.column_stack([x, np.full(len(x), row)]) for row in (-1.0, height)]
        + [np.column_stack([np.full(len(y), column), y]) for column in (-1.0, width)]
    )
    _, directions = camera.rays(border)
    forward = directions @ camera.rotation.T
    radius = np.linalg.norm(forward[:, :2], axis=1) / forward[:, 2]
    field = camera.lens.field_radius * (1 + 1e-9)
    return field if np.isnan(radius).any() else min(field, float(radius.max()) * 1.01)


def _lens_bound(lens: RationalLens | FisheyeLens, reach: float) -> FloatArray:
    """Bounds of a lens's Jacobian J over discs around the axis.

    Args:
        reach: Radius of the largest disc, ideal coordinates.

    Returns:
        (2, bins) float64: at least the largest |J| and |J - 1| (spectral norms) within radius
        (bin + 1) / bins * reach.
    """
    # Sampled at both ends and the middle of every bin, and widened for the points between.
    radii = np.linspace(0, reach, 2 * _BINS + 1)
    angles = np.linspace(0, 2 * np.pi, _ANGLES, endpoint=False)
    points = np.stack(
        [np.outer(radii, np.cos(angles)), np.outer(radii, np.sin(angles))], axis=-1
    ).reshape(-1, 2)
    step = 1e-6 * max(reach, 1e-3)
    columns = [
        (lens.distort(points + shift) - lens.distort(points - shift)) / (2 * step)
        for shift in step * np.eye(2)
    ]
    jacobian = np.stack(columns, axis=-1)
    norms = np.stack([_spectral_norm(jacobian), _spectral_norm(jacobian - np.eye(2))])
    norms = np.where(np.isnan(norms), np.inf, norms).reshape(2, len(radii), _ANGLES).max(axis=2)
    norms = np.maximum.accumulate(norms, axis=1)[:, 2::2]
    return norms * 1.05 + 1e-3


def _spectral_norm(matrices: FloatArray) -> FloatArray:
    """Largest singular values (N,) of matrices (N, 2, 2); NaN where an entry is NaN."""
    a, b, c, d = matrices.reshape(-1, 4).T
    return 0.5 * (np.hypot(a + d, b - c) + np.hypot(a - d, b + c))


@dataclass(frozen=True)
class CarveRule:
    """Condition under which a voxel is occupied; see `carve`.

    A camera sees a voxel whose centre is in front of it, inside the field of its lens, and whose
    nearest pixel is in its image. A camera that sees it agrees where that pixel is foreground, and
    objects where it is background; one that does not, does neither.
    """

    tolerance: int = 0  #: Most cameras that may object.
    least_agreeing: int | None = None
    """Fewest cameras that must agree, so that an object near one camera and invisible to the others
    is not mistaken for a body; 0 keeps even voxels that no camera sees. None means three quarters
    of the cameras, less the tolerance."""

    def __post_init__(self) -> None:
        """Checks every value once."""
        if self.tolerance < 0:
            raise ValueError(f"tolerance must be at least 0 cameras, got {self.tolerance}")
        if self.least_agreeing is not None and self.least_agreeing < 0:
            raise ValueError(
                f"least_agreeing must be at least 0 cameras, got {self.least_agreeing}"
            )

    def packed(self, cameras: int) -> tuple[int, int]:
        """Rule for a number of cameras, as `blocks.carve_blocks` takes it."""
        if self.least_agreeing is None:
            return self.tolerance, max(1, 3 * cameras // 4 - self.tolerance)
        return self.tolerance, self.least_agreeing


def carve(
    rig: Rig,
    masks: Masks,
    grid: VoxelGrid,
    rule: CarveRule | None = None,
    unknown: Sequence[BoolArray] | None = None,
) -> BoolArray:
    r"""Visual hull: the voxels whose projections are foreground.

    A voxel with centre v is occupied where

    .. math::

        \sum_{c=1}^{C} s_c(v)\, (1 - P_c(\pi_c(v))) \le k
        \quad \text{and} \quad \sum_{c=1}^{C} s_c(v)\, P_c(\pi_c(v)) \ge a

    with :math:`s_c(v)` = 1 if camera c sees v and 0 otherwise, :math:`P_c` its silhouette (1 in the
    foreground), :math:`\pi_c` the projection to the nearest pixel, lens distortion included, k the
    tolerance and a the least number of agreeing cameras of the rule. A point's nearest pixel is
    floor(x + 0.5), floor(y + 0.5): a tie goes to the right and downward. The result is, bit for
    bit, that of `tests.oracles.carving.carve_voxels`, for every number of threads.

    Whole blocks are decided first: a block's image lies in a box around the pixel of its centre
    (widened by a bound on the lens's stretching), and a summed-area table shows whether that box is
    all foreground or all background. Raises ValueError where a mask is missing, or differs in size
    from its camera's image; TypeError where a mask is not bool.

    Args:
        rig: C cameras.
        masks: Silhouettes, (h, w) bool each: by camera name, or in the order of the rig.
        rule: Condition for a voxel; by default every camera that sees it agrees, and three quarters
            of all cameras do.
        unknown: Pixels about which nothing is known, (h, w) bool each, in the order of the rig: a
            camera neither agrees nor objects to what projects there, whatever the rule; None:
            there are none.

    Returns:
        (nx, ny, nz) bool, True where the voxel is occupied.

    Source: shape from silhouette, which Iiyama, Kameda and Minoh assume as input, as in Laurentini,
    "The visual hull concept for silhouette-based image understanding" (1994); tolerance and blocks
    are ours.
    """
    rule = rule or CarveRule()
    frames, sums, pixels = pack_masks(mask_list(rig, masks), unknown)
    rows, kinds, bounds = pack_rig(rig)
    occupancy = np.zeros(grid.shape, dtype=np.bool_)
    axes = grid.axes(blocks.LARGEST)
    order = block_order(math.prod(len(axis) // blocks.LARGEST for axis in axes))
    blocks.carve_blocks(
        rows, kinds, bounds, frames, sums, pixels, rule.packed(len(rig)), axes, order, occupancy
    )
    return occupancy
