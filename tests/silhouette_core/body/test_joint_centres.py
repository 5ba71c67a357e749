"""Joint centres of people in adapted templates."""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.body.joint_centres import JointCentres, read_joint_centres
from silhouette_core.body.joints import EXCHANGED_LANDMARKS
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import SHAPE_SIGMA, BodySizes
from silhouette_core.motion.kinematics import landmarks
from tests.clips import waving

SEXES = pytest.mark.parametrize("sex", ["male", "female"])


def test_offsets_follow_the_bodies_that_are_alike():
    shapes = np.array([[0.0] * len(SHAPE_SIGMA), [9.0] * len(SHAPE_SIGMA)])
    weights = np.array([np.full((15, 3), 0.01), np.full((15, 3), 0.02)])
    centres = JointCentres(shapes, weights, 4.0)
    for shape, weight in zip(shapes, weights, strict=True):
        np.testing.assert_allclose(centres.offsets(shape * SHAPE_SIGMA), weight, atol=1e-9)
    beside = shapes[0].copy()
    beside[0] = 4.0
    expected = np.exp(-0.5) * weights[0]
    np.testing.assert_allclose(centres.offsets(beside * SHAPE_SIGMA), expected, atol=1e-9)


@SEXES
def test_a_body_unlike_all_that_were_learned_keeps_its_joints(sex):
    body = BodyModel.from_sizes(BodySizes(1.7, sex=sex)).reshaped(30 * SHAPE_SIGMA)
    np.testing.assert_allclose(body.joint_centres_m, body.landmarks_m, atol=1e-6)


@SEXES
def test_centres_are_near_the_joints_alike_on_both_sides_and_grow_with_the_stature(sex):
    body = BodyModel.from_sizes(BodySizes(1.7, sex=sex))
    offsets_m = body.joint_centres_m - body.landmarks_m
    assert 0.003 < np.linalg.norm(offsets_m, axis=1).max() < 0.03
    np.testing.assert_allclose(offsets_m[EXCHANGED_LANDMARKS] * (-1, 1, 1), offsets_m, atol=1e-6)
    tall = BodyModel.from_sizes(BodySizes(1.1 * 1.7, sex=sex))
    np.testing.assert_allclose(tall.joint_centres_m, 1.1 * body.joint_centres_m, atol=1e-9)


def test_either_template_has_its_own():
    man, woman = read_joint_centres("man"), read_joint_centres("woman")
    assert not np.allclose(man.shapes, woman.shapes)


def test_joints_of_a_motion_are_the_centres_and_other_bodies_keep_theirs():
    motion = waving()
    body, (rotation, origin) = motion.model, motion.parts()
    part = body.tree.landmark_part
    local = body.joint_centres_m - body.joints_m[part]
    expected = origin[:, part] + np.einsum("tlij,lj->tli", rotation[:, part], local)
    np.testing.assert_allclose(motion.landmarks(), expected, atol=1e-12)
    other = replace(motion, model=replace(body, person=None))
    np.testing.assert_array_equal(other.landmarks(), landmarks(body, rotation, origin))
