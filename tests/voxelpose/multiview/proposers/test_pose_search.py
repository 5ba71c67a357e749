"""Pose of a single frame without a prior: torso, limbs, whole search."""

import numpy as np
import pytest

from calib.camera import Rig
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.refinement.surface import Surface
from tests.voxelpose.multiview.matching_scenes import (
    fitting_model,
    hull,
    joint_errors_m,
    observe,
    other_body,
    photograph,
    stance,
    turned,
    views,
)
from voxelpose.multiview.carving.carver import carve
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.body_volume import BodyVolume
from voxelpose.multiview.matching.limbs import CHAINS
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.proposers.limb_search import place_limb
from voxelpose.multiview.proposers.pose_search import BodyGeometry, find_pose, standing
from voxelpose.multiview.proposers.torso_search import find_torso

TURNS = {"left_upper_arm.abduction": 20.0, "right_thigh.flexion": 30.0, "right_shin.flexion": 40.0}
TORSO = [
    LANDMARK_NAMES.index(name)
    for name in ("left_hip", "right_hip", "left_shoulder", "right_shoulder", "neck")
]


@pytest.fixture(scope="module")
def body():
    model = fitting_model()
    return BodyGeometry(model, BodyVolume.from_model(model, 0.03, "cpu"), Surface(model, 600))


def test_torso_is_among_the_first_placements(body):
    actor = other_body(1)
    truth = turned(stance(actor, TURNS), 50)
    result = find_torso(body.body_volume, *hull(views(), actor, truth))
    assert 2 <= len(result) <= 8
    errors = [joint_errors_m(body.model, pose, actor, truth)[TORSO].mean() for pose in result]
    assert min(errors) < 0.10
    # Front and back look alike to a torso: the other way round is offered as well.
    facing = [pose.root_rotation[:, 1] @ truth.root_rotation[:, 1] for pose in result]
    assert min(facing) < -0.7 < 0.7 < max(facing)


def test_no_hull_no_torso(body):
    grid = VoxelGrid(np.zeros(3), 0.1, (5, 5, 5))
    nothing = np.zeros(grid.shape, bool)
    assert find_torso(body.body_volume, grid, nothing) == []
    seen_by = views(2)
    masks = photograph(seen_by, body.model, stance(body.model))
    assert find_pose(body, FrameObservation(seen_by, masks, grid, nothing)) == []


@pytest.mark.parametrize(
    ("chain", "turns"),
    [
        (0, {"left_upper_arm.abduction": 40.0}),
        (3, {"right_thigh.flexion": 50.0, "right_shin.flexion": 60.0}),
    ],
)
def test_a_limb_is_found_on_the_silhouettes_alone(body, chain, turns):
    """Everything but one limb stands right."""
    actor = other_body(1)
    truth, start = stance(actor, turns), stance(body.model)
    result = place_limb(body.body_volume, observe(views(), actor, truth), start, CHAINS[chain])
    ends = [
        LANDMARK_NAMES.index(name)
        for name in (("left_elbow", "left_wrist"), ("right_knee", "right_ankle"))[chain > 1]
    ]
    before, after = (
        joint_errors_m(body.model, pose, actor, truth)[ends] for pose in (start, result)
    )
    assert before.max() > 0.3 and after.max() < 0.15
    own = {limb.name for limb in CHAINS[chain]}
    other = [
        k for k, name in enumerate(body.model.tree.dof_names) if name.partition(".")[0] not in own
    ]
    np.testing.assert_array_equal(result.angles_rad[other], start.angles_rad[other])


def test_somebody_who_stands_before_two_cameras_side_by_side_is_placed(body):
    """Their hull is longer than a person, who stands at one end of it."""
    actor = other_body(1)
    truth = turned(stance(actor, {"left_thigh.flexion": 15.0}, place_m=(0.2, -0.3)), 70)
    seen_by = PinholeViews.from_rig(Rig(tuple(views(12).rig)[:2]))
    masks = photograph(seen_by, actor, truth)
    grid = VoxelGrid.from_bounds((-1.6, -1.6, 0.0), (1.6, 1.6, 2.2), 0.04)
    frame = FrameObservation(seen_by, masks, grid, carve(seen_by.rig, masks, grid))
    assert np.ptp(grid.occupied_points(frame.occupancy)[:, :2], axis=0).max() > 1.2
    placed = standing(body, frame)
    errors_m = [joint_errors_m(body.model, pose, actor, truth).mean() for pose in placed]
    assert errors_m[0] < 0.15


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "yaw_deg"), [(1, 50.0), (4, -130.0)])
def test_whole_search_from_nothing(body, seed, yaw_deg):
    """Another body, turned, two limbs moved: joints to a few centimetres, not front to back."""
    actor = other_body(seed)
    truth = turned(stance(actor, TURNS), yaw_deg)
    seen_by = views()
    frame = FrameObservation(
        seen_by, photograph(seen_by, actor, truth), *hull(seen_by, actor, truth)
    )
    result = find_pose(body, frame, MatchSettings(), 4)
    errors = joint_errors_m(body.model, result[0].pose, actor, truth)
    assert errors.mean() < 0.05 and errors.max() < 0.15
    assert [f.error for f in result] == sorted(f.error for f in result)
    assert result[0].error < 0.2
