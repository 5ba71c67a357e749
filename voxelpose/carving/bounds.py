"""Where to carve: the smallest box that the silhouettes allow."""

from itertools import combinations
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from calib.camera import Camera, Rig
from calib.errors import InputError
from voxelpose.carving.carver import CarveRule, carve
from voxelpose.carving.grid import VoxelGrid
from voxelpose.carving.views import Masks, mask_list

_SEARCH_VOXELS = 64  # along the longest edge of the box while it shrinks
_SEARCH_STEPS = 6
_STILL_SHRINKS = 0.9  # of the volume
_MARGIN_VOXELS = 1
_FAR_M = 1e4
_LARGEST = 1 << 30  # voxels
_OFF_AXIS = 1.5  # how much larger than on the axis something may appear toward the image's corners

_Sides = tuple[
    NDArray[np.float64], NDArray[np.bool_]
]  # a pyramid's planes, and which of them are image borders
_Box = tuple[NDArray[np.float64], NDArray[np.float64]]  # low and high corner


def place_grid(
    rig: Rig,
    masks: Masks,
    voxel_size_m: float | None = None,
    resolution: int = 128,
    rule: CarveRule | None = None,
) -> VoxelGrid:
    """Finds the box that holds the visual hull.

    Every silhouette lies in a pyramid in front of its camera; the pyramids' common volume is a
    convex body whose box six linear programs give. It is then carved coarsely, with silhouettes
    widened by a voxel so that nothing thin is lost, and shrunk to what is left. A side of a
    silhouette that lies on the border of its image does not bound anything, unless nothing else
    does.

    Args:
        rig: C cameras.
        masks: Silhouettes, (h, w) bool each: by camera name, or in the order of the rig.
        voxel_size_m: Edge of a voxel, m; None divides the box's longest edge by `resolution`.
        resolution: Voxels along the longest edge where no size is given.
        rule: When a voxel stays; its tolerance holds here as well.

    Returns:
        The grid, which has a margin of one voxel.

    Raises:
        InputError: No foreground, no common volume, or nothing left; it names the cameras.
        ValueError: An impossible argument.
    """
    if resolution < 1:
        raise ValueError(f"resolution must be at least 1 voxel, got {resolution}")
    if voxel_size_m is not None and not voxel_size_m > 0:
        raise ValueError(f"voxel_size_m must be positive, got {voxel_size_m}")
    rule = rule or CarveRule()
    pictures = mask_list(rig, masks)
    require_foreground(rig, pictures, rule.tolerance)
    low, high = _pyramid_box(rig, pictures, rule)
    if len(_blind(rig, low, high)) > rule.tolerance:
        raise _nothing_common(rig)
    low, high = _shrink(rig, pictures, rule, low, high)
    size = voxel_size_m or float((high - low).max()) / resolution
    return grid_within(low - _MARGIN_VOXELS * size, high + _MARGIN_VOXELS * size, size)


def grid_within(
    low_m: NDArray[np.float64], high_m: NDArray[np.float64], voxel_size_m: float
) -> VoxelGrid:
    """Makes the grid of a box (3,), (3,), world, m; raises InputError where it would not fit into
    memory.
    """
    edges = np.asarray(high_m, dtype=np.float64) - low_m
    if not (edges > 0).all():
        raise InputError(
            f"the volume from {_metres(low_m)} to {_metres(high_m)} is empty: give low corner, then"
            " high corner"
        )
    if np.ceil(edges / voxel_size_m + 1).prod() > _LARGEST:
        fitting = float(np.cbrt(edges.prod() / _LARGEST))
        raise InputError(
            f"voxels of {voxel_size_m:g} m in a volume of {_metres(edges)} are too many for memory:"
            f" choose at least {1.1 * fitting:.2g} m, or a smaller volume"
        )
    return VoxelGrid.from_bounds(low_m, high_m, voxel_size_m)


def require_foreground(rig: Rig, masks: list[NDArray[Any]], tolerance: int = 0) -> None:
    """Raises InputError, with their names, if more than `tolerance` cameras have no foreground."""
    empty = [camera.name for camera, mask in zip(rig, masks, strict=True) if not mask.any()]
    if len(empty) == len(rig):
        raise InputError(
            f"no foreground in any camera ({', '.join(empty)}): is somebody in the picture, and is"
            " the background another?"
        )
    if len(empty) > tolerance:
        raise InputError(
            f"no foreground in {', '.join(empty)}: check that video and its background, leave the"
            f" camera out, or tolerate {len(empty)} such camera{'s' if len(empty) > 1 else ''}"
            f" (--tolerance {len(empty)})"
        )


