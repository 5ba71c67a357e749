"""Bounding box of a visual hull, before it is carved."""

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from calib.camera import Camera, Rig
from calib.checks import BoolArray, ByteArray, FloatArray
from calib.errors import InputError
from voxelpose.multiview.carving.carver import CarveRule, Masks, carve, mask_list
from voxelpose.multiview.carving.grid import LARGEST, VoxelGrid
from voxelpose.multiview.tuning import CARVING

_SEARCH_VOXELS = 64  # along the longest edge of the box while it shrinks
_SEARCH_STEPS = 6
LEAST_CAMERAS = 2
"""Number of cameras that bound a hull."""

_MARGIN_VOXELS = 1
_LONG = 2  # times the usual length: such a moment's silhouettes show more than the body
_FAR_M = 10_000

# A pyramid's planes, and which of them are image borders.
_Sides = tuple[FloatArray, BoolArray]
_Box = tuple[FloatArray, FloatArray]  # low and high corner


def place_grid(
    rig: Rig,
    masks: Masks,
    voxel_size_m: float | None = None,
    resolution: int = 128,
    rule: CarveRule | None = None,
    unknown: Sequence[BoolArray] | None = None,
    moments: Iterable[Masks] = (),
) -> VoxelGrid:
    """Smallest grid that holds the visual hull.

    Every silhouette lies in a pyramid in front of its camera; the pyramids' intersection is a
    convex body whose bounding box six linear programs yield. That box is carved coarsely, with
    silhouettes dilated by a voxel so that thin structures remain, and shrunk to the occupied
    voxels. A side of a silhouette on the border of its image is not a bound, unless there is no
    other. Raises InputError, which names the cameras, where there is no foreground, no common
    volume, or no occupied voxel; ValueError where an argument is out of range.

    Args:
        rig: C cameras.
        masks: Silhouettes, (h, w) bool each: by camera name, or in the order of the rig.
        voxel_size_m: Edge of a voxel, m; None divides the box's longest edge by `resolution`.
        resolution: Voxels along the longest edge where no size is given.
        rule: Condition under which a voxel is occupied; its tolerance holds here as well.
        unknown: As of `carve`; what they hide bounds nothing.
        moments: Where `masks` are unions over time, those of single moments: somebody who walks
            about before cameras side by side is bounded at each moment, but not by the unions, or
            too far away for the voxels' size.

    Returns:
        The grid, with a margin of one voxel.
    """
    rule = rule or CarveRule()
    check_tolerance(rule.tolerance, len(rig))
    if resolution < 1:
        raise ValueError(f"resolution must be at least 1 voxel, got {resolution}")
    if voxel_size_m is not None and not voxel_size_m > 0:
        raise ValueError(f"voxel_size_m must be positive, got {voxel_size_m}")
    images = mask_list(rig, masks)
    require_foreground(rig, images, rule.tolerance)
    single = (mask_list(rig, one) for one in moments)
    low, high = _pyramid_box(rig, images, rule, unknown, single, voxel_size_m)
    if len(_blind(rig, low, high)) > rule.tolerance:
        raise _nothing_common(rig)
    low, high = _shrink(rig, images, rule, (low, high), unknown)
    size = voxel_size_m or float((high - low).max()) / resolution
    return grid_within(low - _MARGIN_VOXELS * size, high + _MARGIN_VOXELS * size, size)


def grid_within(low_m: FloatArray, high_m: FloatArray, voxel_size_m: float) -> VoxelGrid:
    """Grid of a box. Raises InputError where the box is empty, or the grid would not fit into
    memory.

    Args:
        low_m: (3,) float64, low corner, world.
        high_m: (3,) float64, high corner, world.
    """
    edges = np.asarray(high_m, dtype=np.float64) - low_m
    if not (edges > 0).all():
        raise InputError(
            f"the volume from {_metres(low_m)} to {_metres(high_m)} is empty: give low corner, then"
            " high corner"
        )
    if not _fits(edges, voxel_size_m):
        fitting = float(np.cbrt(edges.prod() / LARGEST))
        raise InputError(
            f"voxels of {voxel_size_m:g} m in a volume of {_metres(edges)} are too many for memory:"
            f" choose at least {1.1 * fitting:.2g} m, or a smaller volume"
        )
    return VoxelGrid.from_bounds(low_m, high_m, voxel_size_m)


def _fits(edges_m: FloatArray, voxel_size_m: float) -> bool:
    """Whether the voxels of a box fit into memory."""
    return bool(np.ceil(edges_m / voxel_size_m + 1).prod() <= LARGEST)


