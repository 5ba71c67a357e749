"""Items made ahead are the same, in the same order, and errors arrive where they belong."""

import itertools

import numba
import numpy as np
import pytest

from silhouette_core.image.raster import render_many
from silhouette_core.jit import set_threads
from silhouette_core.read_ahead import read_ahead


@pytest.fixture(params=[1, 2])
def threads(request):
    before = numba.get_num_threads()
    nothing = np.zeros((1, 3, 3))
    render_many(nothing, np.zeros((0, 3), int), np.zeros(0, int), np.eye(3), (4, 4))
    yield set_threads(request.param)
    set_threads(before)


def test_items_and_their_order_stay(threads):
    assert list(read_ahead(iter(range(20)))) == list(range(20))
    assert list(read_ahead(iter(()))) == []


def test_an_error_arrives_after_the_items_before_it(threads):
    def failing():
        yield from range(5)
        raise RuntimeError("no more frames")

    seen = []
    with pytest.raises(RuntimeError, match="no more frames"):
        seen.extend(read_ahead(failing()))
    assert seen == [0, 1, 2, 3, 4]


def test_whoever_stops_reading_ends_it(threads):
    made = []
    items = read_ahead(made.append(k) or k for k in itertools.count())
    assert [next(items) for _ in range(3)] == [0, 1, 2]
    items.close()
    assert len(made) < 10
