"""Every method sees what is at least 0.05 m before a camera, and nothing that is nearer."""

from types import SimpleNamespace

import numpy as np
import pytest

from silhouette_core.scoring.backend import load_backend

BACKEND = load_backend("cpu")
MATRIX, FACES = np.array([[9.0, 0, 10], [0, 9, 8], [0, 0, 1]]), np.array([[0, 1, 2]])


@pytest.mark.parametrize("depth_m", [0.01, 0.0499, 0.05, 0.0501, 0.3])
def test_what_is_nearer_than_the_near_plane_is_not_seen(depth_m):
    seen = depth_m >= 0.05
    corners = depth_m * np.array([[-1.0, -1, 1], [0, 2, 1], [1, -1, 1]])
    parts = BACKEND.part_images(corners[None], FACES, np.zeros(1, int), MATRIX, (21, 17), False)
    mask = parts[0] > 0
    assert mask.any() == seen
    drawn = BACKEND.drawn_weights(np.ones((17, 21)), corners[None], FACES, MATRIX)
    assert drawn[0] == mask.sum()
    shown = np.zeros((17, 21), bool)
    shown[9, 10] = True
    meshes = corners[None, None]
    errors = [
        BACKEND.silhouette_errors([one], MATRIX[None], meshes, FACES) for one in (shown, mask)
    ]
    assert (errors[0][0] < 1) == seen == (errors[1][0] == 0)
    views = SimpleNamespace(
        intrinsics=np.array([[9.0, 9, 10, 8]]),
        rotation=np.eye(3)[None],
        translation_m=np.zeros((1, 3)),
    )
    points = depth_m * np.array([[0.0, 0.0, 1.0]])
    placed = points, np.eye(3)[None], np.zeros((1, 3))
    scores = BACKEND.pixel_scores(views, np.ones((1, 17, 21), np.int8), *placed)
    assert scores.tolist() == [int(seen)]
