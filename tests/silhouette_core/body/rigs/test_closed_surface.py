"""Seams and holes of surfaces are closed, and pieces turned outward."""

import numpy as np

from silhouette_core.body.rigs.closed_surface import close_surface


def _volume(points, faces):
    a, b, c = (points[faces[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def _open(faces):
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, 1:], faces[:, ::2]]), axis=1)
    return int((np.unique(edges, axis=0, return_counts=True)[1] % 2).sum())


def test_a_closed_surface_stays_as_it_is(rig_files):
    vertices, faces = rig_files.box_mesh()
    kept, same, points, holes = close_surface(vertices, faces)
    assert holes == 0 and np.array_equal(kept, np.arange(8))
    assert np.array_equal(same, faces) and np.array_equal(points, vertices)


def test_seams_are_joined(rig_files):
    vertices, faces = rig_files.box_mesh()
    torn = vertices[faces.ravel()]
    kept, joined, points, holes = close_surface(torn, np.arange(len(torn)).reshape(-1, 3))
    assert holes == 0 and len(kept) == 8 and _open(joined) == 0
    assert np.isclose(_volume(points, joined), 0.004)


def test_holes_are_closed_and_a_surface_inside_out_is_turned(rig_files):
    vertices, faces = rig_files.box_mesh()
    _, closed, points, holes = close_surface(vertices, faces[4:, ::-1])
    assert holes == 2 and _open(closed) == 0
    assert np.isclose(_volume(points, closed), 0.004)
