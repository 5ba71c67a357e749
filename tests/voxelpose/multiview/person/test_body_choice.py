"""The body that a fit begins with, where nothing is told of the person."""

from contextlib import closing, contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import IS_CLOTHING, SHAPE_AXES, SHAPE_SIGMA, BodySizes
from silhouette_core.estimator import Settings
from silhouette_core.progress import SilentReporter, StageClock
from silhouette_core.refinement.adaptation import Stature, stature_of
from tests.voxelpose.multiview.matching_scenes import (
    STATURE_M,
    joint_errors_m,
    other_body,
    photograph,
    stance,
    views,
)
from voxelpose.multiview.carving.carver import CarveRule
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import HullObserver
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.person import body_choice
from voxelpose.multiview.person.body_choice import Start, adapted, anchor_frames, choose_body
from voxelpose.multiview.person.posterior import (
    Candidate,
    ShapePrior,
    StatureEvidence,
    hull_height_m,
)
from voxelpose.multiview.proposers.pose_search import BodyGeometry, PoseFit, find_pose
from voxelpose.multiview.silhouettes.mask_store import MaskStore
from voxelpose.multiview.silhouettes.observation_store import ObservationStore
from voxelpose.multiview.tracking.recording_track import refit
from voxelpose.multiview.tracking.tracking import PoseTracker

FPS = 30.0
VOLUME = VoxelGrid.from_bounds((-1.6, -1.2, -0.1), (1.6, 1.2, 2.1), 0.05)
CROUCH = {
    f"{side}_{name}": degrees
    for side in ("left", "right")
    for name, degrees in (("thigh.flexion", 80.0), ("shin.flexion", 95.0))
}


@contextmanager
def filmed(body, turns):
    """Observations of a body in some stances."""
    seen_by = views(4)
    observer = HullObserver(seen_by, VOLUME, 0.04, CarveRule(least_agreeing=3))
    with (
        closing(MaskStore([camera.size for camera in seen_by.rig], len(turns))) as masks,
        closing(ObservationStore(observer, masks)) as store,
    ):
        for t, one in enumerate(turns):
            masks.put(t, photograph(seen_by, body, stance(body, one)))
        yield store


@pytest.mark.slow
def test_somebody_who_crouches_most_of_the_time_is_no_child():
    body = other_body()
    turns = [CROUCH | {"lumbar.flexion": lean} for lean in (20.0, 40.0)]
    with filmed(body, [*turns, {}]) as store:
        heights = [hull_height_m(frame) for frame in anchor_frames(store).values()]
        assert np.median(heights) < 0.85 * max(heights)
        start = choose_body(store, Settings(sex="female"), MatchSettings(), SilentReporter(), FPS)
    assert stature_of(start.body.model) == pytest.approx(STATURE_M, rel=0.05)


@pytest.mark.slow
def test_somebody_who_sits_all_the_time_is_no_child():
    bent = ("thigh.flexion", "shin.flexion")
    seated = {f"{side}_{name}": 90.0 for side in ("left", "right") for name in bent}
    with filmed(other_body(), [seated | {"lumbar.flexion": 10.0 * t} for t in range(2)]) as store:
        start = choose_body(store, Settings(sex="female"), MatchSettings(), SilentReporter(), FPS)
    assert stature_of(start.body.model) == pytest.approx(STATURE_M, rel=0.05)


@pytest.mark.slow
def test_a_hull_of_an_unusual_height_is_compared_with_an_adult(monkeypatch):
    """A stature of 2.1 m that the hull suggested does not stay where an adult's fits better."""
    monkeypatch.setattr(
        StatureEvidence, "from_frames", lambda *_: StatureEvidence(None, (2.1, 2.1))
    )
    monkeypatch.setattr(body_choice, "_ROUNDS", 0)
    raised = {f"{side}_upper_arm.abduction": 130.0 for side in ("left", "right")}
    with filmed(other_body(), [raised | {"lumbar.flexion": 10.0 * t} for t in range(2)]) as store:
        start = choose_body(store, Settings(sex="female"), MatchSettings(), SilentReporter(), FPS)
    assert stature_of(start.body.model) == pytest.approx(STATURE_M, rel=0.05)


