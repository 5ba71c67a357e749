"""The tree against a literal twin: section 3, steps 1 to 4, image by image."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silhouette_core.jit import set_threads
from silhouette_core.monocular.tree.build import build_library
from silhouette_core.monocular.tree.pose_library import nwxor_weights
from silhouette_core.monocular.tree.rendering import masks_of, silhouette_levels
from silhouette_core.monocular.tree.tree import PoseSpace
from tests.silhouette_core.monocular.tree.small_library import (
    SETTINGS,
    small_bases,
    small_library,
    swaying,
)


@pytest.fixture(scope="module")
def made():
    return small_library()


def literal_tree(library):
    """Section 3 as it is written. Every set is a list of samples; silhouettes are images."""
    everybody = np.arange(len(library))
    levels = silhouette_levels(library.render(everybody).windows > 0)
    turn, angles = library.pose(everybody)
    w, x, y, z = turn.T
    first = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1)
    second = np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1)
    pose = np.hstack([angles, np.hstack([first, second, np.cross(first, second)]) / np.sqrt(2)])

    def nearest_mean(samples):
        apart = np.linalg.norm(pose[samples] - pose[samples].mean(0), axis=1)
        return samples[np.argmin(np.round(apart**2, 9))]

    def distances(representative, masks, samples):
        mask = masks[representative]
        weights = nwxor_weights(mask, library.bounds_px).astype(float)
        return {s: weights[mask ^ masks[s]].sum() / mask.size for s in samples}

    sets, result = [list(everybody)], []
    for masks, level in zip(levels, library.levels, strict=True):
        nodes = []
        for number, samples in enumerate(sets):
            representatives = [nearest_mean(samples)]  # (1)
            table = [distances(representatives[0], masks, samples)]
            while True:  # (2)
                far = [s for s in samples if all(row[s] > level.threshold for row in table)]
                if not far:
                    break
                representatives.append(
                    max(far, key=lambda s: round(np.mean([row[s] for row in table]), 9))
                )
                table.append(distances(representatives[-1], masks, samples))
            groups = [[s] for s in representatives]
            for s in samples:  # (3)
                if s not in representatives:
                    groups[int(np.argmin([row[s] for row in table]))].append(s)
            nodes += [
                (number, nearest_mean(sorted(group)), sorted(group)) for group in groups
            ]  # (4)
        result.append(nodes)
        sets = [samples for _, _, samples in nodes]
    return result


@given(st.integers(0, 10**6), st.integers(1, 12))
@settings(deadline=None)
def test_the_nearest_to_the_mean_is_so_in_angles_and_orientation(seed, count):
    rng = np.random.default_rng(seed)
    angles, base = rng.normal(size=(20, 5)).astype(np.float32), rng.integers(0, 20, 30)
    orientation = rng.normal(size=(30, 9)) * rng.choice([0.1, 1.0, 3.0])
    samples = np.sort(rng.permutation(30)[:count])
    pose = np.hstack([angles[base], orientation])[samples]
    apart = np.linalg.norm(pose - pose.mean(axis=0), axis=1)
    nearest = PoseSpace(angles, base.astype(np.int32), orientation).nearest_to_mean(samples)
    assert nearest == samples[0] if count < 3 else apart[samples == nearest] == apart.min()


def test_the_tree_is_the_literal_one(made):
    literal = literal_tree(made)
    for level, nodes in zip(made.levels, literal, strict=True):
        assert level.parent.tolist() == [parent for parent, _, _ in nodes]
        assert level.representative.tolist() == [representative for _, representative, _ in nodes]
    for below, offsets in zip(made.levels[1:], made.child_offsets, strict=False):
        assert (np.repeat(np.arange(len(offsets) - 1), np.diff(offsets)) == below.parent).all()
    leaves = np.split(made.leaf_samples, made.leaf_offsets[1:-1])
    assert [leaf.tolist() for leaf in leaves] == [samples for _, _, samples in literal[-1]]


def test_the_silhouettes_are_those_of_the_representatives(made):
    for number, level in enumerate(made.levels):
        masks = silhouette_levels(made.render(level.representative).windows > 0)[number]
        assert (masks_of(level.spans, np.arange(len(level)), level.size_px) == masks).all()
        assert level.spans.rows.dtype == np.int16


def test_given_thresholds_are_used_and_level_by_level_nodes_are_finer():
    thresholds = (0.06, 0.03, 0.0)
    library = small_library(poses=120, yaw_step_deg=90, thresholds=thresholds, weighting="xor")
    assert [level.threshold for level in library.levels] == [0.06, 0.03, 0.0]
    assert len(library.levels[0]) < len(library.levels[1]) < len(library.levels[2])
    # With no threshold only equal silhouettes share a leaf.
    masks = library.render(np.arange(len(library))).windows > 0
    for first, last in zip(library.leaf_offsets[:-1], library.leaf_offsets[1:], strict=True):
        leaf = library.leaf_samples[first:last]
        assert (masks[leaf] == masks[leaf[0]]).all()


def test_as_many_pairs_are_within_the_thresholds_by_any_distance():
    thresholds = (0.0601, 0.0301, 0.0)
    library = small_library(poses=60, thresholds=thresholds)
    levels = silhouette_levels(library.render(np.arange(len(library))).windows > 0)
    for masks, level, by_xor in zip(levels, library.levels, thresholds, strict=True):
        within = sum((one ^ masks).mean(axis=(1, 2)) <= by_xor for one in masks).sum()
        weights = [nwxor_weights(one, library.bounds_px).astype(float) for one in masks]
        own = [
            ((one ^ masks) * weight).mean(axis=(1, 2))
            for one, weight in zip(masks, weights, strict=True)
        ]
        assert level.threshold == pytest.approx(np.sort(np.ravel(own))[within - 1], rel=1e-5)
        assert (level.threshold > 0) == (by_xor > 0)


def test_threads_and_interruption_make_no_difference(tmp_path):
    settings = replace(SETTINGS, poses=60)
    bases, model = small_bases(settings), swaying().model
    set_threads(1)
    try:
        alone = build_library(bases, model, settings)
    finally:
        set_threads()

    class Impatient:
        """Interrupts at every new stage, the later the more often it was called."""

        patience = 0

        def stage(self, name, total=None):
            self.left -= 1
            if self.left < 0:
                raise KeyboardInterrupt

        def advance(self, steps=1):
            pass

        note = advance

    reporter, library = Impatient(), None
    while library is None:
        reporter.left = reporter.patience
        try:
            library = build_library(bases, model, settings, reporter, tmp_path / "lib.partial")
        except KeyboardInterrupt:
            reporter.patience += 1
    assert reporter.patience > 3
    for name in ("areas", "pelvis_px", "occluded", "leaf_samples", "leaf_offsets"):
        assert (getattr(library, name) == getattr(alone, name)).all()
    for one, other in zip(library.levels, alone.levels, strict=True):
        assert (
            one.representative == other.representative
        ).all() and one.threshold == other.threshold
    assert all(
        (library.neighbours[name] == alone.neighbours[name]).all() for name in alone.neighbours
    )
