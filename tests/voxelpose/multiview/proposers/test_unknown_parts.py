"""A body whose legs one camera cannot see: hull, refinement, search and quality leave it out."""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.image.cleanup import dilated
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.cpu import CpuBackend
from silhouette_core.scoring.silhouette_error import silhouette_error
from tests.voxelpose.multiview.matching_scenes import (
    fitting_model,
    joint_errors_m,
    joints,
    photograph,
    stance,
    views,
)
from voxelpose.multiview.carving.carver import CarveRule
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import HullObserver, body_rule
from voxelpose.multiview.proposers.limb_search import _pixel_values
from voxelpose.multiview.proposers.pose_search import SEARCHED, BodyGeometry, refine_fit
from voxelpose.multiview.quality.quality import frame_evidence
from voxelpose.multiview.silhouettes.completion import SilhouetteCompletion

VOLUME = VoxelGrid.from_bounds((-1.6, -1.2, -0.1), (1.6, 1.2, 2.1), 0.05)
MODEL = fitting_model()
POSE = stance(
    MODEL, {"left_thigh.flexion": 35.0, "left_shin.flexion": 30.0, "left_upper_arm.abduction": 40.0}
)
ANKLES = [3, 6]


@pytest.fixture(scope="module")
def masks() -> list[np.ndarray]:
    return photograph(views(4), MODEL, POSE)


