"""Observed silhouettes as tables of sums."""

import numpy as np
import pytest

from silhouette_core.image.distance import pixel_weights
from silhouette_core.scoring.target import Target


def test_the_sums_are_those_of_the_signed_weights():
    rng = np.random.default_rng(0)
    mask = rng.random((12, 17)) > 0.5
    target = Target.from_mask(mask)
    weights = pixel_weights(mask).astype(float)
    table, bases = target.sums
    assert target.margin_px == 0 and target.scale == 1 / mask.size
    np.testing.assert_allclose(np.diff(table[..., 0]), np.where(mask, -weights, weights))
    np.testing.assert_allclose(bases, [weights[mask].sum()])


def test_what_does_not_belong_together_is_refused():
    mask, weights = np.zeros((3, 4), bool), np.ones((3, 4))
    for wrong, error, message in [
        (((weights,), (weights,)), TypeError, r"mask must be \(3, 4\) bool"),
        (((mask,), (weights[1:],)), ValueError, r"weights must be \(3, 4\)"),
        (((mask, mask[1:]), (weights, weights)), ValueError, r"mask must be \(3, 4\)"),
        (((mask,), (weights,), np.zeros((2, 3), int)), ValueError, r"shifts_px must be \(S, 2\)"),
    ]:
        with pytest.raises(error, match=message):
            Target(*wrong)
