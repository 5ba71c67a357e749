"""Triangles of files, and surfaces that enclose a volume, made of them.

A surface is closed where every edge belongs to an even number of triangles: then every line crosses
it an even number of times, by which points inside are told (`body.volume`).
"""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from calib.checks import FloatArray, IndexArray, IntArray
from calib.errors import InputError
from calib.storage.documents import load_text, parse_xml


def close_surface(
    vertices: FloatArray, faces: IndexArray
) -> tuple[IntArray, IntArray, FloatArray, int]:
    """Closed, outward oriented surface of triangles that may have seams and holes.

    Vertices at one place are joined where seams are open; every hole is closed by triangles to the
    middle of its edge; a piece whose volume is negative is turned over.

    Args:
        vertices: (V, 3).
        faces: (F, 3).

    Returns:
        `used` (W,), the numbers of the vertices that the surface has, of which one at the end per
        hole is the vertex next to its middle; faces (G, 3) of these; positions (W, 3); number of
        holes.
    """
    faces = np.asarray(faces, np.int64)
    if len(_open_edges(faces)):
        extent = max(float(np.ptp(vertices, axis=0).max()), 1e-12)
        grid = np.round(vertices / (1e-6 * extent))
        _, first, joined = np.unique(grid, axis=0, return_index=True, return_inverse=True)
        faces = first[joined.reshape(-1)][faces]
        ends = faces, np.roll(faces, 1, axis=1)
        faces = faces[(ends[0] != ends[1]).all(1)]
    used, faces = np.unique(faces, return_inverse=True)
    faces, points = faces.reshape(-1, 3), vertices[used]
    edges = _open_edges(faces)
    holes = _connected(edges, len(points))
    for number in np.unique(holes):
        rim = edges[holes == number]
        middle = points[np.unique(rim)].mean(0)
        near = np.unique(rim)[((points[np.unique(rim)] - middle) ** 2).sum(1).argmin()]
        tip = np.full(len(rim), len(points))
        faces = np.concatenate([faces, np.stack([rim[:, 1], rim[:, 0], tip], axis=1)])
        used, points = np.append(used, used[near]), np.append(points, middle[None], axis=0)
    return used, _outward(points, faces), points, len(np.unique(holes))


def _open_edges(faces: IntArray) -> IntArray:
    """Edges (E, 2) that belong to an odd number of triangles, in the direction of one of them."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    _, first, count = np.unique(
        np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True
    )
    return edges[first[count % 2 == 1]]


def _connected(edges: IntArray, count: int) -> IntArray:
    """Number of the connected group of each edge (E,)."""
    links = coo_array((np.ones(len(edges), bool), (edges[:, 0], edges[:, 1])), shape=(count, count))
    return connected_components(links, directed=False)[1][edges[:, 0]]


def _outward(points: FloatArray, faces: IntArray) -> IntArray:
    """The faces, pieces of negative volume turned over."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    piece = _connected(ends, len(points))[: len(faces)]
    a, b, c = (points[faces[:, k]] - points.mean(0) for k in range(3))
    volume = np.bincount(piece, (a * np.cross(b, c)).sum(1))
    return np.where((volume[piece] < 0)[:, None], faces[:, ::-1], faces)


MESH_SUFFIXES = ".stl", ".dae", ".obj", ".ply"
_LARGEST = 100_000_000


def read_triangles(file: Path, most: int) -> Any:
    """The triangles of a file, a `trimesh.Trimesh` as it stands in the file. Raises InputError
    where the file is missing, damaged, too large, or holds no surface.

    Args:
        most: number of triangles that there may be.
    """
    import trimesh

    try:
        size = file.stat().st_size
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror}") from None
    if size > _LARGEST:
        raise InputError(f"{file} is larger than {_LARGEST / 1e6:.0f} MB: simplify it")
    if file.suffix.lower() == ".dae":  # its parser would follow what a document type defines
        parse_xml(load_text(file, _LARGEST, errors="replace"), file)
    try:
        with file.open("rb") as stream, np.errstate(all="ignore"):
            loaded: Any = trimesh.load_mesh(
                stream, file_type=file.suffix[1:].lower(), process=False
            )
        count = len(loaded.faces) if len(loaded.vertices) else 0
        usable = count and np.isfinite(loaded.vertices).all()
    # Its parsers raise whatever a damaged file leads to.
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:150]
        raise InputError(f"{file} cannot be read as a mesh ({reason}): export it again") from None
    if not usable or loaded.faces.min() < 0 or loaded.faces.max() >= len(loaded.vertices):
        raise InputError(f"{file} has no surface: export it again")
    if count > most:
        raise InputError(f"{file} has {count} triangles, above {most}: simplify it")
    return loaded
