"""Properties of lenses: bending and straightening undo each other everywhere in the field, and
nothing is seen outside it.
"""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from calib.lens import FisheyeLens, RationalLens


def number(bound: float) -> st.SearchStrategy[float]:
    return st.floats(-bound, bound, allow_subnormal=False)


@st.composite
def rational_lenses(draw) -> RationalLens:
    above, below, prism, tilt = (0.5, 0.3, 0.01, 0.01, 0.2), (0.4, 0.2, 0.1), [0.01] * 4, [0.05] * 2
    terms = [draw(number(bound)) for bound in (*above, *below, *prism, *tilt)]
    return RationalLens(np.array(terms[: draw(st.sampled_from([0, 4, 5, 8, 12, 14]))]))


@st.composite
def fisheye_lenses(draw) -> FisheyeLens:
    return FisheyeLens(np.array([draw(number(bound)) for bound in (0.3, 0.2, 0.1, 0.1)]))


directions = arrays(np.float64, (30, 2), elements=number(1.0))


def scaled_to(unit: np.ndarray, radius: float) -> np.ndarray:
    """Scales points of the unit square into a disc of that radius (at most 2, 63 degrees from the
    axis).
    """
    length = np.linalg.norm(unit, axis=1, keepdims=True)
    return unit / np.maximum(1, length) * min(radius, 2.0)


@settings(max_examples=150, deadline=None)
@given(st.one_of(rational_lenses(), fisheye_lenses()), directions)
def test_undistort_inverts_distort_in_the_field(lens, unit):
    # At the fold itself the inverse has no slope.
    points = scaled_to(unit, 0.98 * lens.field_radius)
    bent = lens.distort(points)
    seen = np.isfinite(bent).all(axis=1)
    np.testing.assert_allclose(lens.undistort(bent)[seen], points[seen], atol=1e-7)


@settings(max_examples=150, deadline=None)
@given(st.one_of(rational_lenses(), fisheye_lenses()), directions)
def test_distort_inverts_undistort_wherever_there_is_a_ray(lens, unit):
    pixels = 3 * unit
    straight = lens.undistort(pixels)
    seen = np.isfinite(straight).all(axis=1)
    again = lens.distort(straight[seen] * (1 - 1e-12))
    np.testing.assert_allclose(again, pixels[seen], atol=1e-6)
    assert (np.linalg.norm(straight[seen], axis=1) <= lens.field_radius * (1 + 1e-6)).all()


@settings(max_examples=150, deadline=None)
@given(st.one_of(rational_lenses(), fisheye_lenses()), directions)
def test_nothing_is_seen_outside_the_field(lens, unit):
    points = 4 * unit
    outside = np.linalg.norm(points, axis=1) > lens.field_radius * (1 + 1e-9)
    unseen = np.isnan(lens.distort(points)).any(axis=1)
    assert unseen[outside].all()
    if getattr(lens, "_tilt", None) is None:  # a tilted sensor may end before the field does
        assert not unseen[~outside].any()


@settings(max_examples=60, deadline=None)
@given(st.one_of(rational_lenses(), fisheye_lenses()), st.floats(0, 2 * np.pi))
def test_distortion_is_monotonic_along_each_direction(lens, angle):
    radii = np.linspace(0, min(2.0, 0.999 * lens.field_radius), 300)
    bent = lens.distort(radii[:, None] * [[np.cos(angle), np.sin(angle)]])
    # A tilted sensor may end before the field does.
    along = np.diff(bent[np.isfinite(bent).all(axis=1)], axis=0)
    assert (along @ [np.cos(angle), np.sin(angle)] > 0).all()