def _pyramid(camera: Camera, pixels: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Returns the planes (4, 4) as [n, d], inside where n x + d <= 0, left right upper lower,
    around the rays of pixels (N, 2).

    None where no ray meets any of them.
    """
    _, directions = camera.rays(pixels)
    forward = (directions @ camera.rotation.T)[np.isfinite(directions).all(axis=1)]
    if not len(forward):
        return None
    ideal = forward[:, :2] / forward[:, 2:]
    (left, upper), (right, lower) = ideal.min(axis=0), ideal.max(axis=0)
    x, y, z = np.column_stack([camera.rotation, camera.translation])
    return np.stack([left * z - x, x - right * z, upper * z - y, y - lower * z])


def _outline(mask: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Returns the corners (N, 2) of the outermost foreground pixels of every row and column, px."""
    outer = []
    for picture, order in ((mask, (1, 0)), (mask.T, (0, 1))):
        lines = np.flatnonzero(picture.any(axis=1))
        part = picture[lines]
        first, last = part.argmax(axis=1), part.shape[1] - 1 - part[:, ::-1].argmax(axis=1)
        outer += [np.column_stack([lines, column])[:, list(order)] for column in (first, last)]
    pixels = np.concatenate(outer).astype(np.float64)
    return np.concatenate([pixels + np.array([dx, dy]) for dx in (-0.5, 0.5) for dy in (-0.5, 0.5)])


def _touches(mask: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Says at which image borders (left, right, upper, lower) the silhouette is cut off."""
    return np.array([mask[:, 0].any(), mask[:, -1].any(), mask[0].any(), mask[-1].any()])


def _frame(camera: Camera) -> NDArray[np.float64]:
    """Returns the whole image's pyramid (4, 4)."""
    planes = _pyramid(camera, _outline(np.ones((camera.size[1], camera.size[0]), dtype=np.uint8)))
    if planes is None:
        raise InputError(f"the lens of {camera.name} sees nothing: check its calibration")
    return planes


def _box(planes: NDArray[np.float64]) -> _Box | None:
    """Returns the box around the points inside all planes (N, 4): corners with infinities where
    unbounded, None where empty.
    """
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
            # Bounded by hand: left free, the solver may call an unbounded program infeasible.
            corners[side, axis] = (
                solution.x[axis] if abs(solution.x[axis]) < 0.99 * _FAR_M else -sign * np.inf
            )
    return corners[0], corners[1]


def _pyramid_box(rig: Rig, masks: list[NDArray[np.uint8]], rule: CarveRule) -> _Box:
    """Returns the box of the pyramids' common volume, or of all volumes common to all but
    `rule.tolerance` of them.
    """
    sides: list[_Sides] = []
    for camera, mask in zip(rig, masks, strict=True):
        planes = _pyramid(camera, _outline(mask)) if mask.any() else None
        if planes is not None:
            sides.append(
                (planes, _touches(mask) if rule.outside == "keep" else np.zeros(4, dtype=bool))
            )
    # Cameras without foreground have used up their share of the tolerance.
    used = max(1, min(len(sides), len(rig) - rule.tolerance))
    boxes = [box for some in combinations(sides, used) if (box := _bounded_box(some)) is not None]
    if not boxes:
        raise _nothing_common(rig)
    low, high = (
        np.min([low for low, _ in boxes], axis=0),
        np.max([high for _, high in boxes], axis=0),
    )
    if not np.isfinite([low, high]).all():
        raise InputError(
            f"the silhouettes of {', '.join(rig.names)} do not bound a volume (all look the same"
            " way): give it (--volume)"
        )
    return low, high


def _bounded_box(sides: tuple[_Sides, ...]) -> _Box | None:
    """Returns the box inside all planes that are not cut off by an image border, or inside all if
    those leave it open.
    """
    box = _box(np.concatenate([planes[~cut] for planes, cut in sides]))
    if box is not None and not np.isfinite(box).all():
        box = _box(np.concatenate([planes for planes, _ in sides]))
    return box


def _blind(rig: Rig, low: NDArray[np.float64], high: NDArray[np.float64]) -> list[str]:
    """Names the cameras that see nothing of a box."""
    box = np.block([[np.eye(3), -high[:, None]], [-np.eye(3), low[:, None]]])
    return [camera.name for camera in rig if _box(np.concatenate([box, _frame(camera)])) is None]


def _nothing_common(rig: Rig) -> InputError:
    """Says why there is no common volume."""
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
    masks: list[NDArray[np.uint8]],
    rule: CarveRule,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> _Box:
    """Carves coarsely and cuts the box down, until that gains little."""
    for _ in range(_SEARCH_STEPS):
        # A silhouette that reaches all borders leaves a box so large that its coarse voxels are
        # larger than a person: then finer ones.
        for voxels in (_SEARCH_VOXELS, 2 * _SEARCH_VOXELS, 4 * _SEARCH_VOXELS, 8 * _SEARCH_VOXELS):
            grid = VoxelGrid.from_bounds(low, high, float((high - low).max()) / voxels)
            occupancy = carve(
                rig,
                [_widened(camera, mask, grid) for camera, mask in zip(rig, masks, strict=True)],
                grid,
                rule,
            )
            if occupancy.any():
                break
        else:
            raise _nothing_common(rig)
        held, _ = grid.cropped(occupancy)
        new_low, new_high = (
            np.maximum(low, held.origin_m),
            np.minimum(high, held.origin_m + held.size_m),
        )
        gain = (new_high - new_low).prod() / (high - low).prod()
        low, high = new_low, new_high
        if gain > _STILL_SHRINKS:
            break
    return low, high


def _widened(camera: Camera, mask: NDArray[np.uint8], grid: VoxelGrid) -> NDArray[np.bool_]:
    """Widens a silhouette by half a voxel's diagonal, as the voxel nearest to the camera shows it."""
    corners = grid.origin_m + grid.size_m * np.array(list(np.ndindex(2, 2, 2)))
    depth_m = (corners @ camera.rotation[2] + camera.translation[2]).min()
    half_m = 0.5 * np.sqrt(3) * grid.voxel_size_m
    most = max(camera.size) // 8
    radius = (
        most
        if depth_m <= half_m
        else min(most, int(np.ceil(_OFF_AXIS * half_m * camera.matrix[0, 0] / (depth_m - half_m))))
    )
    return cv2.dilate(mask, np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)).astype(bool)


def _metres(point_m: NDArray[np.float64]) -> str:
    """Writes three lengths."""
    return " x ".join(f"{value:.2f}" for value in point_m) + " m"