def require_foreground(rig: Rig, masks: list[NDArray[Any]], tolerance: int = 0) -> None:
    """Raises InputError, with their names, if more than `tolerance` cameras have no foreground."""
    empty = [camera.name for camera, mask in zip(rig, masks, strict=True) if not mask.any()]
    if len(empty) == len(rig):
        raise InputError(
            f"no foreground in any camera ({', '.join(empty)}): is somebody in the picture? Look"
            " at the silhouettes with `voxelpose setup`"
        )
    if len(empty) > tolerance:
        remedy = "check that camera's silhouettes, or leave it out"
        if len(rig) - len(empty) >= LEAST_CAMERAS:
            remedy += f" (--cameras), or tolerate it (--tolerance {len(empty)})"
        raise InputError(f"no foreground in {', '.join(empty)}: {remedy}")


def check_tolerance(tolerance: int, cameras: int) -> None:
    """Raises InputError if so many cameras may be wrong that the others bound no hull."""
    most = max(cameras - LEAST_CAMERAS, 0)
    if not 0 <= tolerance <= most:
        raise InputError(
            f"--tolerance {tolerance} is impossible with {cameras}"
            f" camera{'s' if cameras > 1 else ''}: give {f'0 to {most}' if most else '0'}"
        )


def _pyramid(camera: Camera, pixels: FloatArray) -> FloatArray | None:
    """Planes (4, 4) of the pyramid around the rays of pixels (N, 2): left, right, upper, lower, as
    [n, d] with n x + d <= 0 inside; None if no pixel has a ray.
    """
    _, directions = camera.rays(pixels)
    forward = (directions @ camera.rotation.T)[np.isfinite(directions).all(axis=1)]
    if not len(forward):
        return None
    ideal = forward[:, :2] / forward[:, 2:]
    (left, upper), (right, lower) = ideal.min(axis=0), ideal.max(axis=0)
    x, y, z = np.column_stack([camera.rotation, camera.translation])
    return np.stack([left * z - x, x - right * z, upper * z - y, y - lower * z])


def _outline(mask: ByteArray) -> FloatArray:
    """Corners (N, 2), px, of the outermost foreground pixels of every row and column."""
    outer = []
    for image, order in ((mask, (1, 0)), (mask.T, (0, 1))):
        lines = np.flatnonzero(image.any(axis=1))
        part = image[lines]
        first, last = part.argmax(axis=1), part.shape[1] - 1 - part[:, ::-1].argmax(axis=1)
        outer += [np.column_stack([lines, column])[:, list(order)] for column in (first, last)]
    pixels = np.concatenate(outer).astype(np.float64)
    return np.concatenate([pixels + np.array([dx, dy]) for dx in (-0.5, 0.5) for dy in (-0.5, 0.5)])


def _touches(mask: ByteArray) -> BoolArray:
    """Whether each image border (left, right, upper, lower) cuts the silhouette, (4,) bool."""
    return np.array([mask[:, 0].any(), mask[:, -1].any(), mask[0].any(), mask[-1].any()])


def _frame(camera: Camera) -> FloatArray:
    """Planes (4, 4) of the pyramid of the whole image."""
    planes = _pyramid(camera, _outline(np.ones((camera.size[1], camera.size[0]), dtype=np.uint8)))
    if planes is None:
        raise InputError(f"the lens of {camera.name} sees nothing: check its calibration")
    return planes


def _box(planes: FloatArray) -> _Box | None:
    """Bounding box of points inside all planes (N, 4), infinite if unbounded; None if empty."""
    corners = np.empty((2, 3))
    for axis in range(3):
        for side, sign in enumerate((1.0, -1.0)):
            solution = linprog(
                sign * np.eye(3)[axis],
                A_ub=planes[:, :3],
                b_ub=-planes[:, 3],
                bounds=(-_FAR_M, _FAR_M),
                method="highs",
            )
            if solution.x is None:
                return None
            # Explicit bounds: without them the solver may call an unbounded program infeasible.
            unbounded = abs(solution.x[axis]) >= 0.99 * _FAR_M
            corners[side, axis] = -sign * np.inf if unbounded else solution.x[axis]
    return corners[0], corners[1]


def _pyramid_box(
    rig: Rig,
    masks: list[ByteArray],
    rule: CarveRule,
    unknown: Sequence[BoolArray] | None,
    moments: Iterable[list[ByteArray]],
    voxel_size_m: float | None,
) -> _Box:
    """Bounding box of the pyramids' intersection, or of all intersections without `rule.tolerance`
    of them; of those of the moments that bound one, if that is infinite or its voxels too many.
    """
    corners_m = _intersection(rig, masks, rule, unknown)
    if corners_m is None:
        raise _nothing_common(rig)
    finite = bool(np.isfinite(corners_m).all())
    if not finite or (
        voxel_size_m is not None and not _fits(corners_m[1] - corners_m[0], voxel_size_m)
    ):
        seen = (one for one in moments if all(mask.any() for mask in one))
        boxes = [_intersection(rig, one, rule, unknown) for one in seen]
        bounded = [box for box in boxes if box is not None and np.isfinite(box).all()]
        lengths = [float(np.linalg.norm(high - low)) for low, high in bounded]
        usual = np.median(lengths or [0.0])
        bounded = [box for box, long in zip(bounded, lengths, strict=True) if long <= _LONG * usual]
        if not bounded and finite:
            return corners_m
        if not bounded:
            raise InputError(
                f"the silhouettes of {', '.join(rig.names)} do not bound a volume (all look the"
                " same way): add a camera that looks from another side"
            )
        corners_m = np.min(bounded, axis=0)[0], np.max(bounded, axis=0)[1]
    return corners_m


