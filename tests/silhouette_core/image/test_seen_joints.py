from dataclasses import replace

import numpy as np

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.image.pose_network import POINTS, Crop, PersonSeen
from silhouette_core.image.seen_joints import (
    SeenJoints,
    deviations_m,
    joint_weights,
    joints_of_silhouette,
)
from tests.voxelpose.multiview.carving.carving_scenes import look_at

CAMERA = look_at("cam_1", (3.0, -2.0, 1.4), (0.0, 0.0, 1.0), distortion=(-0.1, 0.02, 0, 0, 0))


def person(points_px, presence=1.0, visibility=1.0):
    logits = np.full((256, 256), 80, np.int8)
    seen = np.full(POINTS, visibility)
    return PersonSeen(Crop(80, 60, 100), presence, logits, points_px, seen, np.zeros((2, 2)))


def test_weights_are_affine_and_lead_to_the_joints_own_points():
    weights = joint_weights()
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=0.02)
    for name, point in (("left_knee", 25), ("right_wrist", 16), ("left_shoulder", 11)):
        assert weights[LANDMARK_NAMES.index(name)].argmax() == point
    assert weights.shape == (15, POINTS)


def test_rays_lead_through_the_lens_to_where_the_points_are():
    """All points in one place: so are all joints."""
    place = np.array([0.3, 0.2, 1.2])
    pixel = np.reshape(CAMERA.project(place[None])[0], -1)
    joints = SeenJoints.of(person(np.tile(pixel, (POINTS, 1))), CAMERA)
    inside = CAMERA.rotation @ place + CAMERA.translation
    np.testing.assert_allclose(joints.rays, np.tile(inside / inside[2], (15, 1)), atol=0.02)


def test_what_is_hidden_deviates_more():
    seen, hidden = (deviations_m(np.full(15, one)) for one in (1.0, 0.0))
    assert (hidden >= seen).all() and (hidden > seen).any() and 0.005 < seen.max() < 0.1


def test_joints_of_whom_the_network_is_not_sure_do_not_count():
    points = np.tile([80.0, 60.0], (POINTS, 1))
    assert SeenJoints.of(person(points, presence=0.9), CAMERA) is None
    points[3] = np.nan
    assert SeenJoints.of(person(points), CAMERA) is None


def test_joints_of_a_silhouette_are_those_of_who_shares_most_of_it():
    """Two people beside each other; all points of each are in one place."""
    people = {}
    for number, left in ((0, 20), (3, 100)):
        place = np.tile([left + 20.0, 60.0], (POINTS, 1))
        people[number] = replace(person(place), crop=Crop(left + 20, 60, 40))
    width, height = CAMERA.size
    mask = np.zeros((height, width), np.bool_)
    mask[40:80, 50:130] = True
    wanted = SeenJoints.of(people[3], CAMERA)
    for silhouette in (mask, mask[::2, ::2]):
        np.testing.assert_array_equal(
            joints_of_silhouette(people, CAMERA, silhouette).rays, wanted.rays
        )
    assert joints_of_silhouette(people, CAMERA, np.zeros_like(mask)) is None
    assert joints_of_silhouette({}, CAMERA, mask) is None
