"""The warp of the templates: linear, one to one, nothing beyond its bands."""

import numpy as np
import pytest

from silhouette_core.body.joints import PART_NAMES
from silhouette_core.body.model import BodyModel, read_template
from silhouette_core.body.sizes import BodySizes
from silhouette_core.body.template_warp import warp_template

BODIES = pytest.mark.parametrize("sex", ["male", "female"])


def warped(sex, *changes):
    body = read_template(sex)
    return body, warp_template(
        body.vertices_m, body.joints_m, body.skin_parts, body.skin_weights, changes
    )


@BODIES
def test_it_is_linear_and_mirror_symmetric(sex):
    body, both = warped(sex, 0.1, -0.2, 0.3, 0.4)
    parts = sum(
        warped(sex, *np.where(np.arange(4) == k, change, 0.0))[1] - body.vertices_m
        for k, change in enumerate((0.1, -0.2, 0.3, 0.4))
    )
    np.testing.assert_allclose(both, body.vertices_m + parts, atol=1e-12)
    left, right = (np.sort(sign * both[:, 0]) for sign in (1, -1))
    np.testing.assert_allclose(left, right, atol=1e-6)


@BODIES
@pytest.mark.parametrize(
    "change, low, high", [(0, 0.65, 0.83), (1, 0.525, 0.725), (2, 0.425, 0.625), (3, 0.245, 0.49)]
)
def test_each_change_stays_in_its_band(sex, change, low, high):
    body, changed = warped(sex, *np.where(np.arange(4) == change, 0.3, 0.0))
    moved = np.abs(changed - body.vertices_m).max(1) > 1e-9
    z = body.vertices_m[:, 2] / np.ptp(body.vertices_m[:, 2])
    assert moved.any() and z[moved].min() >= low and z[moved].max() <= high
    np.testing.assert_array_equal(changed[:, 2], body.vertices_m[:, 2])
    hands = body.skin_parts[:, 0] == PART_NAMES.index("left_hand")
    assert not moved[hands].any()


@BODIES
def test_the_thickest_thighs_do_not_pass_the_middle(sex):
    body, changed = warped(sex, 0.0, 0.0, 0.0, 0.95)
    right = body.vertices_m[:, 0] < -1e-6
    assert (changed[right, 0] < 0).all()
    np.testing.assert_allclose(changed[np.abs(body.vertices_m[:, 0]) < 1e-6, 0], 0, atol=1e-6)


@BODIES
def test_without_changes_bodies_are_as_they_were(sex):
    template = read_template(sex)
    body = BodyModel.from_sizes(BodySizes(template.sizes.stature_m, None, sex))
    np.testing.assert_array_equal(body.vertices_m, template.vertices_m)
    assert BodySizes(1.7) == BodySizes(1.7, None, "unknown", 0.0, 0.0, 0.0, 0.0)


def test_the_shape_space_lies_around_the_warped_template():
    sizes = BodySizes(1.8, 1.0, "male", 0.1, 0.2, 0.1, 0.2)
    body = BodyModel.from_sizes(sizes)
    np.testing.assert_array_equal(body.shape, 0)
    np.testing.assert_array_equal(body.reshaped(body.shape).vertices_m, body.vertices_m)
    assert np.ptp(body.vertices_m[:, 2]) == pytest.approx(1.8)
