"""Girth of a body by the volume of its hull."""

import pytest

from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from tests.voxelpose.multiview.matching_scenes import fitting_model
from voxelpose.multiview.person.posterior import chest_from_hull

MODEL = fitting_model()
BODY_M3 = MODEL.part_volumes_m3(0.02).sum()


def hull_of(factor: float) -> float:
    """Volume of the usual hull of a body whose girths are larger by a factor."""
    return 1.75 * BODY_M3 * factor**2


def test_a_body_whose_girths_are_larger_fills_the_square_of_it():
    usual = chest_from_hull(MODEL, hull_of(1.0))
    assert usual == pytest.approx(0.96 / 1.75 * MODEL.sizes.stature_m, rel=1e-6)
    assert chest_from_hull(MODEL, hull_of(1.2)) == pytest.approx(1.2 * usual, rel=1e-6)
    assert chest_from_hull(MODEL, hull_of(0.95)) == pytest.approx(0.95 * usual, rel=1e-6)


def test_no_hull_makes_a_chest_that_no_person_has():
    giant = BodyModel.from_sizes(BodySizes(2.4))
    chest = chest_from_hull(giant, 10.0)
    assert chest == 1.8
    BodySizes(2.4, chest)