@pytest.fixture(scope="module")
def marked(masks) -> PinholeViews:
    """Views of which the first knows nothing below the hips."""
    unknown = [np.zeros_like(mask) for mask in masks]
    rows = np.flatnonzero(masks[0].any(axis=1))
    unknown[0][(rows[0] + rows[-1]) // 2 :] = True
    return PinholeViews.from_rig(views(4).rig, unknown)


def test_no_contour_lies_along_what_is_unknown(masks, marked):
    hidden = marked.without_unknown(masks)
    seen = Observation.from_masks(marked, hidden, 3.5)
    blind = Observation.from_masks(replace(marked, unknown=None), hidden, 3.5)
    whole = Observation.from_masks(views(4), masks, 3.5)
    assert (seen.camera > 0).sum() == (whole.camera > 0).sum()
    own = seen.ray[seen.camera == 0] @ marked.rotation[0].T
    fx, fy, cx, cy = marked.intrinsics[0]
    pixels = np.rint(own[:, :2] / own[:, 2:] * (fx, fy) + (cx, cy)).astype(int)
    near = dilated(marked.unknown[0], 7)
    assert len(pixels) > 20 and not near[pixels[:, 1], pixels[:, 0]].any()
    assert (blind.camera == 0).sum() > len(pixels)


def test_nothing_is_outside_where_nothing_is_known(masks, marked):
    seen = Observation.from_masks(marked, marked.without_unknown(masks), 3.5)
    assert not seen.outside_px[0][marked.unknown[0]].any()
    above = ~marked.unknown[0] & ~masks[0]
    assert (seen.outside_px[0][above] > 0).all()


def test_legs_are_refined_as_if_one_camera_did_not_hide_them(masks, marked):
    body = BodyGeometry.from_surface(Surface(MODEL), 0.04, "cpu")
    start = stance(MODEL, {"left_thigh.flexion": 20.0, "left_upper_arm.abduction": 30.0})
    hidden = marked.without_unknown(masks)

    def ankle_error_m(seen_by: PinholeViews, silhouettes: list[np.ndarray]) -> float:
        observation = Observation.from_masks(seen_by, silhouettes, 3.5)
        fit = refine_fit(body, observation, start, None, SEARCHED)
        return float(joint_errors_m(MODEL, fit.pose, MODEL, POSE)[ANKLES].max())

    whole, cut = ankle_error_m(views(4), masks), ankle_error_m(views(4), hidden)
    assert ankle_error_m(marked, hidden) < max(1.3 * whole, 0.02) < cut


def test_the_right_pose_has_no_error_where_nothing_is_known(masks, marked):
    hidden = marked.without_unknown(masks)
    seen = Observation.from_masks(marked, hidden, 3.5)
    blind = Observation.from_masks(views(4), hidden, 3.5)
    assert silhouette_error(MODEL, POSE, seen, CpuBackend()) < 1e-9
    assert silhouette_error(MODEL, POSE, blind, CpuBackend()) > 0.1


def test_hull_and_silhouettes_keep_the_legs(masks, marked):
    rule = body_rule(4, 0, marked.partly_unknown)
    hidden = marked.without_unknown(masks)
    frame = HullObserver(marked, VOLUME, 0.04, rule).observe(hidden)
    whole = HullObserver(views(4), VOLUME, 0.04, body_rule(4, 0)).observe(masks)
    cut = HullObserver(views(4), VOLUME, 0.04, body_rule(4, 0)).observe(hidden)
    assert frame is not None and whole is not None and cut is not None
    assert 1.0 <= frame.occupancy.sum() / whole.occupancy.sum() < 1.5
    assert cut.occupancy.sum() < 0.8 * whole.occupancy.sum()
    for kept, given in zip(frame.masks, hidden, strict=True):
        assert kept.sum() > 0.99 * given.sum()
    assert not (frame.masks[0] & marked.unknown[0]).any()


def test_two_sure_cameras_are_enough_where_two_know_nothing():
    assert body_rule(4, 0).least_agreeing == 3
    assert body_rule(4, 0, 1).least_agreeing == 2
    assert body_rule(4, 0, 3).least_agreeing == 2
    assert body_rule(2, 0, 1).least_agreeing == 2
    assert body_rule(4, 2, 2).least_agreeing == body_rule(4, 2).least_agreeing == 1


def test_a_limb_gains_and_loses_nothing_there(masks, marked):
    values = _pixel_values(Observation.from_masks(marked, marked.without_unknown(masks), 3.5))
    assert not values[0][marked.unknown[0]].any()
    assert (values[0][~marked.unknown[0]] != 0).all() and (values[1:] != 0).all()


def test_evidence_of_the_known_part_alone(masks, marked):
    rule = body_rule(4, 0, 1)
    frame = HullObserver(marked, VOLUME, 0.04, rule).observe(marked.without_unknown(masks))
    body = BodyGeometry.from_surface(Surface(MODEL), 0.04, "cpu")
    places = joints(MODEL, POSE)
    found = frame_evidence(body, POSE, places, frame)
    assert found["camera_agreement"].min() > 0.97 and found["joint_disagreement"].max() < 0.05
    blind = replace(frame, views=views(4))
    wrong = frame_evidence(body, POSE, places, blind)
    assert wrong["camera_agreement"][0] < 0.8
    assert wrong["joint_disagreement"][ANKLES].min() > 0.03


def test_a_camera_that_knows_nothing_has_the_others_agreement(masks, marked):
    everything = [np.ones_like(masks[0]), *marked.unknown[1:]]
    nothing = PinholeViews.from_rig(marked.rig, everything)
    frame = HullObserver(marked, VOLUME, 0.04, body_rule(4, 0, 1)).observe(
        marked.without_unknown(masks)
    )
    frame = replace(frame, views=nothing, masks=nothing.without_unknown(frame.masks))
    body = BodyGeometry.from_surface(Surface(MODEL), 0.04, "cpu")
    found = frame_evidence(body, POSE, joints(MODEL, POSE), frame)["camera_agreement"]
    assert found[0] == pytest.approx(found[1:].mean())


def test_completion_adds_nothing_there(masks, marked):
    completion = SilhouetteCompletion(marked, VOLUME, CarveRule(least_agreeing=2))
    hidden = marked.without_unknown(masks)
    holed = [hidden[0], hidden[1].copy(), *hidden[2:]]
    rows = np.flatnonzero(masks[1].any(axis=1))
    holed[1][rows[0] + len(rows) // 4 : rows[0] + len(rows) // 2] = False
    completed = completion.complete(holed, masks)
    assert not (completed[0] & marked.unknown[0]).any()
    assert (completed[1] & masks[1]).sum() > 0.95 * masks[1].sum()
