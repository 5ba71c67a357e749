"""Poses mirrored in depth: limbs, trunk and the whole body."""

import numpy as np
import pytest

from silhouette_core.body.joints import EXCHANGED_LANDMARKS, LANDMARK_NAMES
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.tracking import hypothesis_search
from silhouette_core.monocular.tracking.hypothesis_tracker import HypothesisTracker, TrackerSettings
from silhouette_core.monocular.tracking.mirrored_limbs import mirrored_joints, mirrored_poses
from silhouette_core.monocular.tree.forward import ForwardFilter
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.surface import Surface
from tests.silhouette_core.monocular.filming import (
    body,
    camera_at,
    joints_of,
    observed_by,
    performed,
    poses_of,
)

CAMERA = camera_at((0.3, -4.0, 1.2))
MODEL = body()
ELBOW, WRIST, KNEE, ANKLE = (
    LANDMARK_NAMES.index(f"right_{name}") for name in ("elbow", "wrist", "knee", "ankle")
)


@pytest.fixture(scope="module")
def squatting():
    """Thighs point toward the camera, shins away from it."""
    return poses_of(performed("squat"))[24]


@pytest.fixture(scope="module")
def images(squatting):
    return mirrored_joints(joints_of(MODEL, squatting), CAMERA.center_m)


def image_with(images, joints, moved):
    """The image in which these joints alone have moved."""
    for own in images:
        apart = np.linalg.norm(own - joints, axis=1) > 1e-9
        if set(np.flatnonzero(apart)) == set(moved):
            return own
    raise AssertionError(f"no image moves {[LANDMARK_NAMES[k] for k in moved]} alone")


def test_images_look_the_same_to_the_camera(squatting, images):
    """All but the whole body's, whose left and right are exchanged."""
    joints = joints_of(MODEL, squatting)
    seen = CAMERA.project(joints)[0]
    for own in images[:-1]:
        np.testing.assert_allclose(CAMERA.project(own)[0], seen, atol=1e-6)
    turned = CAMERA.project(images[-1])[0]
    np.testing.assert_allclose(turned[EXCHANGED_LANDMARKS], seen, atol=1e-6)


def test_a_mirrored_bone_keeps_its_length_and_points_the_other_way(squatting, images):
    joints = joints_of(MODEL, squatting)
    own = image_with(images, joints, [KNEE, ANKLE])
    hip = LANDMARK_NAMES.index("right_hip")
    lengths = [np.linalg.norm(one[KNEE] - one[hip]) for one in (own, joints)]
    assert lengths[0] == pytest.approx(lengths[1])
    away = [(one[KNEE] - one[hip]) @ CAMERA.rotation[2] for one in (own, joints)]
    assert away[1] < -0.15 and away[0] > 0.15
    shin = image_with(images, joints, [ANKLE])
    away = [(one[ANKLE] - one[KNEE]) @ CAMERA.rotation[2] for one in (shin, joints)]
    assert away[0] * away[1] < 0


def test_bones_in_the_pictures_plane_have_no_image():
    """Arms held aside before a camera straight in front of them."""
    joints = joints_of(MODEL, poses_of(performed("squat"))[0])
    camera = camera_at((joints[0, 0], -4.0, joints[0, 2]))
    joints[:, 1] = joints[0, 1]
    assert len(mirrored_joints(joints, camera.center_m)) <= 2  # trunk seen from below, body


def test_the_body_as_a_whole_turns_round(squatting, images):
    joints = joints_of(MODEL, squatting)

    def facing(one):
        across = one[LANDMARK_NAMES.index("left_hip")] - one[LANDMARK_NAMES.index("right_hip")]
        return np.cross([0, 0, 1], across)[1]

    assert facing(joints) * facing(images[-1]) < 0
    knees = [LANDMARK_NAMES.index(f"{side}_knee") for side in ("left", "right")]
    depth = [(one[knees].mean(0) - one[0]) @ CAMERA.rotation[2] for one in (joints, images[-1])]
    assert depth[0] < 0 < depth[1]


@pytest.fixture(scope="module")
def observed(library, squatting):
    return observed_by(CAMERA, library, squatting)


def test_poses_are_mirrored_within_the_limits_of_the_joints(observed, squatting, images):
    """A thigh does not go as far back as it goes forward."""
    joints = joints_of(MODEL, squatting)
    surface = Surface(MODEL)
    (turned,) = mirrored_poses(surface, observed, images[-1:])
    assert np.linalg.norm(joints_of(MODEL, turned) - images[-1], axis=1).max() < 0.07
    low, high = MODEL.dof_limits_rad.T
    assert ((turned.angles_rad >= low - 1e-6) & (turned.angles_rad <= high + 1e-6)).all()
    assert mirrored_poses(surface, observed, [image_with(images, joints, [KNEE, ANKLE])]) == []
    assert mirrored_poses(surface, observed, []) == []


def test_without_mirror_images_the_tracker_keeps_the_wrong_depth(
    tree, observed, squatting, images, monkeypatch
):
    """The only seed is seen from behind: what it is mirrored to is the truth."""
    (behind,) = mirrored_poses(Surface(MODEL), observed, images[-1:])
    frame = ForwardFilter(tree, CAMERA).step(0, 0.0, Person(observed.mask, False))

    def least_error_m():
        tracker = HypothesisTracker(tree, CAMERA, TrackerSettings(facing=False))
        monkeypatch.setattr(tracker.search, "_seeds", lambda *_: [behind])
        beam = tracker.step(frame, None, None, None, observed)
        truth = joints_of(MODEL, squatting)
        apart = (beam.joints - beam.joints[:, :1]) - (truth - truth[0])
        return np.linalg.norm(apart, axis=-1).mean(axis=1).min()

    found = least_error_m()
    monkeypatch.setattr(hypothesis_search, "mirrored_poses", lambda *_: [])
    assert found < 0.06
    assert found < 0.4 * least_error_m()


def test_bodies_that_are_no_persons_are_not_mirrored():
    still = Pose(np.zeros(3), np.eye(3), np.zeros(3))
    assert TrackerSettings().of_given_body(0.5, still).mirrored == 0
