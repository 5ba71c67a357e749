"""Observed silhouettes as tables of sums."""

import numpy as np

from silhouette_core.scoring.backend import Target


def test_the_sums_are_those_of_the_signed_weights():
    rng = np.random.default_rng(0)
    mask = rng.random((12, 17)) > 0.5
    weights = rng.random(mask.shape)
    target = Target((mask,), (weights,))
    (prefix,), bases = target.prefixes
    assert target.margin_px == 0
    np.testing.assert_allclose(np.diff(prefix), np.where(mask, -weights, weights))
    np.testing.assert_allclose(bases, [weights[mask].sum()])
