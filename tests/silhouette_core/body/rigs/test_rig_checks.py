"""Skin weights of any rig: the largest four, and what a face belongs to."""

import numpy as np

from silhouette_core.body.kinematic_tree import KinematicTree
from silhouette_core.body.model import BodyModel
from silhouette_core.body.rigs.rig_checks import skinned_body

TREE = KinematicTree.from_parts(
    [("part_0", "", ()), *((f"part_{k}", "part_0", ()) for k in range(1, 20))]
)


def body(face: list[int], parts: np.ndarray, weights: np.ndarray) -> BodyModel:
    """A body of one face and twenty parts, all at the origin."""
    joints, vertices = np.zeros((len(TREE.names), 3)), np.zeros((len(parts), 3))
    return skinned_body(TREE, joints, vertices, np.array([face]), parts, weights, joints)


def test_the_largest_four_weights_are_kept_and_sum_to_one():
    weights = np.array([[0.05, 0.3, 0.02, 0.2, 0.28, 0.15]])
    made = body([0, 0, 0], np.arange(6)[None] + 10, weights)
    assert made.skin_parts.tolist() == [[11, 14, 13, 15]]
    np.testing.assert_allclose(made.skin_weights, [np.array([0.3, 0.28, 0.2, 0.15]) / 0.93])


def test_a_face_belongs_to_the_part_with_most_weight_over_its_corners():
    parts = np.array([[3, 7, 0, 0], [3, 7, 0, 0], [7, 3, 0, 0]], np.int32)
    weights = np.array([[0.6, 0.4, 0, 0], [0.6, 0.4, 0, 0], [0.9, 0.1, 0, 0]])
    assert body([0, 1, 2], parts, weights).face_part.tolist() == [7]
