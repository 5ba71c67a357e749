"""Trees of the views: against literal twins, and the same whoever builds them."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.image.cleanup import reduce_silhouette
from silhouette_core.monocular.making.build import build_library
from silhouette_core.monocular.tree.pose_library import LibrarySettings
from silhouette_core.monocular.tree.rendering import (
    halve_silhouette,
    masks_of,
    silhouette_levels,
    spans_of,
)
from silhouette_core.monocular.tree.store import read_library, write_library
from silhouette_core.monocular.tree.transitions import (
    NeighbourWeights,
    find_neighbours,
    transitions,
)
from silhouette_core.monocular.tree.view_tree import divide_view, group_by_medoids
from silhouette_core.workers import OwnProcess, open_workers
from tests.silhouette_core.monocular.making.small_library import SETTINGS, small_bases, swaying

VIEWS = replace(SETTINGS, tree="views", weighting="xor")
SIZE = (80, 60)


@pytest.fixture(scope="module")
def made():
    return build_library(small_bases(), swaying().model, VIEWS)


@pytest.fixture(scope="module")
def masks(made):
    """Silhouettes of the 40 base poses from one side."""
    return silhouette_levels(made.render(np.arange(1, len(made), 6)).windows > 0)[0]


def same(one, other):
    """Whether two libraries hold the same bytes."""
    pairs = [
        (getattr(one, name), getattr(other, name))
        for name in ("areas", "pelvis_px", "cut", "occluded", "leaf_samples", "leaf_offsets")
    ]
    for level, twin in zip(one.levels, other.levels, strict=True):
        names = "rows", "starts", "ends", "offsets"
        pairs += [(getattr(level.spans, name), getattr(twin.spans, name)) for name in names]
        pairs += [(level.representative, twin.representative), (level.parent, twin.parent)]
        assert level.threshold == twin.threshold
    pairs += [(one.neighbours[name], other.neighbours[name]) for name in one.neighbours]
    return all(a.dtype == b.dtype and a.tobytes() == b.tobytes() for a, b in pairs)


def test_groups_have_the_medoids_of_least_mean_distance(masks):
    everybody = np.arange(len(masks))
    groups, medoids, radius = group_by_medoids(everybody, 5, spans_of(masks), SIZE)
    apart = (masks[:, None] ^ masks).sum(axis=(2, 3))
    assert sorted(np.concatenate(groups)) == list(everybody)
    for group in groups:
        nearest = apart[group][:, medoids].argmin(axis=1)
        assert len(set(nearest)) == 1
    largest = max(apart[medoid, group].max() for medoid, group in zip(medoids, groups, strict=True))
    assert radius == pytest.approx(largest / masks[0].size)
    # One round more changes the medoids hardly: those found minimise the sum over their group.
    best = [group[apart[np.ix_(group, group)].sum(axis=0).argmin()] for group in groups]
    sums = [
        [apart[one][group].sum() for one, group in zip(chosen, groups, strict=True)]
        for chosen in (medoids, best)
    ]
    assert np.sum(sums[0]) < 1.05 * np.sum(sums[1])


def test_two_levels_of_nodes_hold_every_sample_once(masks):
    nodes = divide_view(spans_of(masks), SIZE, first_nodes=4)
    assert sorted(nodes.order) == list(range(len(masks)))
    assert len(nodes.first) == 4 and (np.diff(nodes.offsets) > 0).all()
    assert set(nodes.parent) == set(range(4)) and (np.diff(nodes.parent) >= 0).all()
    for node, (first, last) in enumerate(zip(nodes.offsets[:-1], nodes.offsets[1:], strict=True)):
        assert nodes.second[node] in nodes.order[first:last]
    assert 8 <= len(nodes.second) <= 24  # sqrt(40 / 4) samples each


def test_every_view_has_a_tree_of_its_own_whose_leaves_are_its_samples(made):
    assert sorted(made.leaf_samples) == list(range(len(made)))
    assert (np.diff(made.leaf_offsets) == 1).all()
    for level, below in zip(made.levels[:-1], made.levels[1:], strict=True):
        own, parents = made.sample_view[below.representative], level.representative[below.parent]
        assert (own == made.sample_view[parents]).all()
    assert (made.leaf_samples == made.levels[2].representative).all()


def test_leaves_hold_the_silhouettes_of_their_samples(made):
    level = made.levels[2]
    drawn = masks_of(level.spans, np.arange(len(level)), level.size_px)
    whole = made.render(made.leaf_samples).windows > 0
    for halve, factor in ((halve_silhouette, 1.0), (reduce_silhouette, 1.04)):
        area = halve(whole).sum(axis=(1, 2))
        assert np.mean(area / drawn.sum(axis=(1, 2))) == pytest.approx(factor, abs=0.01)
    # Both windows are centred to a pixel of their own: half a small one apart in the mean.
    expected = halve_silhouette(whole)
    moved = [np.roll(expected, shift, (1, 2)) for shift in product((-1, 0, 1), repeat=2)]
    apart = np.min([(drawn ^ one).sum(axis=(1, 2)) for one in moved], axis=0)
    assert np.median(apart / expected.sum(axis=(1, 2))) < 0.1


def test_neighbours_are_those_of_a_library_of_one_tree(made):
    expected = find_neighbours(made, kept=32)
    for name, array in expected.items():
        if name.endswith("square"):
            np.testing.assert_allclose(made.neighbours[name], array, rtol=1e-4, atol=1e-3)
    for aware in (False, True):
        weights = NeighbourWeights(made, aware, 2.5, 1 / 15)
        after, probability = weights.after(np.array([3, 77]))
        dense = np.zeros((2, len(made)))
        for row in range(2):
            np.add.at(dense[row], after[row], probability[row])
        matrix = transitions(made, aware, 2.5, interval_s=1 / 15)[[3, 77]].toarray()
        np.testing.assert_allclose(dense, matrix, rtol=1e-5, atol=1e-7)


def test_file_holds_the_same_library(made, tmp_path):
    write_library(made, tmp_path / "views.vplib")
    read = read_library(tmp_path / "views.vplib")
    assert same(made, read) and read.settings == made.settings


class Backwards(OwnProcess):
    """Carries out the last task first, and counts."""

    def __init__(self):
        self.count = 0

    def run(self, work, tasks):
        for number in reversed(range(len(tasks))):
            self.count += 1
            yield number, work(tasks[number])


def test_result_does_not_depend_on_the_order_of_the_tasks(made):
    again = build_library(small_bases(), swaying().model, VIEWS, workers=Backwards())
    assert same(made, again)


def test_an_interrupted_build_goes_on_with_the_missing_views(made, tmp_path):
    class Interrupted(OwnProcess):
        def run(self, work, tasks):
            yield 2, work(tasks[2])
            raise KeyboardInterrupt

    model, folder = swaying().model, tmp_path / "partial"
    with pytest.raises(KeyboardInterrupt):
        build_library(small_bases(), model, VIEWS, partial=folder, workers=Interrupted())
    workers = Backwards()
    resumed = build_library(small_bases(), model, VIEWS, partial=folder, workers=workers)
    assert same(made, resumed)
    assert workers.count == made.settings.views_count - 1 + 32


def test_settings_of_other_trees_make_other_libraries_but_no_other_names():
    assert repr(LibrarySettings(tree="views")) == repr(LibrarySettings())
    assert LibrarySettings(tree="views") != LibrarySettings()


def test_workers_that_cannot_work_are_refused(monkeypatch):
    with pytest.raises(InputError, match="give 1 or more"), open_workers(0):
        pass
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(InputError, match=r"voxelpose\[cluster\]"), open_workers(1, "tcp://x:1"):
        pass


@pytest.mark.slow
def test_two_processes_build_the_same_bytes(made):
    with open_workers(2) as workers:
        again = build_library(small_bases(), swaying().model, VIEWS, workers=workers)
    assert same(made, again)


@pytest.mark.slow
def test_two_workers_of_a_cluster_build_the_same_bytes(made):
    distributed = pytest.importorskip(
        "distributed", reason="Dask is not installed: pip install 'voxelpose[cluster]'"
    )
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None
        ) as cluster,
        open_workers(1, cluster.scheduler_address) as workers,
    ):
        again = build_library(small_bases(), swaying().model, VIEWS, workers=workers)
    assert same(made, again)
