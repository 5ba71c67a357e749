"""Several poses per frame, with their probabilities."""

import numpy as np

from calib.upright import Z_UP, UprightFrame
from silhouette_core.monocular.monocular_estimator import HypothesisStore


def test_the_store_gives_back_what_was_put_as_often_as_asked():
    rng, store, put = np.random.default_rng(0), HypothesisStore(UprightFrame.from_up(Z_UP)), []
    for frame in (3, 4, 9):
        count = int(rng.integers(1, 6))
        put.append((frame, rng.random(count), rng.normal(size=(count, 15, 3))))
        store.put(*put[-1])
    for _ in range(2):
        for (frame, probability, joints), result in zip(put, store, strict=True):
            assert result[0] == frame
            np.testing.assert_allclose(result[1], probability, rtol=1e-6)
            np.testing.assert_allclose(result[2], joints, rtol=1e-6, atol=1e-6)
