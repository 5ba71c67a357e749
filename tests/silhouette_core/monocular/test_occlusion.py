"""How much of each part is usually seen, with a library and without."""

import numpy as np
import pytest

from silhouette_core.monocular.occlusion import occluded_parts, standing_areas, usual_areas
from silhouette_core.monocular.tracking.silhouette_weights import SignedWeights
from silhouette_core.monocular.tree.rendering import STATURE_PX
from silhouette_core.monocular.window import look_at
from silhouette_core.scoring.cpu import CpuBackend
from tests.silhouette_core.monocular.filming import (
    STATURE_M,
    body,
    camera_at,
    performed,
    poses_of,
    silhouette,
)


@pytest.fixture(scope="module")
def standing():
    return standing_areas(body())


def test_an_upright_body_shows_about_the_largest_areas_of_a_library(standing, library):
    usual = usual_areas(library.areas)
    assert standing.shape == usual.shape == (27,)
    large = usual > 60
    assert large.sum() >= 15
    assert np.median(standing[large] / usual[large]) == pytest.approx(1, abs=0.15)
    assert (np.abs(np.log(standing[large] / usual[large])) < np.log(2)).all()


def test_sides_and_statures_are_alike(standing):
    names = body().names
    for name in names:
        if name.startswith("left_"):
            other = names.index(name.replace("left_", "right_"))
            assert standing[names.index(name)] == pytest.approx(standing[other], rel=0.1, abs=3)


def test_areas_are_those_of_the_full_resolution_in_smaller_pictures():
    camera = camera_at((0, -4.0, 1.3))
    pose = poses_of(performed("wave"))[20]
    window = look_at(camera, silhouette(body(), pose, camera), 4.0, STATURE_PX / STATURE_M)
    areas = []
    for reduction in (1, 2, 4):
        weights = SignedWeights.from_window(window, CpuBackend(), reduction)
        areas += [weights.part_areas(weights.part_images(body(), [pose]), 27)[0]]
    large = areas[0] > 200
    assert large.sum() > 8
    for other in areas[1:]:
        np.testing.assert_allclose(other[large], areas[0][large], rtol=0.25)
        assert other.sum() == pytest.approx(areas[0].sum(), rel=0.05)


def test_a_part_is_occluded_by_its_own_usual_area():
    usual = np.array([100.0, 1000.0])
    assert occluded_parts(np.array([[14, 151], [16, 149]]), usual).tolist() == [
        [True, False],
        [False, True],
    ]
