"""Refined poses per frame, and the past that leads to them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.sizes import SHAPE_SIGMA
from silhouette_core.monocular.occlusion import standing_areas
from silhouette_core.monocular.tracking.hypothesis_tracker import HypothesisTracker, TrackerSettings
from silhouette_core.motion.pose import Pose
from silhouette_core.scoring.cpu import CpuBackend
from silhouette_core.tracking.beam import Beam, backtrack
from tests.silhouette_core.monocular.filming import (
    body,
    camera_at,
    joints_at,
    performed,
    poses_of,
    proposed,
    silhouette,
)

CAMERA = camera_at((-0.8, -3.9, 1.3))
STEP_S = 0.1
AREAS = standing_areas(body())


def tracker_of(settings: TrackerSettings | None = None) -> HypothesisTracker:
    return HypothesisTracker(body(), CAMERA, AREAS, settings or TrackerSettings(), CpuBackend())


def turned(pose: Pose, degrees: float) -> Pose:
    turn = Rotation.from_euler("z", degrees, degrees=True).as_matrix()
    return Pose(pose.root_m, turn @ pose.root_rotation, pose.angles_rad)


def seen(tracker: HypothesisTracker, pose: Pose, time_s: float, model=None):
    mask = silhouette(model or body(), pose, CAMERA)
    return tracker.observe(mask, 4.0, time_s)


def last_two(beams: list[Beam]) -> tuple[Beam | None, Beam | None]:
    return beams[-1] if beams else None, beams[-2] if len(beams) > 1 else None


@pytest.fixture(scope="module")
def followed():
    """Somebody of another build swings both arms: tracker, states and the true joints of every
    frame. Proposed are the usual body's pose a tenth of a second later, and as likely that pose
    turned about, and the same with arms that hang.
    """
    other = body(0.7 * SHAPE_SIGMA * np.random.default_rng(4).standard_normal(len(SHAPE_SIGMA)))
    own, poses = (poses_of(performed("arm swing both", model)) for model in (body(), other))
    tracker, states, truth = tracker_of(), list[Beam](), []
    arms = ["upper_arm" in name or "forearm" in name for name in body().tree.dof_names]
    for k, row in enumerate(range(10, 40, 3)):
        near = own[row + 3]
        hanging = replace(near, angles_rad=np.where(arms, own[0].angles_rad, near.angles_rad))
        modes = proposed([near, turned(near, 180), turned(near, 40), hanging], [0.25] * 4)
        observed = seen(tracker, poses[row], STEP_S * k, other)
        states.append(tracker.step(observed, modes, last_two(states)))
        truth.append(joints_at(other, poses[row]))
    return tracker, states, np.stack(truth)


@pytest.fixture(scope="module")
def walker():
    """A walking pose, what is proposed of it, and a tracker's hypotheses."""
    pose = poses_of(performed("walk"))[12]
    return pose, proposed([pose, turned(pose, 180), turned(pose, 60)], [0.4, 0.3, 0.3])


def test_the_trajectory_follows_the_motion(followed):
    _, states, truth = followed
    result = np.stack([frame.joints[k] for frame, k in zip(states, backtrack(states), strict=True)])
    apart = np.linalg.norm((result - result[:, :1]) - (truth - truth[:, :1]), axis=-1)
    assert 1000 * apart.mean() < 90
    assert np.linalg.norm(result[:, 0] - truth[:, 0], axis=-1).mean() < 0.25


def test_costs_are_counted_from_the_best_and_pasts_exist(followed):
    tracks, states, _ = followed
    for before, frame in zip([None, *states], states, strict=False):
        assert 1 <= len(frame.poses) <= tracks.settings.most == TrackerSettings().most
        assert frame.cost.min() == 0 and (np.diff(frame.cost) >= 0).all()
        assert (
            (frame.back == -1).all()
            if before is None
            else ((frame.back >= 0) & (frame.back < len(before.poses))).all()
        )
        low, high = tracks.model.tree.dof_limits_rad.T
        assert all(
            ((pose.angles_rad >= low - 1e-6) & (pose.angles_rad <= high + 1e-6)).all()
            for pose in frame.poses
        )


def test_kept_poses_differ(followed):
    _, states, _ = followed
    for frame in states:
        apart = np.linalg.norm(frame.joints[:, None] - frame.joints[None], axis=-1).mean(-1)
        assert (apart[~np.eye(len(apart), dtype=bool)] > 0.03).all()
    assert max(len(frame.poses) for frame in states) > 3


def test_a_trajectory_ends_at_the_cheapest(followed):
    _, states, _ = followed
    worst = len(states[-1].poses) - 1
    dear = np.arange(worst + 1) < worst
    trajectory = backtrack([*states[:-1], replace(states[-1], cost=dear.astype(float))])
    assert trajectory[-1] == worst
    for k in range(len(states) - 1, 0, -1):
        assert states[k].back[trajectory[k]] == trajectory[k - 1]


def test_a_trajectory_across_a_new_beginning_keeps_the_best_of_what_was_before(followed):
    _, states, _ = followed
    anew = replace(states[4], back=np.full(len(states[4].poses), -1))
    trajectory = backtrack([*states[:4], anew])
    assert trajectory[3] == states[3].best == 0
    assert trajectory[:4] == backtrack(states[:4])


def test_a_chosen_past_needs_no_other_hypotheses(followed, walker):
    """At the end of a block each frame keeps one hypothesis, whichever of several it came from."""
    _, states, _ = followed
    before, last = states[3].only(0), replace(states[4], back=np.full(len(states[4].poses), 2))
    kept = last.only(len(last.poses) - 1)
    assert kept.back.tolist() == [0] and len(kept.poses) == 1
    tracker = tracker_of()
    found = tracker.step(seen(tracker, walker[0], 5 * STEP_S), walker[1], (kept, before))
    assert (found.back == 0).all()