def test_bodies_are_compared_where_others_hide_least_of_them():
    there, hidden = np.ones(60, bool), np.zeros(60)
    there[:10] = False
    seen = SimpleNamespace(there=there, hidden=hidden, observe=lambda t: t if t != 45 else None)
    alone = [*anchor_frames(seen)]
    assert len(alone) >= 4 and np.ptp(np.diff(alone)) <= 1 and alone[0] > 10
    hidden[:] = 0.5
    hidden[[2, 12, alone[1] + 2, 58]] = 0.1  # 2: away; 12 and 58: where people come and go
    assert [*anchor_frames(seen)] == [alone[0], alone[1] + 2, *alone[2:]]
    there[:] = False
    assert anchor_frames(seen) == {}


def test_frames_that_do_not_tell_the_body_have_the_errors_of_the_adapted_one():
    tall = BodyModel.from_sizes(BodySizes(1.06 * STATURE_M, sex="female"))
    with filmed(other_body(), [{}, {"left_upper_arm.abduction": 30.0}]) as store:
        frames = anchor_frames(store)
        body = BodyGeometry.from_model(tall, 0.04, "cpu")
        prior = ShapePrior(Stature(STATURE_M, 0.1), tall.shape, np.diag(SHAPE_SIGMA**2))
        poses = {t: find_pose(body, frame)[0] for t, frame in frames.items()}
        clear, other = ({t: poses[t].pose} for t in sorted(poses))
        errors = {t: fit.error for t, fit in poses.items()}
        candidate = Candidate(STATURE_M, None, "female")
        start = Start(candidate, body, prior, StatureEvidence(None), clear, other, errors)
        found = adapted(start, frames)
    (t,) = other
    assert found.errors[t] < 0.9 * errors[t] and [*found.unclear] == [t]


def test_of_a_known_body_only_the_clothes_are_adapted():
    known = other_body()
    clothes = np.array(
        [{"shirt": 0.008, "trousers": 0.014}.get(axis.name, 0) for axis in SHAPE_AXES]
    )
    dressed = known.reshaped(np.where(IS_CLOTHING, clothes, known.shape))
    with filmed(dressed, [{"lumbar.flexion": 10.0 * t} for t in range(3)]) as store:
        at = store, Settings(), MatchSettings(), SilentReporter(), FPS, known
        start, kept = choose_body(*at), choose_body(*at, keep_clothes=True)
        settings = 30.0, MatchSettings()
        tracker = PoseTracker(kept.body, store, *settings, StageClock(), lambda: None)
        refit(tracker, kept)
    shape = start.body.model.shape
    np.testing.assert_allclose(shape[~IS_CLOTHING], known.shape[~IS_CLOTHING], atol=1e-3)
    np.testing.assert_allclose(shape[IS_CLOTHING], clothes[IS_CLOTHING], atol=0.004)
    assert tracker.body is kept.body
    np.testing.assert_array_equal(kept.body.model.shape, known.shape)


def test_the_body_is_adapted_to_the_poses_that_were_followed():
    """Tracking began with a usual body, whose joints are elsewhere."""
    bent = {"left_thigh.flexion": 40.0, "left_shin.flexion": 50.0}
    person, turns = other_body(1), [{}, bent, {"right_upper_arm.abduction": 45.0}]
    usual = BodyModel.from_sizes(BodySizes(STATURE_M, sex=person.sizes.sex))
    first, poses = BodyGeometry.from_model(usual, 0.04, "cpu"), [stance(person, t) for t in turns]
    prior = ShapePrior(Stature(STATURE_M, 0.02), usual.shape, np.diag(SHAPE_SIGMA**2))
    candidate = Candidate(STATURE_M, None, usual.sizes.sex)
    start = Start(candidate, first, prior, StatureEvidence(STATURE_M), {}, {}, {})
    errors_m = []
    with filmed(person, turns) as store:  # a second is between the stances
        tracker = PoseTracker(first, store, 1.0, MatchSettings(), StageClock(), lambda: None)
        tracker.follow((t, PoseFit(pose, 0.1)) for t, pose in enumerate(poses))
        for _ in range(2):
            tracker.smooth()
            pairs = zip(tracker.poses, poses, strict=True)
            errors_m.append(
                [
                    joint_errors_m(tracker.body.model, own, person, true)
                    for own, true in pairs
                    if own
                ]
            )
            refit(tracker, start)
    assert np.mean(errors_m[1]) < 0.8 * np.mean(errors_m[0])
