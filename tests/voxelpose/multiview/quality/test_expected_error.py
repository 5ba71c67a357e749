"""Errors to be expected: the evidence of a pose, and what it says."""

from dataclasses import replace

import numpy as np
import pytest

from calib.camera import Rig
from silhouette_core.body.sizes import IS_CLOTHING
from silhouette_core.fitted_weights import fitted_weights
from silhouette_core.motion.motion import Motion
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.refinement.surface import Surface
from tests.voxelpose.multiview.matching_scenes import (
    fitting_model,
    joints,
    other_body,
    photograph,
    stance,
    views,
)
from voxelpose.multiview.carving.carver import CarveRule
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import HullObserver
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.proposers.pose_search import BodyGeometry
from voxelpose.multiview.quality.quality import (
    FILE,
    MotionEvidence,
    expected_errors,
    frame_evidence,
    half_turn_ratio,
    open_joints,
    regressors,
)

VOLUME = VoxelGrid.from_bounds((-1.6, -1.2, -0.1), (1.6, 1.2, 2.1), 0.05)


@pytest.fixture(scope="module")
def scene():
    """A body in a pose with one arm raised and bent, its joints, and how four cameras see it."""
    model = fitting_model()
    pose = stance(model, {"left_upper_arm.abduction": 60.0, "left_forearm.flexion": 70.0})
    observer = HullObserver(views(4), VOLUME, 0.04, CarveRule(least_agreeing=3))
    frame = observer.observe(photograph(observer.views, model, pose))
    return BodyGeometry.from_surface(Surface(model), 0.04, "cpu"), pose, frame


def test_the_right_pose_has_nothing_against_it_and_a_wrong_arm_is_seen_at_that_arm(scene):
    body, pose, frame = scene
    right = frame_evidence(body, pose, joints(body.model, pose), frame)
    agreement = right["camera_agreement"]
    assert agreement.shape == (4,) and agreement.min() > 0.98
    angles = pose.angles_rad.copy()
    angles[body.model.tree.dof_names.index("left_forearm.flexion")] = 0.0
    other = replace(pose, angles_rad=angles)
    wrong = frame_evidence(body, other, joints(body.model, other), frame)
    names = list(range(15))
    assert 1 - wrong["camera_agreement"].mean() > 2 * (1 - agreement.mean())
    near = wrong["joint_disagreement"]
    # 11 is the left wrist, 12 to 14 the right arm.
    assert max(names, key=lambda k: near[k]) == 11
    assert near[11] > 10 * near[14]


def test_a_body_turned_half_round_explains_less(scene):
    body, pose, frame = scene
    assert half_turn_ratio(body, pose, frame, MatchSettings()) > 1.5


def test_a_forearm_before_the_trunk_is_open_where_no_camera_sees_it_from_the_side():
    around = views(12).rig.cameras
    model = fitting_model()
    across = {"left_upper_arm.twist": 60.0, "left_forearm.flexion": 100.0}
    pose, chances = stance(model, across), {}
    body = BodyGeometry.from_surface(Surface(model), 0.04, "cpu")
    for name, cameras in {"before": around[8:10], "around": around[::3]}.items():
        seen_by = PinholeViews.from_rig(Rig(tuple(cameras)))
        observer = HullObserver(seen_by, VOLUME, 0.04, CarveRule(least_agreeing=2))
        frame = observer.observe(photograph(seen_by, other_body(), pose))
        chances[name], away_mm = open_joints(body, pose, frame)
        assert chances[name].max() <= 1 and away_mm[11] > 100 * chances[name][11]
    assert chances["before"][11] > 0.3 > 0.1 > chances["around"][11]  # the left wrist
    assert chances["before"][[0, 2, 5, 7]].max() < 0.05  # pelvis, knees, neck


def evidence(
    camera, joint, outside, half_turn=3.0, at_limits=0.02, clothes=0.0, frames=1, sigma=0.007
):
    return MotionEvidence(
        np.full((frames, 4), camera),
        np.full((frames, 15), joint),
        np.full((frames, 15), sigma),
        np.full(frames, outside),
        np.full(frames, at_limits),
        half_turn,
        clothes,
    )


