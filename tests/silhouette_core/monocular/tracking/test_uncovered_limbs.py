"""Limbs put where a pose leaves the silhouette uncovered."""

import numpy as np
import pytest

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.monocular.occlusion import standing_areas
from silhouette_core.monocular.tracking import hypothesis_tracker
from silhouette_core.monocular.tracking.frame_costs import CostSettings
from silhouette_core.monocular.tracking.hypothesis_tracker import HypothesisTracker, TrackerSettings
from silhouette_core.monocular.tracking.uncovered_limbs import reach_uncovered, uncovered_ends
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.cpu import CpuBackend
from tests.silhouette_core.monocular.filming import (
    body,
    camera_at,
    joints_of,
    observed_by,
    performed,
    poses_of,
    prior_of,
    proposed,
)

CAMERA = camera_at((0.5, -4.0, 1.4))
MODEL = body()
WRIST = LANDMARK_NAMES.index("right_wrist")
PX_PER_M = 50.0


@pytest.fixture(scope="module")
def raised():
    """Somebody waves with the right arm."""
    poses = poses_of(performed("wave"))
    height = [joints_of(MODEL, pose)[WRIST, 2] for pose in poses]
    return poses[int(np.argmax(height))]


@pytest.fixture(scope="module")
def hanging(raised):
    """The same with that arm hanging down."""
    arm = [name.startswith(("right_upper_arm", "right_forearm")) for name in MODEL.tree.dof_names]
    angles = raised.angles_rad.copy()
    angles[arm] = poses_of(performed("wave"))[0].angles_rad[arm]
    return Pose(raised.root_m, raised.root_rotation, angles)


@pytest.fixture(scope="module")
def observed(raised):
    return observed_by(CAMERA, raised)


def reached(observed, pose):
    return reach_uncovered(Surface(MODEL), observed, [pose], [prior_of(pose)])


@pytest.fixture(scope="module")
def trunk():
    covered = np.zeros((120, 160), bool)
    covered[20:100, 70:90] = True
    return covered


def test_ends_lie_a_hand_inside_what_stands_out(trunk):
    mask = trunk.copy()
    mask[30:34, 90:130], mask[90:94, 50:70] = True, True  # an arm of 0.8 m and a leg of 0.4 m
    arm, leg = uncovered_ends(mask, trunk, PX_PER_M)
    assert arm == pytest.approx([129 - 0.1 * PX_PER_M, 31.5], abs=2)
    assert leg == pytest.approx([50 + 0.1 * PX_PER_M, 91.5], abs=2)


def test_loose_clothes_are_no_limbs(trunk):
    mask = trunk.copy()
    mask[20:100, 67:93] = True  # 6 cm on either side
    assert uncovered_ends(mask, trunk, PX_PER_M) == []


def test_an_uncovered_arm_is_reached(observed, raised, hanging):
    poses, priors = reached(observed, hanging)
    assert len(poses) == len(priors) > 1
    before = observed.weights.distances(MODEL, [hanging])[0]
    distance = observed.weights.distances(MODEL, poses)
    assert distance.min() < 0.4 * before
    best = joints_of(MODEL, poses[int(distance.argmin())])
    truth = joints_of(MODEL, raised)
    pixels = [CAMERA.project(joints[None, WRIST])[0] for joints in (best, truth)]
    focal = CAMERA.matrix[0, 0] / np.linalg.norm(truth[WRIST] - CAMERA.center_m)
    assert np.linalg.norm(pixels[0] - pixels[1]) / focal < 0.08
    assert np.linalg.norm(best - truth, axis=1).mean() < 0.06


def test_before_and_behind_are_both_tried(observed, hanging):
    _, priors = reached(observed, hanging)
    depth = [prior.landmarks_m[WRIST] @ CAMERA.rotation[2] for prior in priors]
    assert max(depth) - min(depth) > 0.2


def test_a_covered_silhouette_asks_for_nothing(observed, raised):
    assert reached(observed, raised) == ([], [])
    assert reach_uncovered(Surface(MODEL), observed, [], []) == ([], [])


def tracker_of(settings):
    return HypothesisTracker(MODEL, CAMERA, standing_areas(MODEL), settings, CpuBackend())


def test_the_tracker_covers_what_the_proposal_missed(observed, hanging, monkeypatch):
    """All that is proposed has the arm down: only with limbs put elsewhere is it found raised."""
    modes = proposed([hanging], [1.0])

    def distance():
        beam = tracker_of(TrackerSettings()).step(observed, modes, (None, None))
        return beam.distance[beam.best]

    found = distance()
    monkeypatch.setattr(hypothesis_tracker, "reach_uncovered", lambda *_: ([], []))
    assert found < 0.5 * distance()


def test_what_stands_out_is_measured(observed, raised, hanging):
    """The raised arm stands out of a body whose arm hangs; more than asked is not told."""
    weights = observed.weights

    def uncovered(poses, most_m):
        return weights.uncovered(poses, weights.part_images(MODEL, poses), most_m)

    covered, out = uncovered([raised, hanging], 1.0)
    assert covered < 0.03 and 0.25 < out < 0.8
    away = Pose(raised.root_m + np.array([5.0, 0, 0]), raised.root_rotation, raised.angles_rad)
    assert uncovered([hanging, away], 0.2) == pytest.approx([0.2, 0.2])


@pytest.mark.parametrize("most_m", [CostSettings().most_uncovered_m, 0.0])
def test_an_uncovered_hand_outweighs_what_is_proposed(
    most_m, observed, raised, hanging, monkeypatch
):
    """Both arms are proposed, the hanging one as more probable: what stands out decides."""
    poses = [hanging, raised]
    found = poses, [prior_of(pose) for pose in poses]
    monkeypatch.setattr(HypothesisTracker, "_found", lambda *_: found)
    costs = CostSettings(silhouette=1.0, most_uncovered_m=most_m)
    tracker = tracker_of(TrackerSettings(costs, reaching=0))
    beam = tracker.step(observed, proposed(poses, [0.99, 0.01]), (None, None))
    likeliest = raised if most_m else hanging
    expected = joints_of(MODEL, likeliest)[WRIST]
    assert beam.joints[beam.best, WRIST] == pytest.approx(expected, abs=1e-6)
