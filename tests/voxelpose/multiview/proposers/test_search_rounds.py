"""The rounds of the pose search, where rules stand for what matching and refinement find."""

from types import SimpleNamespace

import numpy as np
import pytest

from silhouette_core.motion.pose import Pose
from tests.voxelpose.multiview.matching_scenes import fitting_model, stance
from voxelpose.multiview.matching.limbs import CHAINS
from voxelpose.multiview.proposers import pose_search
from voxelpose.multiview.proposers.pose_search import PoseFit, find_pose, move_limbs

MODEL = fitting_model()
VOLUME = SimpleNamespace(is_person=True, chains=CHAINS)
BODY = SimpleNamespace(model=MODEL, body_volume=VOLUME, root=None)
FRAME = SimpleNamespace(grid=None, occupancy=None, observation=None)


def at(x_m: float) -> Pose:
    return stance(MODEL, place_m=(x_m, 0.0))


def places(poses) -> list[float]:
    return [round(float(pose.root_m[0]), 6) for pose in poses]


@pytest.fixture
def matched(monkeypatch) -> list[Pose]:
    """Five torsos at 0 to 4 m; matching moves a body by 0.1 m, which explains more: the nearer to
    0 m it began, and the more often it was matched. Returns the poses that are matched.
    """
    starts = []

    def match(volume, grid, occupancy, start, settings):
        starts.append(start)
        moved = start.moved(np.eye(6 + MODEL.dof_count)[0] * 0.1)
        return SimpleNamespace(pose=moved, stopped=())

    def refine_fits(body, observation, begun):
        x = [one.pose.root_m[0] for one in begun]
        errors = [0.5 + 0.1 * int(each) - 0.5 * (each - int(each)) for each in x]
        return [PoseFit(one.pose, error) for one, error in zip(begun, errors, strict=True)]

    monkeypatch.setattr(pose_search, "find_torso", lambda *given: [at(x) for x in range(5)])
    monkeypatch.setattr(pose_search, "standing", lambda *given: [])
    monkeypatch.setattr(pose_search, "match", match)
    monkeypatch.setattr(pose_search, "refine_fits", refine_fits)
    monkeypatch.setattr(pose_search, "move_limbs", lambda body, observation, fit: fit)
    return starts


def test_the_three_best_torsos_are_matched_a_second_time(matched):
    found = find_pose(BODY, FRAME, None)  # type: ignore[arg-type]
    assert places(matched) == [0, 1, 2, 3, 4, 0.1, 1.1, 2.1]
    assert places(fit.pose for fit in found) == [0.2, 0.1, 1.2, 1.1, 2.2, 2.1, 3.1, 4.1]


def test_a_stance_that_explains_more_than_a_match_comes_before_it(matched, monkeypatch):
    monkeypatch.setattr(pose_search, "standing", lambda *given: [at(0.5)])
    found = find_pose(BODY, FRAME, None)  # type: ignore[arg-type]
    assert places(fit.pose for fit in found)[:3] == [0.6, 0.5, 0.2]


def test_a_pose_whose_limbs_were_moved_may_come_first(matched, monkeypatch):
    def moved(body, observation, fit):
        return PoseFit(fit.pose, 0.1) if places([fit.pose]) == [0.1] else fit

    monkeypatch.setattr(pose_search, "move_limbs", moved)
    found = find_pose(BODY, FRAME, None)  # type: ignore[arg-type]
    assert places(fit.pose for fit in found)[:2] == [0.1, 0.2]


def test_limbs_move_one_after_the_other_as_long_as_they_gain(monkeypatch):
    """Placing the limbs of both sides lowers the error, or raises it, by what each is worth."""
    worth = np.array([0.1, -0.1, 0.05, 0.001])

    def place_limb(volume, observation, pose, chain):
        angles = pose.angles_rad.copy()
        angles[CHAINS.index(chain)] = 1.0
        return Pose(pose.root_m, pose.root_rotation, angles)

    def refine_fits(body, observation, begun):
        return [PoseFit(one.pose, 0.5 - worth @ one.pose.angles_rad[:4]) for one in begun]

    monkeypatch.setattr(pose_search, "place_limb", place_limb)
    monkeypatch.setattr(pose_search, "refine_fits", refine_fits)
    nowhere = Pose(np.zeros(3), np.eye(3), np.zeros(MODEL.dof_count))
    found = move_limbs(BODY, None, PoseFit(nowhere, 0.5))  # type: ignore[arg-type]
    assert found.error == pytest.approx(0.35)
    assert found.pose.angles_rad[:4].tolist() == [1, 0, 1, 0]
