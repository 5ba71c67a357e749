"""Refined poses per frame, and the past that leads to them."""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.sizes import SHAPE_SIGMA
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.tracking.beam import Beam, backtrack
from silhouette_core.monocular.tracking.hypothesis_tracker import HypothesisTracker, TrackerSettings
from silhouette_core.monocular.tracking.pose_costs import PoseCosts
from silhouette_core.monocular.tracking.pose_modes import FrameModes
from silhouette_core.monocular.tree.forward import ForwardFilter
from silhouette_core.motion.kinematics import forward, landmarks, quaternions
from silhouette_core.refinement.landmark_prior import LandmarkPrior
from silhouette_core.refinement.surface import Surface
from tests.silhouette_core.monocular.filming import body, camera_at, performed, poses_of, silhouette

CAMERA = camera_at((-0.8, -3.9, 1.3))
STEP_S = 0.1


@pytest.fixture(scope="module")
def followed(tree):
    """Somebody of another build swings both arms: tracks, states and the true joints of every
    frame.
    """
    other = body(0.7 * SHAPE_SIGMA * np.random.default_rng(4).standard_normal(len(SHAPE_SIGMA)))
    poses = poses_of(performed("arm swing both", other))[10:40:3]
    filter_, tracks = (
        ForwardFilter(tree, CAMERA),
        HypothesisTracker(tree, CAMERA, TrackerSettings()),
    )
    states: list[Beam] = []
    for k, pose in enumerate(poses):
        filter_frame = filter_.step(k, STEP_S * k, Person(silhouette(other, pose, CAMERA), False))
        states.append(tracks.step(filter_frame, *([None, None, *states][:-3:-1])))
    truth = landmarks(
        other,
        *forward(
            other,
            *(
                np.stack([f(pose) for pose in poses])
                for f in (root, turn, lambda pose: pose.angles_rad)
            ),
        ),
    )
    return tracks, states, truth


def root(pose):
    return pose.root_m


def turn(pose):
    return quaternions(pose.root_rotation[None])[0]


def test_the_course_follows_the_motion(followed):
    _, states, truth = followed
    result = np.stack([frame.joints[k] for frame, k in zip(states, backtrack(states), strict=True)])
    apart = np.linalg.norm((result - result[:, :1]) - (truth - truth[:, :1]), axis=-1)
    assert 1000 * apart.mean() < 90
    assert np.linalg.norm(result[:, 0] - truth[:, 0], axis=-1).mean() < 0.25


def test_costs_are_counted_from_the_best_and_pasts_exist(followed):
    tracks, states, _ = followed
    for before, frame in zip([None, *states], states, strict=False):
        assert 1 <= len(frame.poses) <= tracks.settings.kept == TrackerSettings().kept
        assert frame.cost.min() == 0 and (np.diff(frame.cost) >= 0).all()
        assert (
            (frame.back == -1).all()
            if before is None
            else ((frame.back >= 0) & (frame.back < len(before.poses))).all()
        )
        low, high = tracks.model.dof_limits_rad.T
        assert all(
            ((pose.angles_rad >= low - 1e-6) & (pose.angles_rad <= high + 1e-6)).all()
            for pose in frame.poses
        )


def test_kept_poses_differ(followed):
    _, states, _ = followed
    for frame in states:
        apart = np.linalg.norm(frame.joints[:, None] - frame.joints[None], axis=-1).mean(-1)
        assert (apart[~np.eye(len(apart), dtype=bool)] > 0.01).all()
    assert max(len(frame.poses) for frame in states) > 3


def test_a_course_may_end_elsewhere_than_at_the_best(followed):
    _, states, _ = followed
    worst = len(states[-1].poses) - 1
    trajectory = backtrack(states, worst)
    assert trajectory[-1] == worst
    for k in range(len(states) - 1, 0, -1):
        assert states[k].back[trajectory[k]] == trajectory[k - 1]


def test_unrefined_poses_are_the_librarys(tree, library):
    pose = poses_of(performed("walk"))[12]
    filter_frame = ForwardFilter(tree, CAMERA).step(
        0, 0.0, Person(silhouette(body(), pose, CAMERA), False)
    )
    states = HypothesisTracker(tree, CAMERA, TrackerSettings(refine=False)).step(
        filter_frame, None, None
    )
    for own in states.poses:
        assert np.abs(library.base_angles - own.angles_rad).max(1).min() < 1e-6


def test_a_course_across_a_new_beginning_keeps_the_best_of_what_was_before(followed):
    _, states, _ = followed
    anew = replace(states[4], back=np.full(len(states[4].poses), -1))
    course = backtrack([*states[:4], anew])
    assert course[3] == states[3].best == 0
    assert course[:4] == backtrack(states[:4])


def test_a_chosen_past_needs_no_other_hypotheses(tree, followed):
    """At the end of a block each frame keeps one hypothesis, whichever of several it came from."""
    _, states, _ = followed
    before, last = states[3].only(0), replace(states[4], back=np.full(len(states[4].poses), 2))
    kept = last.only(len(last.poses) - 1)
    assert kept.back.tolist() == [0] and len(kept.poses) == 1
    person = Person(silhouette(body(), poses_of(performed("walk"))[12], CAMERA), False)
    frame = replace(ForwardFilter(tree, CAMERA).step(0, 0.0, person), time_s=5 * STEP_S)
    found = HypothesisTracker(tree, CAMERA, TrackerSettings(refine=False)).step(frame, kept, before)
    assert (found.back == 0).all()


