"""Several poses per frame, with their probabilities."""

import numpy as np
import pytest

from silhouette_core.filter.forward import ForwardFilter
from silhouette_core.filter.hypothesis_store import HypothesisStore, top_hypotheses
from silhouette_core.filter.person import Person
from tests.silhouette_core.filter.filming import camera_at, films, performed


@pytest.fixture(scope="module")
def filter_frames(tree):
    camera = camera_at((0, -4.0, 1.4))
    forward = ForwardFilter(tree, camera, facing=False)
    rows = range(0, 40, 8)
    return [
        forward.step(k, 0.1 * k, Person(mask, False))
        for k, mask in enumerate(films(performed("reach aside"), camera, rows))
    ]


def test_probabilities_fall_and_do_not_exceed_one(tree, filter_frames):
    counts = []
    for filter_frame in filter_frames:
        probability, joints = top_hypotheses(tree, filter_frame)
        assert joints.shape == (len(probability), 15, 3) and 1 <= len(probability) <= 5
        assert (np.diff(probability) <= 0).all() and 0 < probability.sum() <= 1 + 1e-9
        counts.append(len(probability))
        apart = np.linalg.norm(joints[:, None] - joints[None], axis=-1).mean(-1)
        assert (apart[~np.eye(len(joints), dtype=bool)] > 0.09).all()
    assert max(counts) > 1


def test_a_single_one_is_the_likeliest(tree, filter_frames):
    probability, joints = top_hypotheses(tree, filter_frames[0], 1)
    several = top_hypotheses(tree, filter_frames[0])
    assert len(probability) == 1 and probability[0] == several[0][0]
    assert (joints[0] == several[1][0]).all()


def test_the_store_gives_back_what_was_put_as_often_as_asked():
    rng, store, put = np.random.default_rng(0), HypothesisStore(), []
    for frame in (3, 4, 9):
        count = int(rng.integers(1, 6))
        put.append((frame, rng.random(count), rng.normal(size=(count, 15, 3))))
        store.put(*put[-1])
    for _ in range(2):
        for (frame, probability, joints), result in zip(put, store, strict=True):
            assert result[0] == frame
            np.testing.assert_allclose(result[1], probability, rtol=1e-6)
            np.testing.assert_allclose(result[2], joints, rtol=1e-6, atol=1e-6)
