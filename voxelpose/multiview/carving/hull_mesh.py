"""Surface mesh of a voxel body, and PLY files."""

from pathlib import Path

import numpy as np
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from calib.checks import BoolArray, FloatArray, IntArray, check_array
from calib.storage.atomic import replacing
from voxelpose.multiview.carving.grid import VoxelGrid

_RELAXATIONS = 5


def surface(grid: VoxelGrid, occupancy: BoolArray) -> tuple[FloatArray, IntArray]:
    """Closed triangle mesh around the occupied voxels, a manifold: two triangles at every edge.

    There is one vertex for every eight neighbouring voxels that are neither all occupied nor all
    empty, or several where parts of the surface meet that do not belong together: voxels that touch
    at an edge or a corner are apart, unless they are one piece all around it. A vertex is moved
    toward the mean of its neighbours, but not out of its cell, so that the mesh is smooth,
    separates the same voxel centres, and keeps thin structures. Raises TypeError where the
    occupancy is not bool; ValueError where the occupancy does not fit the grid.

    Args:
        occupancy: (nx, ny, nz) bool.

    Returns:
        Vertices (V, 3) float64, world, m, and triangles (F, 3) int64, counter-clockwise from
        outside.

    Source: Gibson, "Constrained elastic surface nets" (1998).
    """
    check_array("occupancy", occupancy, grid.shape, np.bool_)
    padded = np.pad(occupancy, 1)
    parts = [_faces(padded, axis) for axis in range(3)]
    corners, inside, outside = (np.concatenate(part) for part in zip(*parts, strict=True))
    quads = _joined(corners, inside, outside)
    _, first = np.unique(quads, return_index=True)
    # A cell's centre is a corner of voxels.
    cells = np.column_stack(np.unravel_index(corners.ravel()[first], padded.shape))
    vertices = grid.lattice + cells + _relaxed_shifts(quads, cells)
    return vertices * grid.voxel_size_m, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def write_ply(path: Path | str, grid: VoxelGrid, occupancy: BoolArray) -> None:
    """Writes the hull's surface as a binary PLY file, in metres; no partial file is left behind.
    Raises InputError where the file cannot be written; ValueError where nothing is occupied.

    Args:
        occupancy: (nx, ny, nz) bool, not all False.
    """
    if not occupancy.any():
        raise ValueError("no voxel is occupied")
    vertices, faces = surface(*grid.cropped(occupancy))
    shape = trimesh.Trimesh(vertices, faces, process=False)
    with replacing(Path(path)) as partial, partial.open("wb") as file:
        shape.export(file, file_type="ply")


def _faces(padded: BoolArray, axis: int) -> tuple[IntArray, IntArray, IntArray]:
    """Faces between neighbours along `axis` of which one is occupied.

    Returns:
        Numbers of their corners (Q, 4), each that of the voxel above it, and of the voxels inside
        and outside (Q,).
    """
    step, second, third = (
        int(np.prod(padded.shape[a + 1 :])) for a in (axis, (axis + 1) % 3, (axis + 2) % 3)
    )
    number = np.moveaxis(np.arange(padded.size).reshape(padded.shape), axis, 0)[:-1]
    within = np.moveaxis(padded, axis, 0)
    outward = number[within[:-1] & ~within[1:]]
    inward = number[~within[:-1] & within[1:]]
    around = np.array([-second - third, -third, 0, -second])
    corners = np.concatenate([outward[:, None] + around, inward[:, None] + around[[0, 3, 2, 1]]])
    return (
        corners,
        np.concatenate([outward, inward + step]),
        np.concatenate([outward + step, inward]),
    )


def _joined(corners: IntArray, inside: IntArray, outside: IntArray) -> IntArray:
    """Vertices (Q, 4) of faces, each face joined with one other at each of its edges.

    Of four faces at one edge, those of one occupied voxel are joined. Where such an edge would
    still be one, since its two voxels are one piece around both ends, those of one empty voxel are:
    the surface around an end is a curve on a sphere, which separates either the one or the other.
    """
    edge = _pairs(corners.ravel(), np.roll(corners, -1, axis=1).ravel())
    start = np.arange(corners.size).reshape(-1, 4)
    end = np.roll(start, -1, axis=1).ravel()
    start, tie = start.ravel(), np.repeat(inside, 4)
    vertex = start
    for _ in range(2):
        order = np.lexsort((tie, edge))
        one, other = order[::2], order[1::2]
        links = np.concatenate([start[one], end[one]]), np.concatenate([end[other], start[other]])
        graph = coo_array((np.ones(len(links[0]), bool), links), shape=(corners.size,) * 2)
        vertex = connected_components(graph, directed=False)[1].astype(np.int64)
        pairs, count = np.unique(_pairs(vertex[start], vertex[end]), return_counts=True)
        shared = np.isin(_pairs(vertex[start], vertex[end]), pairs[count > 2])
        tie = np.where(shared, np.repeat(outside, 4), tie)
    return vertex.reshape(-1, 4)


def _pairs(one: IntArray, other: IntArray) -> IntArray:
    """One number for each pair of numbers, in either order."""
    return np.minimum(one, other) * (1 + max(one.max(), other.max())) + np.maximum(one, other)


def _relaxed_shifts(quads: IntArray, cells: IntArray) -> FloatArray:
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
