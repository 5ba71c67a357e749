"""Alignments of nodes against a brute-force twin."""

import numpy as np
import pytest
from scipy.sparse import identity

from silhouette_core.image.distance import pixel_weights
from silhouette_core.monocular.silhouette_weights import relative_weights
from silhouette_core.monocular.tree.evidence import (
    SHIFTS_PX,
    Evidence,
)
from silhouette_core.monocular.tree.forward import ForwardFilter
from silhouette_core.monocular.tree.rendering import STATURE_PX, masks_of, silhouette_levels
from silhouette_core.monocular.tree.tree_filter import TreeFilter
from silhouette_core.monocular.window import look_at
from silhouette_core.scoring.cpu import CpuBackend
from tests.silhouette_core.monocular.filming import STATURE_M, camera_at, films, performed


@pytest.fixture(scope="module")
def windows():
    camera = camera_at(
        (0.6, -3.8, 1.2), (0.75, 0, 0.95), (400, 300)
    )  # the person near the border: some of the window is not seen
    motion = performed("wave")
    mask = films(motion, camera, [20])[0]
    return [look_at(camera, mask, distance, STATURE_PX / STATURE_M) for distance in (4.0, 3.7)]


def twin(windows, images, reduction, weighting):
    """The least weighted disagreement of every image (K, h, w) with the windows, every pixel looked
    at.
    """
    result = []
    for window in windows:
        picture, weights = relative_weights(window, weighting, reduction)
        wide, margins = np.pad(picture, 1), np.pad(weights, 1, mode="edge")
        for right, down in SHIFTS_PX:
            moved = np.zeros((len(images), *wide.shape), bool)
            moved[
                :, 1 + down : 1 + down + picture.shape[0], 1 + right : 1 + right + picture.shape[1]
            ] = images
            result.append(np.where(moved ^ wide, margins, 0).sum((1, 2)))
    return np.array(result)


@pytest.mark.parametrize(("level", "reduction"), [(0, 4), (1, 2), (2, 1)])
@pytest.mark.parametrize("weighting", ["nwxor", "balanced"])
def test_distances_are_those_of_a_search_pixel_by_pixel(
    library, windows, level, reduction, weighting
):
    assert not windows[0].seen.all()
    own = library.levels[level]
    nodes = np.random.default_rng(level).permutation(len(own))[:40]
    result = Evidence(windows, CpuBackend(), weighting).distances(own.spans, nodes, reduction)
    every = twin(windows, masks_of(own.spans, nodes, own.size_px), reduction, weighting)
    np.testing.assert_allclose(result.distance, every.min(0), atol=1e-6)
    row = result.scale * len(SHIFTS_PX) + [
        SHIFTS_PX.tolist().index((shift // reduction).tolist()) for shift in result.shift_px
    ]
    np.testing.assert_allclose(every[row, np.arange(len(nodes))], every.min(0), atol=1e-6)
    assert len(np.unique(result.shift_px, axis=0)) > 3
    # What nwXOR lets stand out of the silhouette costs little, so that the larger fits better.
    assert (
        np.mean(result.scale == 1) > 0.9 if weighting == "nwxor" else 0 < np.mean(result.scale) < 1
    )


def test_weights_are_the_papers_over_the_silhouettes_own(windows):
    window = windows[0]
    picture, weights = relative_weights(window, "nwxor", 1)
    paper = pixel_weights(window.mask, "nwxor")
    assert (picture == window.mask).all()
    assert weights[picture].sum() == pytest.approx(1.0)
    np.testing.assert_allclose(
        weights[window.seen] / weights[picture].max(),
        paper[window.seen] / paper[picture].max(),
        rtol=1e-5,
    )
    assert (weights[~window.seen] == 0).all()


def test_a_frame_is_weighed_in_the_librarys_rectangle(library, windows, monkeypatch):
    spans, nodes = library.levels[2].spans, np.arange(10)
    own = Evidence(windows[:1], CpuBackend(), "nwxor", bounds_px=library.bounds_px).distances(
        spans, nodes, 1
    )
    assert (
        own.distance
        > Evidence(windows[:1], CpuBackend(), "nwxor").distances(spans, nodes, 1).distance
    ).all()
    seen = []
    monkeypatch.setattr(
        "silhouette_core.monocular.tree.forward.Evidence",
        lambda *args: seen.append(args) or Evidence(*args),
    )
    tree = TreeFilter(library, identity(len(library), format="csr"), CpuBackend())
    camera = camera_at((0, -4, 1.2))
    mask = films(performed("walk"), camera, [5])[0]
    ForwardFilter(tree, camera, weighting="nwxor").step(0.0, mask)
    assert seen[0][3] == library.bounds_px


def test_resolutions_are_reduced_as_the_librarys(windows):
    for reduction, mask in zip((4, 2, 1), silhouette_levels(windows[0].mask), strict=True):
        assert (relative_weights(windows[0], "xor", reduction)[0] == mask).all()
