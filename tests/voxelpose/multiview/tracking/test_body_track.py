"""A body and its latest poses, from frame to frame; rules stand for the refinement."""

from types import SimpleNamespace

import numpy as np
import pytest

from silhouette_core.body.joints import HUMAN
from silhouette_core.motion.dynamics import FPS, MOMENTUM, pose_step_sigma
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.surface import Surface
from silhouette_core.tuning import REFINEMENT
from tests.voxelpose.multiview.matching_scenes import fitting_model, photograph, stance, views
from voxelpose.multiview.proposers.pose_search import PoseFit
from voxelpose.multiview.tracking import body_track
from voxelpose.multiview.tracking.body_track import BodyTrack, Moment, observed_near
from voxelpose.multiview.tuning import TRACKING

BODY = SimpleNamespace(model=fitting_model(), surface=Surface(fitting_model(), 200))


def at(x_m: float) -> Pose:
    return stance(BODY.model, place_m=(x_m, 0.0))


def track_at(x_m: float, errors: tuple[float, ...] = (0.1,)) -> BodyTrack:
    """Stood at 0 a frame before."""
    return BodyTrack(BODY, 1 / FPS, PoseFit(at(x_m), errors[-1]), (0.0, at(0.0)), errors)  # type: ignore[arg-type]


@pytest.fixture
def refined(monkeypatch):
    """Errors that refinements find, one after the other; the pose is that where they start.

    Returns lists of these errors, of the priors, and of the largest reaches.
    """
    errors, priors, reaches = [], [], []

    def refine_fit(body, observation, start, prior, settings):
        priors.append(prior)
        reaches.append(settings.reaches_m[0])
        return PoseFit(start, errors[len(priors) - 1])

    monkeypatch.setattr(body_track, "refine_fit", refine_fit)
    return errors, priors, reaches


def step(track: BodyTrack, frames: float) -> BodyTrack:
    """The track after some times 1 / FPS."""
    return track.step(None, track.time_s + frames / FPS)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("frames", "steps", "sigmas"), [(2, 2, 2), (20, 3, TRACKING.longest_steps)]
)
def test_as_many_steps_are_expected_as_frames_passed_but_three_at_most(frames, steps, sigmas):
    expected = track_at(0.1).predict((1 + frames) / FPS)
    assert expected.pose.root_m[0] == pytest.approx(0.1 + steps * MOMENTUM * 0.1)
    np.testing.assert_allclose(expected.sigma, sigmas * pose_step_sigma(HUMAN))


def test_backward_in_time_the_last_step_is_expected_again():
    track = BodyTrack(BODY, -1 / FPS, PoseFit(at(0.1), 0.1), (0.0, at(0.0)), (0.1,))  # type: ignore[arg-type]
    expected = track.predict(-2 / FPS)
    assert expected.pose.root_m[0] == pytest.approx(0.1 + MOMENTUM * 0.1)
    np.testing.assert_allclose(expected.sigma, pose_step_sigma(HUMAN))


def test_a_frame_that_fits_badly_is_refined_again_from_the_last_pose(refined):
    errors, priors, _ = refined
    errors += [0.3, 0.2]
    found = step(track_at(0.1), 1)
    assert (found.fit.error, found.fit.pose.root_m[0]) == (0.2, pytest.approx(0.1))
    assert priors[1].pose.root_m[0] == pytest.approx(0.1)
    errors[:] = [0.3, 0.4]
    priors.clear()
    assert step(track_at(0.1), 1).fit.error == 0.3


def test_a_longer_time_between_frames_is_given_longer_steps_and_reaches(refined):
    errors, priors, reaches = refined
    errors += [0.1, 0.1]
    for frames in (1, 4):
        step(track_at(0.1), frames)
    np.testing.assert_allclose(priors[0].sigma, pose_step_sigma(HUMAN))
    np.testing.assert_allclose(priors[1].sigma, 4 * pose_step_sigma(HUMAN))
    assert reaches == pytest.approx([REFINEMENT.predicted_m, REFINEMENT.searched_m])


def test_without_a_velocity_a_step_reaches_as_far_as_after_a_search(refined):
    errors, _, reaches = refined
    errors += [0.1]
    step(BodyTrack(BODY, 0.0, PoseFit(at(0.0), 0.1), None, (0.1,)), 1)  # type: ignore[arg-type]
    assert reaches == pytest.approx([REFINEMENT.searched_m])


@pytest.mark.parametrize(("found", "better"), [(0.2, False), (0.1, False), (0.05, True)])
def test_searched_limbs_have_to_explain_more(monkeypatch, found, better):
    moved = PoseFit(at(0.5), found)
    monkeypatch.setattr(body_track, "move_limbs", lambda *given: moved)
    track = track_at(0.1, (0.2, 0.1))
    result = track.with_limbs(None)  # type: ignore[arg-type]
    assert (result.fit is moved) == better
    assert result.errors == (0.2, found if better else 0.1)


def test_the_usual_error_is_the_median_of_the_last_twelve(refined):
    errors, _, _ = refined
    errors += [0.11]
    found = step(track_at(0.1, (0.5,) * 10 + (0.1,) * 6), 1)
    assert len(found.errors) == 12
    assert found.errors[-1] == 0.11
    assert found.usual == pytest.approx(0.105, abs=0.006)


def test_silhouettes_far_from_the_body_do_not_count():
    """Somebody else stands 1.2 m beside the body."""
    views_of_both = views(2)
    own, other = (photograph(views_of_both, BODY.model, at(x_m)) for x_m in (0.0, 1.2))
    names = views_of_both.rig.names
    both = {name: a | b for name, a, b in zip(names, own, other, strict=True)}
    seen = observed_near(BODY, views_of_both.rig, Moment.of(0.0, both), at(0.0))  # type: ignore[arg-type]
    for mask, body, beside in zip(seen.masks, own, other, strict=True):
        assert (mask & body).sum() == body.sum()
        assert (mask & beside & ~body).sum() < 0.2 * (beside & ~body).sum()
