"""Every named cost of a frame: what it says, and that it decides where nothing else does."""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.monocular.tracking.frame_costs import CostSettings, FrameCosts, Hypotheses
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.surface import Surface
from tests.silhouette_core.monocular.filming import body, joints_at, performed, poses_of, proposed

MODEL = body()
SURFACE = Surface(MODEL, 200)
STANDING = poses_of(performed("walk"))[12]
LEVEL = STANDING.moved(
    np.r_[0, 0, -SURFACE.posed(STANDING).points[:, 2].min(), np.zeros(3 + MODEL.dof_count)]
)
SETTINGS = CostSettings()


def moved(pose: Pose, *by_m: float) -> Pose:
    return Pose(pose.root_m + np.array(by_m), pose.root_rotation, pose.angles_rad)


@pytest.fixture
def alike():
    """Makes hypotheses that the silhouette fits alike, with equal probability, unless said."""

    def of(*poses: Pose, **others) -> Hypotheses:
        joints = np.stack([joints_at(MODEL, pose) for pose in poses])
        either = proposed(poses, [1 / len(poses)] * len(poses))
        distance = np.full(len(poses), 0.05)
        return replace(Hypotheses(list(poses), joints, distance, SURFACE, either), **others)

    return of


def costs_of(name: str, given: Hypotheses, costs: FrameCosts | None = None) -> np.ndarray:
    return (costs or FrameCosts(SETTINGS)).terms[name](given)


def _as_proposed(alike):
    poses = LEVEL, replace(poses_of(performed("wave"))[30], root_m=LEVEL.root_m)
    joints = np.stack([joints_at(MODEL, pose) for pose in poses])
    return alike(LEVEL, LEVEL, joints=joints, proposal=proposed(poses, [0.99, 0.01]))


# By term, two hypotheses, of which that term alone prefers the first.
SCENES = {
    "silhouette": lambda alike: alike(LEVEL, LEVEL, distance=np.array([0.02, 0.10])),
    "floor": lambda alike: alike(LEVEL, moved(LEVEL, 0, 0, 0.12)),
    "proposal": _as_proposed,
}


def test_every_term_has_a_scene():
    assert SCENES.keys() == FrameCosts(SETTINGS).terms.keys()


@pytest.mark.parametrize("name", SCENES)
def test_a_term_decides_where_nothing_else_does(name, alike):
    costs = FrameCosts(SETTINGS)
    given = SCENES[name](alike)
    of_term = costs.terms[name](given)
    assert of_term[1] > of_term[0] + 0.4
    whole = costs(given)
    del costs.terms[name]
    others = costs(given)
    assert others[0] == pytest.approx(others[1], abs=0.05)
    assert whole - others == pytest.approx(of_term, abs=1e-6)


def test_the_silhouette_costs_half_its_square(alike):
    given = alike(LEVEL, LEVEL, distance=np.array([SETTINGS.silhouette, 3 * SETTINGS.silhouette]))
    assert costs_of("silhouette", given) == pytest.approx([0.5, 4.5])


def test_who_sinks_pays_more_than_who_hovers_up_to_a_jump(alike):
    heights = 0.0, SETTINGS.hovering_m, -SETTINGS.sunk_m, 2 * SETTINGS.hovering_m, 1.0
    poses = [moved(LEVEL, 0, 0, height) for height in (*heights, 0.0, 0.0, 0.0, 0.0)]
    found = costs_of("floor", alike(*poses))[: len(heights)]
    assert found == pytest.approx([0, 0.5, 0.5, 2, 0.5 * SETTINGS.most_off_floor**2], abs=1e-3)


def test_the_floor_is_decided_over_time(alike):
    costs = FrameCosts(SETTINGS)
    high = moved(LEVEL, 0, 0, 0.4)
    assert not costs.stood_on
    assert costs_of("floor", alike(high), costs) == pytest.approx(0)  # is there a floor at all?
    assert not costs.stood_on
    low, up = alike(LEVEL), alike(high)
    for _ in range(2 * SETTINGS.floor_frames // 3):
        costs_of("floor", low, costs)
    assert costs.stood_on
    assert costs_of("floor", alike(high, LEVEL), costs)[0] > 2
    for _ in range(SETTINGS.floor_frames // 2 + 1):  # the first frames are forgotten by then
        costs_of("floor", up, costs)
    assert not costs.stood_on
    assert not costs_of("floor", alike(high, LEVEL), costs).any()