def test_frames_at_half_the_rate_count_double(tree):
    pose = poses_of(performed("walk"))[12]
    person = Person(silhouette(body(), pose, CAMERA), False)

    def own(interval_s):
        tracker = HypothesisTracker(tree, CAMERA, TrackerSettings(refine=False))
        first = ForwardFilter(tree, CAMERA).step(0, 0.0, person)
        before = tracker.step(first, None, None)
        after = tracker.step(replace(first, time_s=interval_s), before, None)
        rows = [
            int(np.abs(after.joints - joints).mean((1, 2)).argmin()) for joints in before.joints
        ]
        return after.own[rows]

    assert own(2 / 30) == pytest.approx(2 * own(1 / 30), rel=0.02)


def test_what_the_source_hides_moves_farther(tree, followed):
    """DM2 reaches the estimate: (5) widens the step of occluded parts."""
    _, states, _ = followed
    tracker = HypothesisTracker(tree, CAMERA, TrackerSettings())
    seen = states[3].only(0)
    hidden = replace(seen, occluded=seen.occluded.copy())
    arm = [tracker.model.names.index(f"left_{part}") for part in ("upper_arm", "forearm")]
    seen.occluded[:], hidden.occluded[:] = False, False
    hidden.occluded[0, arm] = True
    angles = seen.poses[0].angles_rad.copy()
    angles[np.isin(tracker.model.dof_part, arm)] += 0.8
    moved = [replace(seen.poses[0], angles_rad=angles)]

    def costs(poses):
        times = seen.time_s + 1 / 30, 15.0
        return [
            tracker.moving(beam, beam.poses, poses, beam.joints, *times)[0][0, 0]
            for beam in (seen, hidden)
        ]

    there = costs(moved)
    assert there[1] < 0.8 * there[0]
    # It is not cheaper to be hidden as such.
    still = costs(seen.poses)
    assert still[1] > still[0]


def test_who_stands_still_does_not_turn_round_for_a_while(tree, monkeypatch):
    """Beside a proposal that finds the back likelier for twenty of thirty frames."""
    pose = poses_of(performed("walk"))[0]
    person = Person(silhouette(body(), pose, CAMERA), False)
    frame = ForwardFilter(tree, CAMERA).step(0, 0.0, person)
    placed = forward(body(), pose.root_m[None], turn(pose)[None], pose.angles_rad[None])
    joints = landmarks(body(), *placed)[0] - pose.root_m
    precision = np.tile(np.eye(3) / 0.03**2, (15, 1, 1))
    ways = [
        LandmarkPrior(joints * [sign, sign, 1.0], precision, pose.root_m, np.eye(3) / 0.1**2)
        for sign in (1.0, -1.0)
    ]

    usual = TrackerSettings().with_modes()

    def turned(restart):
        settings = replace(usual, restart=restart)
        monkeypatch.setattr(TrackerSettings, "with_modes", lambda _: settings)
        tracker = HypothesisTracker(tree, CAMERA, settings)
        beams: list[Beam] = []
        for t in range(30):
            back = 0.99 if 5 <= t < 25 else 0.01
            modes = FrameModes(np.array([1 - back, back]), ways, 4.0)
            now = replace(frame, time_s=t / 30)
            beams.append(tracker.step(now, *([None, None, *beams][:-3:-1]), modes))
        chosen = [beam.joints[k] for beam, k in zip(beams, backtrack(beams), strict=True)]
        left = np.array([own[LANDMARK_NAMES.index("left_hip")] - own[0] for own in chosen])
        return (left @ joints[LANDMARK_NAMES.index("left_hip")] < 0).mean()

    assert turned(15.0) > 0.5
    assert turned(usual.restart) == 0


def test_kept_hypotheses_know_what_they_hide(followed):
    """In profile one arm or leg is behind the body in some frame."""
    _, states, _ = followed
    assert any(frame.occluded.any() for frame in states)
    assert all(frame.occluded.shape == (len(frame.poses), 27) for frame in states)


def test_probabilities_follow_the_costs(followed):
    _, states, _ = followed
    probability, joints = states[-1].probabilities()
    assert probability.sum() == pytest.approx(1) and (np.diff(probability) <= 0).all()
    assert joints[0] == pytest.approx(states[-1].joints[states[-1].best])


def test_the_floor_is_decided_over_time(library):
    costs, surface = PoseCosts(library), Surface(body(), 200)
    standing = poses_of(performed("walk"))[12]
    jumping = standing.moved(np.r_[0, 0, 0.4, np.zeros(57)])
    assert costs.off_floor([jumping], surface) == pytest.approx(0)  # is there a floor at all?
    for _ in range(3):
        costs.off_floor([standing], surface)
    assert costs.on_floor
    assert costs.off_floor([jumping], surface)[0] > costs.off_floor([standing], surface)[0] + 2


def test_the_floor_is_a_cost_of_every_frame(tree, monkeypatch):
    """Of poses that fit alike, the one on the floor is cheaper: here only one of them is."""
    pose = poses_of(performed("walk"))[12]
    person = Person(silhouette(body(), pose, CAMERA), False)
    frame = ForwardFilter(tree, CAMERA).step(0, 0.0, person)

    def first(row):
        tracker = HypothesisTracker(tree, CAMERA, TrackerSettings(refine=False))
        off = lambda poses, _: np.where(np.arange(len(poses)) == row, 0.0, 1000.0)  # noqa: E731
        if row is not None:
            monkeypatch.setattr(tracker.costs, "off_floor", off)
        return tracker.step(frame, None, None)

    usual, second, third = first(None), first(1), first(2)
    assert len(usual.poses) > 2
    # Costs are counted from the best one's: it stands out by what the others pay.
    for beam in (second, third):
        assert beam.cost[0] == 0 and beam.cost[1] > 900
    assert np.abs(second.joints[0] - third.joints[0]).max() > 0.01
