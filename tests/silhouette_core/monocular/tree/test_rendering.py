"""Library pictures: the virtual camera, the centring, areas, resolutions and runs."""

import numpy as np
import pytest

from calib.camera import Camera
from silhouette_core.image.cleanup import reduce_silhouette
from silhouette_core.image.raster import render_parts
from silhouette_core.image.spans import Spans
from silhouette_core.monocular.tree.rendering import (
    DISTANCE,
    FOCAL_PX,
    WINDOW_PX,
    camera_from_body,
    join_spans,
    masks_of,
    pose_surfaces,
    render_views,
    select_spans,
    silhouette_levels,
)
from silhouette_core.motion import kinematics
from tests.clips import waving


@pytest.fixture(scope="module")
def scene():
    clip = waving(3, 1.75)
    upright = np.tile([1.0, 0, 0, 0], (3, 1))
    surfaces = pose_surfaces(clip.model, upright, clip.angles_rad)
    views = np.radians([[0, 0], [90, 0], [200, 15]])
    return clip, surfaces, views, render_views(clip.model, surfaces, np.arange(3), views)


def test_a_body_at_yaw_zero_faces_the_camera_and_turns_counter_clockwise():
    facing, left = np.array([0, -1.0, 0]), np.array([1.0, 0, 0])
    # Toward the camera, its left at the picture's right.
    np.testing.assert_allclose(camera_from_body(0, 0) @ facing, [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(camera_from_body(0, 0) @ left, [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(camera_from_body(np.pi / 2, 0) @ facing, [1, 0, 0], atol=1e-12)
    # Looking down: what is above comes nearer and stays above.
    np.testing.assert_allclose(
        camera_from_body(0, np.radians(30)) @ [0, 0, 1], [0, -np.cos(np.pi / 6), -0.5], atol=1e-12
    )


def test_pictures_are_those_of_a_camera_of_calib(scene):
    clip, _, views, pictures = scene
    width, height = WINDOW_PX
    for k, (yaw, pitch) in enumerate(views):
        rotation = camera_from_body(0, pitch)
        # The window's principal point is where the pelvis went.
        x, y = pictures.pelvis_px[k].astype(float)
        matrix = np.array([[FOCAL_PX, 0, x], [0, FOCAL_PX, y], [0, 0, 1]])
        camera = Camera(
            "virtual", WINDOW_PX, matrix, np.zeros(0), rotation, np.array([0, 0, DISTANCE * 1.75])
        )
        turned = np.array([np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)])
        parts, origin = kinematics.forward(
            clip.model, np.zeros((1, 3)), turned[None], clip.angles_rad[k : k + 1]
        )
        surface = kinematics.skin(clip.model, parts[0], origin[0])
        pixels, _ = camera.project(origin[0, :1])
        np.testing.assert_allclose(pixels[0], (x, y), atol=1e-4)
        placed = surface @ rotation.T + camera.translation
        expected, _ = render_parts(
            placed, clip.model.faces, clip.model.face_part, matrix, WINDOW_PX, cull_back=True
        )
        window = pictures.windows[k]
        # Single against double precision.
        assert ((expected > 0) != (window > 0)).sum() <= 3
        rows, columns = np.nonzero(window)
        assert abs(columns.mean() - (width - 1) / 2) <= 0.5
        assert abs(rows.mean() - (height - 1) / 2) <= 0.5
        assert (np.bincount(window.ravel(), minlength=28)[1:28] == pictures.areas[k]).all()
    assert (pictures.cut == 0).all()


@pytest.mark.parametrize("stature_m", [1.2, 1.75, 2.1])
def test_an_upright_body_is_as_tall_as_said(stature_m):
    clip = waving(1, stature_m)
    angles = np.zeros((1, clip.model.dof_count))
    upright = pose_surfaces(clip.model, np.array([[1.0, 0, 0, 0]]), angles)
    picture = render_views(clip.model, upright, np.array([0]), np.zeros((1, 2)))
    rows = np.nonzero(picture.windows[0].any(axis=1))[0]
    assert np.ptp(rows) + 1 == pytest.approx(158, abs=6)  # feet and face are nearer than the pelvis
    assert -upright[0, :, 2].min() == pytest.approx(
        clip.model.joints_m[0, 2] - clip.model.vertices_m[:, 2].min(), abs=1e-5
    )


def test_what_leaves_the_window_is_counted(scene):
    clip, surfaces, _, _ = scene
    pictures = render_views(
        clip.model, surfaces[:1] * np.float32(1.8), np.array([0]), np.zeros((1, 2))
    )
    assert pictures.cut[0] > 0
    assert pictures.cut[0] + (pictures.windows[0] > 0).sum() == pictures.areas[0].sum()


def test_reduction_is_by_majority():
    mask = np.array([[1, 1, 0, 1], [0, 0, 0, 0], [1, 1, 0, 0], [1, 0, 1, 1]], bool)
    assert (reduce_silhouette(mask) == [[True, False], [True, True]]).all()
    levels = silhouette_levels(np.ones((2, 240, 320), bool))
    assert [level.shape for level in levels] == [(2, 60, 80), (2, 120, 160), (2, 240, 320)]


def test_runs_draw_the_same_silhouettes(scene):
    masks = np.concatenate(
        [scene[3].windows > 0, np.zeros((1, 240, 320), bool), np.ones((1, 240, 320), bool)]
    )
    result = Spans.from_masks(masks)
    assert (masks_of(result, np.arange(len(masks))) == masks).all()
    chosen = np.array([4, 0, 0, 3])
    assert (masks_of(select_spans(result, chosen), np.arange(4)) == masks[chosen]).all()
    assert (
        masks_of(join_spans([result, select_spans(result, chosen)]), np.arange(9))
        == masks[[0, 1, 2, 3, 4, 4, 0, 0, 3]]
    ).all()
