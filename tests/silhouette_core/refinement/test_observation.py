"""What a silhouette says: contour points, tangent planes that touch the body, distances outside."""

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from calib.camera import Rig
from silhouette_core.refinement.observation import (
    Observation,
    PinholeViews,
    contour_points,
    outside_distances,
)
from silhouette_core.scoring.cpu import CpuBackend
from silhouette_core.scoring.silhouette_error import silhouette_error
from tests.voxelpose.multiview.carving.carving_scenes import look_at
from tests.voxelpose.multiview.matching_scenes import (
    fitting_model,
    observe,
    other_body,
    photograph,
    stance,
    views,
)


def ball_masks(seen_by: PinholeViews, centre: np.ndarray, radius: float) -> list[np.ndarray]:
    """Pixels whose viewing ray passes through a ball."""
    masks = []
    for camera in seen_by.rig:
        width, height = camera.size
        pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).astype(float)
        origin, directions = camera.rays(pixels.reshape(-1, 2))
        away = np.linalg.norm(np.cross(directions, centre - origin), axis=1)
        masks.append((away < radius).reshape(height, width))
    return masks


def test_every_tangent_plane_touches_a_ball():
    seen_by, centre, radius = views(4, (480, 360)), np.array([0.1, -0.2, 1.1]), 0.4
    seen = Observation.from_masks(seen_by, ball_masks(seen_by, centre, radius), 3.5)
    assert set(seen.camera) == {0, 1, 2, 3} and len(seen.ray) > 4 * 60
    np.testing.assert_allclose(np.linalg.norm(seen.ray, axis=1), 1)
    np.testing.assert_allclose((seen.ray * seen.normal).sum(1), 0, atol=1e-12)
    # The plane through the camera passes the middle at one radius; its normal points away from it.
    distance = ((seen_by.center_m[seen.camera] - centre) * seen.normal).sum(1)
    pixel_m = 3.5 / seen_by.intrinsics[0, 0]
    assert np.abs(distance - radius).max() < pixel_m
    assert abs(distance.mean() - radius) < 0.1 * pixel_m


def test_distance_outside_grows_from_the_edge():
    seen_by = views(2)
    masks = ball_masks(seen_by, np.array([0.0, 0, 0.9]), 0.3)
    seen = Observation.from_masks(seen_by, masks)
    for outside, mask in zip(seen.outside_px, masks, strict=True):
        assert outside.dtype == np.float32
        assert (outside[mask] == 0).all() and (outside[~mask] >= 0.9).all()


def test_far_away_the_distance_outside_stays_what_it_is():
    mask = np.zeros((300, 400), bool)
    mask[100:160, 120:150] = True
    result = outside_distances(mask)
    every = distance_transform_edt(~mask)
    near = np.zeros_like(mask)
    near[85:175, 105:165] = True
    np.testing.assert_allclose(result[near], every[near], rtol=0.03)  # a chamfer's distances
    assert (result[175:, 130] == result[174, 130]).all() and result[0, 0] == result[85, 105]
    assert (outside_distances(np.zeros((9, 9), bool)) > 9).all()


def test_contour_of_a_square_with_a_hole():
    mask = np.zeros((80, 100), bool)
    mask[20:60, 30:70] = True
    mask[32:49, 42:59] = False
    points, outward = contour_points(mask, 1)
    np.testing.assert_allclose(np.linalg.norm(outward, axis=1), 1)
    hole = np.abs(points - (50, 40)).max(1) < 12
    straight = np.abs(np.abs(points - (50, 40)).min(1)) < 4
    to_middle = ((points - (50, 40)) * outward).sum(1)
    assert hole.sum() > 30 and (to_middle[hole & straight] < 0).all()
    assert (to_middle[~hole & straight] > 0).all()
    left = (outward[:, 0] < -0.999) & ~hole
    np.testing.assert_allclose(points[left, 0], 29.5)


def test_where_the_image_cuts_the_body_there_is_no_contour():
    mask = np.zeros((80, 100), bool)
    mask[30:, 40:60] = True
    points, outward = contour_points(mask, 1)
    assert points[:, 1].max() < 78 and not (outward[:, 1] > 0.9).any()
    for empty_or_full in (np.zeros((80, 100), bool), np.ones((80, 100), bool)):
        assert len(contour_points(empty_or_full, 1)[0]) == 0


def error(seen: Observation, place_m: tuple[float, float] = (0.0, 0.0)) -> float:
    """Of the usual body in its stance at a place."""
    model = fitting_model()
    return silhouette_error(model, stance(model, place_m=place_m), seen, CpuBackend())


def test_a_body_explains_its_own_silhouettes_and_no_other():
    model = fitting_model()
    seen, stranger = (observe(views(3), one, stance(model)) for one in (model, other_body()))
    assert error(seen) == 0 and 0.02 < error(stranger) < 0.3
    assert error(seen, (0.1, 0.0)) > 0.1 and error(seen, (1.0, 1.0)) > 0.9


def test_a_camera_that_sees_nothing_and_should_not_is_left_out():
    away = look_at("away", (3, 0, 1), (6, 0, 1), (320, 320), 288)
    seen_by = PinholeViews.from_rig(Rig((*views(2).rig.cameras, away)))
    model = fitting_model()
    assert error(observe(seen_by, model, stance(model))) == 0
    blind = PinholeViews.from_rig(Rig((away,)))
    assert error(Observation.from_masks(blind, photograph(blind, model, stance(model)))) == 1


def test_plain_arrays_are_those_of_the_cameras():
    seen_by = views(3)
    for c, camera in enumerate(seen_by.rig):
        np.testing.assert_allclose(seen_by.center_m[c], camera.center_m)
        point = np.array([[0.2, 0.1, 1.0]])
        x, y, z = (point @ seen_by.rotation[c].T + seen_by.translation_m[c])[0]
        fx, fy, cx, cy = seen_by.intrinsics[c]
        assert camera.project(point)[0][0] == pytest.approx((fx * x / z + cx, fy * y / z + cy))
