"""How much of each part is usually seen, with a library and without."""

import numpy as np
import pytest

from silhouette_core.monocular.occlusion import occluded_parts, standing_areas, usual_areas
from tests.silhouette_core.monocular.filming import body


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


def test_a_part_is_occluded_by_its_own_usual_area():
    usual = np.array([100.0, 1000.0])
    assert occluded_parts(np.array([[14, 151], [16, 149]]), usual).tolist() == [
        [True, False],
        [False, True],
    ]
