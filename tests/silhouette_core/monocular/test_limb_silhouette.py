"""Limbs weighed alone against the whole body drawn again."""

import numpy as np
import pytest

from silhouette_core.image.raster import render_parts
from silhouette_core.monocular.limb_silhouette import LIMB_NAMES, LimbShape, SignedWeights
from silhouette_core.monocular.tree.evidence import relative_weights
from silhouette_core.monocular.tree.rendering import STATURE_PX
from silhouette_core.monocular.window import SIZE, look_at
from silhouette_core.motion.pose import Pose
from silhouette_core.scoring.silhouette_error import posed_mesh
from tests.silhouette_core.monocular.filming import (
    STATURE_M,
    body,
    camera_at,
    performed,
    poses_of,
    silhouette,
)

CAMERA = camera_at((1.2, -3.8, 1.5), size=(640, 480))
MODEL = body()


@pytest.fixture(scope="module")
def seen():
    pose = poses_of(performed("wave"))[25]
    window = look_at(CAMERA, silhouette(MODEL, pose, CAMERA), 3.9, STATURE_PX / STATURE_M)
    return pose, window


def drawn(picture, pose):
    """Part numbers of the whole body in the window at the picture's resolution."""
    in_camera = posed_mesh(MODEL, pose) @ picture.rotation.T + picture.translation_m
    return render_parts(
        in_camera, MODEL.faces, MODEL.face_part, picture.matrix, picture.signed.shape[::-1]
    )[0]


@pytest.mark.parametrize("name", LIMB_NAMES)
@pytest.mark.parametrize("reduction", [1, 2])
def test_a_limb_elsewhere_is_the_whole_body_drawn_again(seen, name, reduction):
    pose, window = seen
    picture, limb = (
        SignedWeights.from_window(window, "nwxor", reduction),
        LimbShape.from_model(MODEL, name),
    )
    mask, weights = relative_weights(window, "nwxor", reduction)
    rng = np.random.default_rng(1)
    angles = np.clip(
        pose.angles_rad[limb.dofs] + rng.normal(0, 0.4, (6, len(limb.dofs))),
        *MODEL.dof_limits_rad[limb.dofs].T,
    )
    result = picture.limb_distances(MODEL, limb, pose, angles)
    for own, distance in zip(angles, result, strict=True):
        whole = pose.angles_rad.copy()
        whole[limb.dofs] = own
        other = Pose(pose.root_m, pose.root_rotation, whole)
        dense = float(weights[(drawn(picture, other) > 0) ^ mask].sum())
        assert distance == pytest.approx(
            dense, abs=0.02
        )  # skin that limb and trunk share stays behind
        assert picture.distances(MODEL, [other])[0] == pytest.approx(dense, abs=1e-6)
    assert np.ptp(result) > 0.05
    still = picture.limb_distances(MODEL, limb, pose, pose.angles_rad[None, limb.dofs])
    assert still[0] == pytest.approx(picture.distances(MODEL, [pose])[0], abs=1e-9)


def test_the_true_pose_has_next_to_no_distance(seen):
    pose, window = seen
    picture = SignedWeights.from_window(window, "balanced", 1)
    assert picture.distances(MODEL, [pose])[0] < 0.03
    raised = pose.angles_rad.copy()
    raised[MODEL.dof_names.index("left_thigh.flexion")] += 0.8
    assert picture.distances(MODEL, [Pose(pose.root_m, pose.root_rotation, raised)])[0] > 0.15
    beside = Pose(pose.root_m + np.array([0.1, 0, 0]), pose.root_rotation, pose.angles_rad)
    assert picture.distances(MODEL, [beside])[0] > 0.15


def test_areas_are_pixels_of_the_librarys_resolution(seen):
    pose, window = seen
    for reduction in (1, 2):
        picture = SignedWeights.from_window(window, "balanced", reduction)
        areas = picture.part_areas(picture.part_images(MODEL, [pose]), len(MODEL.names))[0]
        fine = np.bincount(
            drawn(SignedWeights.from_window(window, "balanced", 1), pose).ravel(), minlength=28
        )[1:]
        np.testing.assert_allclose(areas, fine, atol=1 if reduction == 1 else 30)
    assert picture.signed.shape == (SIZE[1] // 2, SIZE[0] // 2)


@pytest.mark.parametrize("name", LIMB_NAMES)
def test_a_limb_and_the_rest_are_the_body(name):
    limb = LimbShape.from_model(MODEL, name)
    assert len(limb.faces) + len(limb.rest_faces) == len(MODEL.faces)
    assert set(limb.face_part) == set(limb.parts) and not set(limb.rest_part) & set(limb.parts)
    assert all(MODEL.dof_names[dof].startswith(name.split("_")[0]) for dof in limb.dofs)