GOOD = {"camera": 0.06, "joint": 0.02, "outside": 0.0, "half_turn": 4.0}


def test_worse_evidence_is_never_said_to_be_better():
    good = expected_errors(evidence(**GOOD))
    bad = expected_errors(evidence(0.35, 0.2, 0.05, half_turn=1.1, sigma=0.014))
    assert good["right_probability"][0] > 0.95 and bad["right_probability"][0] < 0.5
    assert good["landmark_confidence"].min() > 0.7 > bad["landmark_confidence"].max()
    assert good["joint_error_mm"].max() < 40 < bad["joint_error_mm"].max()


@pytest.mark.parametrize(
    "worse",
    [{"joint": 0.08}, {"sigma": 0.014}, {"outside": 0.1}, {"at_limits": 0.15}, {"clothes": 0.03}],
)
def test_each_piece_of_evidence_counts(worse):
    good, bad = (expected_errors(evidence(**GOOD | more)) for more in ({}, worse))
    assert (bad["landmark_confidence"] < good["landmark_confidence"]).all()
    assert (bad["joint_error_mm"] > good["joint_error_mm"]).all()


def test_frames_without_evidence_say_nothing():
    nothing = expected_errors(evidence(np.nan, np.nan, np.nan))
    assert (
        np.isnan(nothing["right_probability"]).all() and np.isnan(nothing["joint_error_mm"]).all()
    )
    rows, frames = regressors(evidence(0.1, 0.05, 0.0, frames=2))
    weights = fitted_weights(FILE)
    assert rows.shape == (2, 15, len(weights["near"]))
    assert frames.shape == (2, len(weights["right"]))
    assert len(weights["error"]) == len(weights["near"])


def test_a_motion_tells_how_thick_its_clothes_are_and_how_far_its_joints_are_bent():
    model = fitting_model()
    bent = [stance(model, {"left_forearm.flexion": deg}).clipped() for deg in (500.0, -500.0)]
    poses = [stance(model), *bent]
    motion = Motion(
        30.0,
        model.reshaped(np.where(IS_CLOTHING, 0.01, 0.0)),
        np.stack([pose.root_m for pose in poses]),
        np.array([[1.0, 0, 0, 0]] * 3),
        np.stack([pose.angles_rad for pose in poses]),
        quality={
            "camera_agreement": np.full((3, 4), 0.9),
            "joint_disagreement": np.full((3, 15), 0.1),
            "joint_sigma_mm": np.full((3, 15), 8.0),
            "outside": np.zeros(3),
        },
    )
    found = MotionEvidence.from_motion(motion, 2.0)
    assert found.camera_error == pytest.approx(0.1) and found.joint_sigma_m == pytest.approx(0.008)
    assert found.clothes == pytest.approx(0.02)
    more = found.at_limits[1:] - found.at_limits[0]
    assert more == pytest.approx(1 / model.dof_count)


def test_expected_errors_are_the_regression():
    """The logarithm of 3 mm more is linear in the evidence."""
    rng = np.random.default_rng(0)
    given = MotionEvidence(
        rng.uniform(0.05, 0.3, (6, 4)),
        rng.uniform(0, 0.2, (6, 15)),
        rng.uniform(0.003, 0.02, (6, 15)),
        rng.uniform(0, 0.3, 6),
        rng.uniform(0, 0.2, 6),
        2.0,
        0.1,
    )
    joints, frames = regressors(given)
    found = expected_errors(given)
    weights = fitted_weights(FILE)
    expected = joints @ weights["error"]
    np.testing.assert_allclose(np.log(found["joint_error_mm"] + 3.0), expected, atol=0.05)
    odds = found["right_probability"] / (1 - found["right_probability"])
    np.testing.assert_allclose(np.log(odds), frames @ weights["right"], atol=1e-6)