def _intersection(
    rig: Rig, masks: list[ByteArray], rule: CarveRule, unknown: Sequence[BoolArray] | None
) -> _Box | None:
    """Bounding box as of `_pyramid_box`, of one set of masks; infinite where unbounded."""
    sides: list[_Sides] = []
    for c, (camera, mask) in enumerate(zip(rig, masks, strict=True)):
        seen = mask if unknown is None else mask | unknown[c]
        planes = _pyramid(camera, _outline(seen)) if seen.any() else None
        if planes is not None:
            sides.append((planes, _touches(seen)))
    # Cameras without foreground count toward the tolerance.
    used = max(1, min(len(sides), len(rig) - rule.tolerance))
    boxes = [box for box in map(_bounded_box, combinations(sides, used)) if box is not None]
    return (np.min(boxes, axis=0)[0], np.max(boxes, axis=0)[1]) if boxes else None


def _bounded_box(sides: tuple[_Sides, ...]) -> _Box | None:
    """Bounding box inside all planes but image borders; those count where it is unbounded."""
    box = _box(np.concatenate([planes[~cut] for planes, cut in sides]))
    if box is not None and not np.isfinite(box).all():
        box = _box(np.concatenate([planes for planes, _ in sides]))
    return box


def _blind(rig: Rig, low: FloatArray, high: FloatArray) -> list[str]:
    """Names of the cameras that do not see any of a box."""
    box = np.block([[np.eye(3), -high[:, None]], [-np.eye(3), low[:, None]]])
    return [camera.name for camera in rig if _box(np.concatenate([box, _frame(camera)])) is None]


def _nothing_common(rig: Rig) -> InputError:
    """Error that names the reason why there is no common volume."""
    frames = {camera.name: _frame(camera) for camera in rig}
    apart = [
        f"{a} and {b}"
        for a, b in combinations(rig.names, 2)
        if _box(np.concatenate([frames[a], frames[b]])) is None
    ]
    if apart:
        return InputError(
            f"cameras see no common volume ({'; '.join(apart)}): check their rotations and"
            " translations in the calibration"
        )
    if _box(np.concatenate(list(frames.values()))) is None:
        return InputError(
            f"cameras see no common volume ({', '.join(rig.names)}): check the calibration, or"
            " leave cameras out"
        )
    return InputError(
        f"the silhouettes of {', '.join(rig.names)} meet nowhere: check the calibration and that"
        " the frames were taken at one moment, or tolerate a bad camera (--tolerance 1)"
    )


def _shrink(
    rig: Rig,
    masks: list[ByteArray],
    rule: CarveRule,
    box: _Box,
    unknown: Sequence[BoolArray] | None,
) -> _Box:
    """Box after repeated coarse carving, until that no longer shrinks it much."""
    low, high = box
    for _ in range(_SEARCH_STEPS):
        # A silhouette that reaches all borders leaves a box so large that coarse voxels are larger
        # than a person.
        for voxels in (_SEARCH_VOXELS, 2 * _SEARCH_VOXELS, 4 * _SEARCH_VOXELS, 8 * _SEARCH_VOXELS):
            grid = VoxelGrid.from_bounds(low, high, float((high - low).max()) / voxels)
            occupancy = carve(
                rig,
                [_dilated(camera, mask, grid) for camera, mask in zip(rig, masks, strict=True)],
                grid,
                rule,
                unknown,
            )
            if occupancy.any():
                break
        else:
            raise _nothing_common(rig)
        cropped, _ = grid.cropped(occupancy)
        volume = (high - low).prod()
        low = np.maximum(low, cropped.origin_m)
        high = np.minimum(high, cropped.origin_m + cropped.size_m)
        if (high - low).prod() > CARVING.shrinkage * volume:
            break
    return low, high


def _dilated(camera: Camera, mask: ByteArray, grid: VoxelGrid) -> BoolArray:
    """Silhouette dilated by half the diagonal of the nearest voxel's image."""
    corners = grid.origin_m + grid.size_m * np.array(list(np.ndindex(2, 2, 2)))
    depth_m = (corners @ camera.rotation[2] + camera.translation[2]).min()
    half_m = 0.5 * np.sqrt(3) * grid.voxel_size_m
    radius = max(camera.size) // 8
    if depth_m > half_m:
        image_px = CARVING.off_axis * half_m * camera.matrix[0, 0] / (depth_m - half_m)
        radius = min(radius, int(np.ceil(image_px)))
    return cv2.dilate(mask, np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)).astype(bool)


def _metres(point_m: FloatArray) -> str:
    """Three lengths as text."""
    return " x ".join(f"{value:.2f}" for value in point_m) + " m"
