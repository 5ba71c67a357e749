"""Whom the check of the cameras blames, by the errors of their pairs."""

from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from calib.agreement import _culprits, group_error, image_scale, signed_errors, trimmed_mean

NAMES = ("a", "b", "c", "d", "e")


def pair_errors(
    off_px: dict[str, float], rest_px: float = 0.2
) -> dict[tuple[str, str], np.ndarray]:
    """Errors (8, 2) of every pair: what the cameras are off by differs from camera to camera."""
    signs = np.where(np.arange(16).reshape(8, 2) % 2, -1.0, 1.0)
    return {
        (first, second): signs * (rest_px + off_px.get(first, 0.0) + off_px.get(second, 0.0))
        for first, second in combinations(NAMES, 2)
    }


def blamed(off_px: dict[str, float], rest_px: float = 0.2) -> tuple[str, ...]:
    return _culprits(pair_errors(off_px, rest_px), NAMES, 1.0)


def test_a_minority_is_blamed():
    assert blamed({"b": 5.0}) == ("b",)
    assert blamed({"b": 5.0, "e": 9.0}) == ("b", "e")


def test_a_majority_is_not():
    """The two that are left agree, but of five cameras three were to blame."""
    assert blamed({"a": 5.0, "b": 7.0, "e": 9.0}) == ()


def test_nobody_is_blamed_where_the_others_do_not_agree():
    assert blamed({"b": 30.0}, rest_px=2.4) == ("b",)
    assert blamed({"b": 30.0}, rest_px=2.6) == ()


def test_small_errors_are_nobodys_fault():
    assert blamed({"b": 0.3}, rest_px=0.05) == ()
    assert blamed({"b": 0.7}, rest_px=0.05) == ("b",)


def test_an_outline_that_is_too_large_is_outward_for_its_own_camera():
    errors = {("a", "b"): np.full((4, 2), 2.0), ("b", "c"): np.full((4, 2), -2.0)}
    assert np.median(signed_errors(errors, "a", ["b"])) == 2
    assert np.median(signed_errors(errors, "b", ["a", "c"])) == -2
    assert np.median(signed_errors(errors, "c", ["b"])) == 2
    assert group_error(errors, ["a", "b", "c"]) == 2
    assert np.isnan(group_error(errors, ["a", "c"]))


def test_a_fifth_of_the_errors_may_be_lost_limbs():
    assert trimmed_mean(np.r_[np.full(8, -1.0), 90, -90]) == 1
    assert trimmed_mean(np.r_[np.full(7, -1.0), 9, 90, -90]) == 2


@pytest.mark.parametrize(("size", "scale"), [((480, 360), 1), ((1920, 1440), 4), ((240, 180), 1)])
def test_limits_grow_with_the_picture(size, scale):
    track = SimpleNamespace(camera=SimpleNamespace(size=size))
    assert image_scale([track]) == scale  # type: ignore[list-item]