def test_frames_at_half_the_rate_count_double(walker):
    pose, modes = walker
    tracker = tracker_of()
    first = seen(tracker, pose, 0.0)
    before = tracker.step(first, modes, (None, None))

    def own(interval_s):
        later = replace(first, time_s=interval_s)
        return tracker.step(later, modes, (before, None), before, searched=False).alone

    assert own(2 / 30) == pytest.approx(2 * own(1 / 30), rel=0.02)


def test_known_hypotheses_are_added_or_are_all(walker):
    pose, modes = walker
    tracker = tracker_of()
    first = seen(tracker, pose, 0.0)
    beam = tracker.step(first, modes, (None, None))
    again = tracker.step(first, modes, (None, None), beam, searched=False)
    assert again.distance == pytest.approx(beam.distance)
    assert again.priors == beam.priors
    other = tracker.step(first, proposed([turned(pose, 90)], [1.0]), (None, None), beam)
    gaps = np.abs(other.joints[:, None] - beam.joints).max(axis=(2, 3)).min(axis=1)
    assert (gaps < 1e-9).any() and (gaps > 0.01).any()


def test_what_the_source_hides_moves_farther(followed):
    """DM2 reaches the estimate: (5) widens the step of occluded parts."""
    tracker, states, _ = followed
    source = states[3].only(0)
    hidden = replace(source, occluded=source.occluded.copy())
    arm = [tracker.model.names.index(f"left_{part}") for part in ("upper_arm", "forearm")]
    source.occluded[:], hidden.occluded[:] = False, False
    hidden.occluded[0, arm] = True
    angles = source.poses[0].angles_rad.copy()
    angles[np.isin(tracker.model.tree.dof_part, arm)] += 0.8
    moved = [replace(source.poses[0], angles_rad=angles)]

    def costs(poses):
        later = replace(source, poses=poses, time_s=source.time_s + 1 / 30)
        return [
            tracker.step_costs.between(beam, beam.poses, later)[0][0, 0]
            for beam in (source, hidden)
        ]

    there = costs(moved)
    assert there[1] < 0.8 * there[0]
    # It is not cheaper to be hidden as such.
    still = costs(source.poses)
    assert still[1] > still[0]


def test_a_restart_remains_dearer_at_a_lower_rate(followed):
    tracker, states, _ = followed
    source = states[3].only(0)
    far = [turned(replace(source.poses[0], root_m=source.poses[0].root_m + 9), 180)]
    for interval_s, factor in ((1 / 60, 1), (1 / 30, 1), (1 / 10, 3)):
        later = replace(source, poses=far, time_s=source.time_s + interval_s)
        cost, restarted = tracker.step_costs.between(source, source.poses, later)
        assert restarted.all()
        assert cost[0, 0] == pytest.approx(factor * TrackerSettings().restart, abs=3)


def test_who_stands_still_does_not_turn_round_for_a_while():
    """Though for fifteen of thirty frames the back is proposed as likelier."""
    pose = poses_of(performed("walk"))[0]
    back = turned(pose, 180)
    hip = LANDMARK_NAMES.index("left_hip")
    facing = (joints_at(body(), pose)[hip] - pose.root_m)[:2]

    def turns(restart):
        tracker = tracker_of(replace(TrackerSettings(), restart=restart))
        frame = seen(tracker, pose, 0.0)
        beams: list[Beam] = []
        for t in range(30):
            behind = 0.999 if 5 <= t < 20 else 0.001
            modes = proposed([pose, back], [1 - behind, behind], sigma_m=0.03)
            now = replace(frame, time_s=t / 30)
            beams.append(tracker.step(now, modes, last_two(beams)))
        chosen = [beam.joints[k] for beam, k in zip(beams, backtrack(beams), strict=True)]
        left = np.array([own[hip] - own[0] for own in chosen])[:, :2]
        return (left @ facing < 0).mean()

    assert turns(15.0) > 0.4
    assert turns(TrackerSettings().restart) == 0


def test_kept_hypotheses_know_what_they_hide(followed):
    """In profile one arm or leg is behind the body in some frame."""
    _, states, _ = followed
    assert any(frame.occluded.any() for frame in states)
    assert all(frame.occluded.shape == (len(frame.poses), 27) for frame in states)


def test_probabilities_follow_the_costs(followed):
    _, states, _ = followed
    probability, poses = states[-1].probabilities(TrackerSettings().temperature)
    assert probability.sum() == pytest.approx(1) and (np.diff(probability) <= 0).all()
    assert poses[0] is states[-1].poses[states[-1].best]


def test_the_terms_are_costs_of_every_frame(walker):
    """Of poses that are found, one that a term alone prefers is the cheapest."""
    pose, modes = walker

    def first(row):
        tracker = tracker_of()
        if row is not None:
            tracker.costs.terms["floor"] = lambda given: np.where(
                np.arange(len(given.poses)) == row, 0.0, 1000.0
            )
        return tracker.step(seen(tracker, pose, 0.0), modes, (None, None))

    usual, second, third = first(None), first(1), first(2)
    assert len(usual.poses) > 2
    # Costs are counted from the best one's: it stands out by what the others pay.
    for beam in (second, third):
        assert beam.cost[0] == 0 and beam.cost[1] > 900
    assert np.abs(second.joints[0] - third.joints[0]).max() > 0.01
