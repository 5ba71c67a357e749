"""Surface mesh of a voxel body, and PLY files."""

from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from numpy.typing import NDArray

from calib.atomic import replacing
from calib.checks import check_array
from voxelpose.multiview.carving.grid import VoxelGrid

_RELAXATIONS = 5


def surface(
    grid: VoxelGrid, occupancy: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Closed triangle mesh around the occupied voxels.

    There is one vertex for every eight neighbouring voxels that are neither all occupied nor all
    empty. It is moved toward the mean of its neighbours, but not out of its cell, so that the mesh
    is smooth, separates the same voxel centres, and keeps thin structures.

    Args:
        occupancy: (nx, ny, nz) bool.

    Returns:
        Vertices (V, 3) float64, world, m, and triangles (F, 3) int64, counter-clockwise from
        outside.

    Raises:
        TypeError: The occupancy is not bool.
        ValueError: The occupancy does not fit the grid.

    Source: Gibson, "Constrained elastic surface nets" (1998).
    """
    check_array("occupancy", occupancy, grid.shape, np.bool_)
    padded = np.pad(occupancy, 1)
    shape = tuple(n + 1 for n in grid.shape)
    count = np.zeros(shape, dtype=np.uint8)
    for i, j, k in np.ndindex(2, 2, 2):
        count += padded[i : i + shape[0], j : j + shape[1], k : k + shape[2]]
    mixed = (count > 0) & (count < 8)
    number = np.full(shape, -1, dtype=np.int64)
    number[mixed] = np.arange(np.count_nonzero(mixed))
    cells = np.argwhere(mixed)
    quads = np.concatenate([_quads(padded, number, axis) for axis in range(3)])
    # A cell's centre is a corner of voxels.
    vertices = grid.lattice + cells + _relaxed_shifts(quads, cells)
    return vertices * grid.voxel_size_m, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def write_ply(
    path: Path | str,
    grid: VoxelGrid,
    occupancy: NDArray[np.bool_],
    style: Literal["surface", "voxels"] = "surface",
) -> None:
    """Writes the hull as a binary PLY file, in metres; no partial file is left behind.

    Args:
        occupancy: (nx, ny, nz) bool, not all False.
        style: "surface" is a triangle mesh, "voxels" the centres of the occupied voxels as points.

    Raises:
        InputError: The file cannot be written.
        ValueError: Nothing is occupied.
    """
    if not occupancy.any():
        raise ValueError("no voxel is occupied")
    if style == "surface":
        vertices, faces = surface(*grid.cropped(occupancy))
        shape = trimesh.Trimesh(vertices, faces, process=False)
    else:
        shape = trimesh.PointCloud(grid.occupied_points(occupancy))
    with replacing(Path(path)) as partial, partial.open("wb") as file:
        shape.export(file, file_type="ply")


def _quads(padded: NDArray[np.bool_], number: NDArray[np.int64], axis: int) -> NDArray[np.int64]:
    """Vertices (Q, 4) of the faces between neighbours along `axis` of which one is occupied."""
    inside = np.moveaxis(padded, axis, 0)
    outward, inward = inside[:-1] & ~inside[1:], ~inside[:-1] & inside[1:]
    across, second, third = (axis, (axis + 1) % 3, (axis + 2) % 3)
    quads = []
    for steps, order in ((outward, [0, 1, 2, 3]), (inward, [0, 3, 2, 1])):
        cell = np.empty((np.count_nonzero(steps), 3), dtype=np.int64)
        others = [a for a in range(3) if a != axis]
        cell[:, [across, *others]] = np.argwhere(steps)
        around = []
        for b, c in ((-1, -1), (0, -1), (0, 0), (-1, 0)):
            corner = cell.copy()
            corner[:, second] += b
            corner[:, third] += c
            around.append(number[tuple(corner.T)])
        quads.append(np.stack(around, axis=1)[:, order])
    return np.concatenate(quads)


def _relaxed_shifts(quads: NDArray[np.int64], cells: NDArray[np.int64]) -> NDArray[np.float64]:
    """Shifts (V, 3), in voxels, of the vertices from the centres of their cells (V, 3)."""
    count = len(cells)
    ends = np.concatenate([quads[:, [i, (i + 1) % 4]] for i in range(4)])
    degree = np.bincount(ends.ravel(), minlength=count)[:, None]
    shift = np.zeros((count, 3))
    for _ in range(_RELAXATIONS):
        position = cells + shift
        mean = np.empty_like(shift)
        for axis in range(3):
            total = np.bincount(ends[:, 0], weights=position[ends[:, 1], axis], minlength=count)
            mean[:, axis] = total + np.bincount(
                ends[:, 1], weights=position[ends[:, 0], axis], minlength=count
            )
        # A vertex stays inside its cell.
        shift = np.clip(mean / degree - cells, -0.49, 0.49)
    return shift
