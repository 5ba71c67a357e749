"""Observed silhouettes as tables of sums."""

import numpy as np

from silhouette_core.image.distance import pixel_weights
from silhouette_core.scoring.target import Target


def test_the_sums_are_those_of_the_signed_weights():
    rng = np.random.default_rng(0)
    mask = rng.random((12, 17)) > 0.5
    target = Target.from_mask(mask)
    weights = pixel_weights(mask).astype(float)
    (prefix,), bases = target.prefixes
    assert target.margin_px == 0 and target.scale == 1 / mask.size
    np.testing.assert_allclose(np.diff(prefix), np.where(mask, -weights, weights))
    np.testing.assert_allclose(bases, [weights[mask].sum()])
