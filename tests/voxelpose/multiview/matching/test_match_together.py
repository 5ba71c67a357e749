"""Several bodies matched to the voxels of all of them."""

import numpy as np
import pytest

from silhouette_core.motion.pose import Pose
from tests.voxelpose.multiview.matching_scenes import fitting_model, photograph, stance, views
from voxelpose.multiview.carving.carver import carve
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.matching.body_volume import BodyVolume
from voxelpose.multiview.matching.matcher import match, match_together

MODEL = fitting_model()
VOLUME = BodyVolume.from_model(MODEL, 0.03, "cpu")
# The left hand of one and the right hand of the other reach into the same place.
TURNS = (
    {"left_upper_arm.abduction": 60.0},
    {"right_upper_arm.abduction": 60.0, "right_forearm.flexion": 30.0},
)


def hull_of(*poses):
    """Voxels of bodies by six cameras."""
    seen_by = views(6)
    people = [photograph(seen_by, MODEL, pose) for pose in poses]
    masks = [np.logical_or.reduce(one) for one in zip(*people, strict=True)]
    grid = VoxelGrid.from_bounds((-0.9, -0.6, -0.03), (1.7, 0.6, 1.9), 0.03)
    return grid, carve(seen_by.rig, masks, grid)


def with_root_only(pose):
    return Pose(pose.root_m, pose.root_rotation, stance(MODEL).angles_rad)


def test_bodies_far_from_each_other_are_matched_as_each_alone():
    poses = [
        stance(MODEL, turns, place)
        for turns, place in zip(TURNS, ((-0.3, 0), (1.2, 0)), strict=True)
    ]
    grid, whole = hull_of(*poses)
    starts = [(VOLUME, with_root_only(pose)) for pose in poses]
    together = match_together(starts, grid, whole)
    middle = round((0.45 - grid.origin_m[0]) / grid.voxel_size_m)
    for k, found in enumerate(together):
        own = whole.copy()
        own[middle:] &= k == 1
        own[:middle] &= k == 0
        alone = match(VOLUME, grid, own, starts[k][1])
        np.testing.assert_array_equal(found.pose.angles_rad, alone.pose.angles_rad)
        assert found.groups == alone.groups


@pytest.fixture(scope="module")
def near():
    """Two bodies whose arms reach for the same voxels."""
    poses = [
        stance(MODEL, turns, place)
        for turns, place in zip(TURNS, ((-0.3, 0), (0.4, 0)), strict=True)
    ]
    return poses, hull_of(*poses)


def test_parts_of_two_bodies_that_interfere_are_decided_at_once(near):
    poses, (grid, whole) = near
    first, second = match_together([(VOLUME, with_root_only(p)) for p in poses], grid, whole)
    assert any("left_upper_arm" in g and "right_upper_arm of 2" in g for g in first.groups)
    assert any("right_upper_arm" in g and "left_upper_arm of 1" in g for g in second.groups)
