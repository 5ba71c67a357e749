"""Placements of the torso: different ones, both ways round."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.voxelpose.multiview.carving.carving_scenes import voxels_at
from tests.voxelpose.multiview.matching_scenes import (
    fitting_model,
    hull,
    other_body,
    stance,
    turned,
    views,
)
from voxelpose.multiview.matching.body_volume import BodyVolume
from voxelpose.multiview.proposers.torso_search import _orientations, find_torso

BODY = BodyVolume.from_model(fitting_model(), 0.03, "cpu")


@pytest.mark.parametrize("yaw_deg", [0.0, 100.0])
def test_placements_differ_clearly(yaw_deg):
    actor = other_body(2)
    found = find_torso(BODY, *hull(views(), actor, turned(stance(actor), yaw_deg)), 6)
    assert len(found) == 6
    middle = np.mean([BODY.model.joints_m[k] for k in range(3)], axis=0) - BODY.model.joints_m[0]
    for k, one in enumerate(found):
        for other in found[:k]:
            apart = np.linalg.norm(
                (one.root_m + one.root_rotation @ middle)
                - (other.root_m + other.root_rotation @ middle)
            )
            turn = (np.trace(one.root_rotation.T @ other.root_rotation) - 1) / 2
            assert apart > 0.05 or np.degrees(np.arccos(np.clip(turn, -1, 1))) > 39


@pytest.mark.parametrize("yaw_deg", [0.0, 75.0, 100.0, 200.0])
def test_of_two_placements_one_is_the_other_way_round(yaw_deg):
    actor = other_body(2)
    truth = turned(stance(actor), yaw_deg)
    found = find_torso(BODY, *hull(views(), actor, truth), 2)
    facing = sorted(pose.root_rotation[:, 1] @ truth.root_rotation[:, 1] for pose in found)
    assert facing[0] < -0.8 and facing[1] > 0.8


@pytest.mark.parametrize("pitch_deg", [0.0, 40.0, -80.0])
def test_torsos_lie_in_the_hull_however_the_body_leans(pitch_deg):
    actor = other_body(2)
    grid, occupancy = hull(views(), actor, turned(stance(actor), 0.0, pitch_deg))
    for pose in find_torso(BODY, grid, occupancy, 4):
        points = BODY.points["pelvis"] @ pose.root_rotation.T + pose.root_m
        cells = voxels_at(grid, points).clip(0, np.array(grid.shape) - 1)
        assert occupancy[tuple(cells.T)].mean() > 0.7


def test_torsos_are_tried_in_every_orientation():
    """Of people who lie, whichever way, too."""
    tried, half = Rotation.from_matrix(_orientations(False)), Rotation.from_euler("z", np.pi)
    both = Rotation.concatenate([tried, tried * half])
    for any_turn in Rotation.random(200, random_state=1):
        assert np.degrees((both.inv() * any_turn).magnitude().min()) < 45
