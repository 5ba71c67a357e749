"""What residuals and priors weigh, and where they pull a pose."""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.motion.dynamics import RELAXED_RAD, usual_rad
from silhouette_core.motion.pose import PoseArrays
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.refine import (
    PosePrior,
    RefineSettings,
    RefineStart,
    Residuals,
    add_silhouettes,
    contour_weights,
    free_unknowns,
    refine,
    refine_many,
    residuals,
    solve_steps,
)
from silhouette_core.refinement.surface import Surface
from tests.voxelpose.multiview.matching_scenes import (
    fitting_model,
    observe,
    other_body,
    photograph,
    stance,
    views,
)

SURFACE = Surface(fitting_model(), 600)
MODEL = SURFACE.model
SIZE = 6 + MODEL.dof_count
SETTINGS = RefineSettings()
LARGEST = SETTINGS.independence / SETTINGS.contour_m**2
FLEXION = 6 + MODEL.tree.dof_names.index("left_forearm.flexion")


@pytest.fixture(scope="module")
def seen() -> Observation:
    """Somebody with a raised arm, where the body of these tests lets it hang."""
    body = other_body(1)
    return observe(views(4), body, stance(body, {"left_upper_arm.abduction": 20.0}))


def contour_points(rows: Residuals, seen: Observation) -> int:
    """Number of residuals of contour points, which come first."""
    return int((rows.direction[:, None] == seen.normal).all(-1).any(1).sum())


def step(index: int, size: float) -> np.ndarray:
    return size * np.eye(SIZE)[index]


@pytest.mark.parametrize("reach", [0.15, 0.3])
def test_a_residual_weighs_less_the_larger_it_is(seen, reach):
    posed = SURFACE.posed(stance(MODEL))
    rows = residuals(SURFACE, posed, seen, reach, SETTINGS)
    points = contour_points(rows, seen)
    contour, outside = (
        (np.abs(rows.gap_m[part]), rows.weight[part] / LARGEST)
        for part in (slice(points), slice(points, None))
    )
    near, far = contour[0] < 0.005, contour[0] > 0.5 * reach
    assert near.sum() > 50 and contour[1][near].min() > 0.95
    assert far.sum() > 3 and contour[1][far].max() < 0.25
    # Outside: half of a contour point's, and a quarter of that at 15 cm.
    assert (outside[0] > 0.1).sum() > 10
    np.testing.assert_allclose(outside[1], 0.5 / (1 + (outside[0] / 0.15) ** 2) ** 2, rtol=1e-6)


def test_the_normal_equations_are_those_of_the_residuals(seen):
    pose = stance(MODEL)
    posed = SURFACE.posed_many(PoseArrays.from_poses([pose]))
    matrix, gradient, reach = np.zeros((1, SIZE, SIZE)), np.zeros((1, SIZE)), np.array([0.2])
    weights = contour_weights([SETTINGS], reach)
    add_silhouettes(SURFACE, posed, seen, reach, weights, matrix, gradient)
    rows = residuals(SURFACE, posed[0], seen, 0.2, SETTINGS)
    jacobian = SURFACE.jacobian(posed[0], rows.index, rows.direction)
    weighed = rows.weight[:, None] * jacobian
    np.testing.assert_allclose(matrix[0], weighed.T @ jacobian, rtol=1e-6, atol=1e-3)
    np.testing.assert_allclose(gradient[0], weighed.T @ rows.gap_m, rtol=1e-6, atol=1e-3)


def test_what_one_camera_adds_hardly_moves_the_pose():
    """A bag beside the leg, which only one of four cameras shows."""
    truth = stance(MODEL)
    masks = photograph(views(4), MODEL, truth)
    left, bottom = np.argwhere(masks[0].T).min(0)[0], np.argwhere(masks[0]).max(0)[0]
    spoiled = masks[0].copy()
    spoiled[bottom - 90 : bottom - 40, left - 15 : left + 20] = True
    points = []
    for first in (masks[0], spoiled):
        seen = Observation.from_masks(views(4), [first, *masks[1:]], 3.5)
        points.append(SURFACE.posed(refine(SURFACE, seen, truth).pose).points)
    assert np.linalg.norm(points[1] - points[0], axis=1).max() < 0.004


def test_without_silhouettes_a_pose_goes_where_the_prior_expects_it():
    mean = stance(MODEL).moved(step(0, 0.08) + step(5, 0.2) + step(FLEXION, 0.3))
    prior = PosePrior(mean, np.full(SIZE, 0.01))
    settings = RefineSettings(reaches_m=(0.0, 0.0), usual=0.0)
    found = refine(SURFACE, None, stance(MODEL), prior, settings).pose  # type: ignore[arg-type]
    np.testing.assert_allclose(found.minus(mean)[free_unknowns(MODEL)], 0, atol=1e-4)


def test_two_beliefs_of_one_strength_meet_half_way():
    """The prior's and that of the resting stance, where both are as sure."""
    prior = PosePrior(
        stance(MODEL).moved(step(FLEXION, 0.4)), np.r_[np.full(6, np.inf), usual_rad(MODEL.tree)]
    )
    settings = RefineSettings(reaches_m=(0.0, 0.0, 0.0))
    found = refine(SURFACE, None, stance(MODEL), prior, settings).pose  # type: ignore[arg-type]
    bent = found.angles_rad[FLEXION - 6] - RELAXED_RAD[FLEXION - 6]
    assert bent == pytest.approx(0.2, abs=1e-3)


def test_an_angle_beyond_its_limit_may_return_but_need_not():
    angles, unknown = stance(MODEL).angles_rad.copy(), FLEXION
    angles[unknown - 6] = MODEL.tree.dof_limits_rad[unknown - 6, 0] - 0.2
    for asked, taken in ((0.0, 0.0), (0.1, 0.1), (9.0, 0.35), (-0.1, 0.0)):
        found = solve_steps(np.eye(SIZE)[None], -step(unknown, asked)[None], angles[None], MODEL)[0]
        assert found[unknown] == pytest.approx(taken, abs=1e-6)


def test_poses_refined_together_are_refined_as_each_alone(seen):
    starts = [
        RefineStart(stance(MODEL).moved(step(5, yaw)), replace(SETTINGS, reaches_m=(0.2,) * count))
        for yaw, count in ((0.05, 1), (-0.05, 3), (0.1, 2))
    ]
    together = refine_many(SURFACE, seen, starts)
    for start, found in zip(starts, together, strict=True):
        (alone,) = refine_many(SURFACE, seen, [start])
        np.testing.assert_allclose(found.pose.minus(alone.pose), 0, atol=1e-8)
