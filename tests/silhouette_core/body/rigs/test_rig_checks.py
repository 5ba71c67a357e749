"""Skin weights of any rig: the largest four, and what a face belongs to."""

import numpy as np

from silhouette_core.body.rigs.rig_checks import part_of_faces, strongest_four


def test_the_largest_four_weights_are_kept_and_sum_to_one():
    weights = np.array([[0.05, 0.3, 0.02, 0.2, 0.28, 0.15]])
    parts, kept = strongest_four(np.arange(6)[None] + 10, weights)
    assert parts.tolist() == [[11, 14, 13, 15]]
    np.testing.assert_allclose(kept, [np.array([0.3, 0.28, 0.2, 0.15]) / 0.93])


def test_a_face_belongs_to_the_part_with_most_weight_over_its_corners():
    parts = np.array([[3, 7, 0, 0], [3, 7, 0, 0], [7, 3, 0, 0]], np.int32)
    weights = np.array([[0.6, 0.4, 0, 0], [0.6, 0.4, 0, 0], [0.9, 0.1, 0, 0]])
    assert part_of_faces(np.array([[0, 1, 2]]), parts, weights).tolist() == [7]
