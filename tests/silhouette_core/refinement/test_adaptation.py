"""What pulls a body's proportions, and how far."""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.body.sizes import IS_CLOTHING, SHAPE_AXES, SHAPE_SIGMA
from silhouette_core.refinement import adaptation
from silhouette_core.refinement.adaptation import (
    Stature,
    adapt_shape,
    clothed_covariance,
    stature_of,
)
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.refine import RefineSettings, free_unknowns
from silhouette_core.refinement.surface import Surface
from tests.voxelpose.multiview.matching_scenes import (
    STATURE_M,
    fitting_model,
    joint_errors_m,
    observe,
    stance,
    views,
)

SURFACE = Surface(fitting_model(), 400)
USUAL = np.zeros(len(SHAPE_AXES))
BLIND = Observation.from_masks(views(2), [np.ones((320, 320), bool)] * 2)


def adapted(stature: Stature, surface: Surface = SURFACE, expected=USUAL) -> Surface:
    """The body where nothing is seen."""
    return adapt_shape(surface, [BLIND], [stance(SURFACE.model)], stature, expected)[0]


@pytest.mark.parametrize("metres", [STATURE_M - 0.06, STATURE_M + 0.06])
def test_a_known_stature_pulls_the_body_to_it(metres):
    assert stature_of(adapted(Stature(metres, 1e-4)).model) == pytest.approx(metres, abs=2e-3)


def test_a_stature_as_uncertain_as_the_proportions_is_met_half_way():
    changes = [
        stature_of(SURFACE.model.reshaped(0.1 * one)) - stature_of(SURFACE.model)
        for one in np.eye(len(SHAPE_AXES))
    ]
    sigma_m = float(np.linalg.norm(10 * np.array(changes) * SHAPE_SIGMA))
    start = stature_of(SURFACE.model)
    found = stature_of(adapted(Stature(start + 0.04, sigma_m)).model)
    assert found - start == pytest.approx(0.02, abs=2e-3)


@pytest.mark.parametrize(("start", "expected"), [(0.8, 0.0), (0.5, 0.5)])
def test_proportions_return_to_the_expected_ones_and_stay(start, expected):
    unusual, expected = SURFACE.reshaped(start * SHAPE_SIGMA), expected * SHAPE_SIGMA
    result = adapted(Stature(STATURE_M, 100.0), unusual, expected)
    np.testing.assert_allclose(result.model.shape, expected, atol=1e-4)


def test_no_proportion_is_farther_than_three_standard_deviations():
    found = adapted(Stature(2.5, 1e-5))
    assert (np.abs(found.model.shape) <= 3 * SHAPE_SIGMA + 1e-9).all()
    assert stature_of(found.model) > STATURE_M + 0.03


def test_long_legs_are_found_together_with_the_poses():
    """Two frames, four cameras: thighs and shins are 8 per cent longer, the poses a little off."""
    longer = [0.08 * (axis.name in ("thigh_length", "shin_length")) for axis in SHAPE_AXES]
    body = fitting_model().reshaped(np.array(longer))
    truth = [stance(body), stance(body, {"left_thigh.flexion": 40.0, "left_shin.flexion": 50.0})]
    rng = np.random.default_rng(0)
    starts = [
        pose.moved(np.r_[0.02 * rng.normal(size=6), 0.05 * rng.normal(size=len(pose.angles_rad))])
        for pose in truth
    ]
    seen = [observe(views(4), body, pose) for pose in truth]
    stature = Stature(stature_of(body), 0.006)
    found, poses = adapt_shape(SURFACE, seen, [pose.clipped() for pose in starts], stature, USUAL)
    assert knee_to_ankle(found) == pytest.approx(knee_to_ankle(Surface(body, 10)), rel=0.02)
    errors = [
        joint_errors_m(found.model, pose, body, true).mean()
        for pose, true in zip(poses, truth, strict=True)
    ]
    assert max(errors) < 0.01


def test_a_step_is_that_of_shape_and_poses_together(monkeypatch):
    """Eliminating the poses gives what the equations of all unknowns give at once."""
    shorter = replace(adaptation.REFINEMENT, body_reaches_m=(0.1,))
    monkeypatch.setattr(adaptation, "REFINEMENT", shorter)
    body = fitting_model().reshaped(np.where(IS_CLOTHING, 0.01, 0.04))
    poses = [stance(body), stance(body, {"left_thigh.flexion": 40.0, "left_shin.flexion": 50.0})]
    seen = [observe(views(4), body, pose) for pose in poses]
    count, free = len(SHAPE_AXES), free_unknowns(SURFACE.model)
    size = count + 2 * len(free)
    matrix, gradient = np.zeros((size, size)), np.zeros(size)
    for k, (observation, pose) in enumerate(zip(seen, poses, strict=True)):
        given = SURFACE, observation, pose, 0.1, RefineSettings((0.1,)), None
        one = adaptation._FrameSystem(*given)
        own = slice(count + k * len(free), count + (k + 1) * len(free))
        matrix[:count, :count] += one.shape
        matrix[own, own] = one.pose[np.ix_(free, free)] + 1e-6 * np.eye(len(free))
        matrix[own, :count], matrix[:count, own] = one.cross[free], one.cross[free].T
        gradient[:count] += one.shape_gradient
        gradient[own] = one.pose_gradient[free]
    counted = 1 / (1 + 7 * adaptation.REFINEMENT.alike)  # of eight silhouettes
    matrix, gradient = counted * matrix, counted * gradient
    matrix[:count, :count] += np.diag(1 / SHAPE_SIGMA**2)
    step = -np.linalg.solve(matrix, gradient)
    found, moved = adapt_shape(SURFACE, seen, poses, Stature(STATURE_M, 100.0), USUAL)
    np.testing.assert_allclose(found.model.shape, step[:count], atol=1e-4)
    for k, (pose, start) in enumerate(zip(moved, poses, strict=True)):
        expected = step[count:].reshape(2, -1)[k]
        apart = np.abs(pose.minus(start)[free] - expected)
        assert np.median(apart) < 1e-4 and np.quantile(apart, 0.9) < 0.01


def knee_to_ankle(surface: Surface) -> float:
    at = dict(zip(surface.model.names, surface.model.joints_m, strict=True))
    return float(np.linalg.norm(at["left_shin"] - at["left_foot"]))


def test_clothes_widen_all_girths_together():
    covariance = clothed_covariance()
    girth = np.array([axis.flesh and not axis.joints for axis in SHAPE_AXES]) & ~IS_CLOTHING
    together = covariance[np.ix_(girth, girth)]
    assert (together > 0).all()
    assert not covariance[np.ix_(girth, ~girth)].any()
    sigma = np.sqrt(np.diag(covariance))
    assert (sigma[girth] > SHAPE_SIGMA[girth]).all()
    assert (sigma[~girth] <= SHAPE_SIGMA[~girth]).all()
    assert np.linalg.eigvalsh(covariance).min() > 0
