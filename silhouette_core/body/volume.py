"""Lattice points inside a closed mesh, and their parts."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from silhouette_core.jit import kernel


def sample_volume(
    vertices_m: np.ndarray, faces: np.ndarray, face_part: np.ndarray, spacing_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Lattice points inside a closed mesh, or inside any of the closed pieces of one.

    Args:
        vertices_m: (V, 3) float64.
        faces: (F, 3) int32, closed surface of one or several pieces, which may overlap.
        face_part: (F,) int32.

    Returns:
        points (N, 3) float64 inside the mesh, and the part (N,) int32 of each: that of its
        piece where this has only one, else of the nearest triangle centre.
    """
    low, high = vertices_m.min(0), vertices_m.max(0)
    shape = np.maximum(np.ceil((high - low) / spacing_m).astype(np.int64), 1)
    # Uneven offsets keep lattice lines off vertices and edges, where the count would be ambiguous.
    origin = low + spacing_m * np.array([0.5000317, 0.4999713, 0.5])
    inside = np.zeros(tuple(shape), np.bool_)
    owner = np.full(inside.shape, -1, np.int32)  # part of the first piece, where it has only one
    for piece in _pieces(faces, len(vertices_m)):
        winding = np.zeros(inside.shape, np.int8)
        _wind(vertices_m, faces[piece].astype(np.int64), origin, spacing_m, winding)
        within = winding > 0
        parts = np.unique(face_part[piece])
        owner[within & ~inside] = parts[0] if len(parts) == 1 else -1
        inside |= within
    points = origin + spacing_m * np.argwhere(inside)
    part = owner[inside]
    mixed = part < 0
    if mixed.any():
        centres = vertices_m[faces].mean(1)
        part[mixed] = face_part[KDTree(centres).query(points[mixed])[1]]
    return points, part.astype(np.int32)


def _pieces(faces: np.ndarray, count: int) -> list[np.ndarray]:
    """Indices of the faces of every connected piece, in the order of the first of each."""
    ends = faces.ravel(), np.roll(faces, 1, axis=1).ravel()
    links = coo_array((np.ones(faces.size, bool), ends), shape=(count, count))
    label = connected_components(links, directed=False)[1][faces[:, 0]]
    order = np.unique(label, return_index=True)[1]
    return [np.flatnonzero(label == label[first]) for first in np.sort(order)]


@kernel
def _wind(vertices, faces, origin, spacing, winding):
    """Adds winding numbers (nx, ny, nz): cells above a triangle are entered or left through it, so
    that cells where the surface overlaps itself are inside twice.
    """
    nx, ny, nz = winding.shape
    for f in range(faces.shape[0]):
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if area == 0.0:
            continue
        i0 = max(int(np.ceil((min(a[0], b[0], c[0]) - origin[0]) / spacing)), 0)
        i1 = min(int(np.floor((max(a[0], b[0], c[0]) - origin[0]) / spacing)), nx - 1)
        j0 = max(int(np.ceil((min(a[1], b[1], c[1]) - origin[1]) / spacing)), 0)
        j1 = min(int(np.floor((max(a[1], b[1], c[1]) - origin[1]) / spacing)), ny - 1)
        for i in range(i0, i1 + 1):
            x = origin[0] + i * spacing
            for j in range(j0, j1 + 1):
                y = origin[1] + j * spacing
                u = ((b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x)) / area
                v = ((c[0] - x) * (a[1] - y) - (c[1] - y) * (a[0] - x)) / area
                if u < 0.0 or v < 0.0 or u + v > 1.0:
                    continue
                z = u * a[2] + v * b[2] + (1.0 - u - v) * c[2]
                for k in range(max(int(np.ceil((z - origin[2]) / spacing)), 0), nz):
                    winding[i, j, k] += 1 if area < 0.0 else -1
