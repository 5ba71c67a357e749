"""The experiment's filter has what the paper says and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import identity

from papers.arm_swing import SilhouetteVideo
from papers.paper_filter import (
    INITIAL_SIGMA_RAD,
    PaperEvidence,
    PaperFilter,
    initial_prior,
    largest_component,
)
from silhouette_core.image.background import BackgroundModel
from silhouette_core.image.cleanup import reduce_silhouette
from silhouette_core.image.distance import pixel_weights
from silhouette_core.monocular.making.build import build_library
from silhouette_core.monocular.tree.rendering import masks_of
from silhouette_core.monocular.tree.transitions import transitions
from silhouette_core.monocular.tree.tree_filter import TreeFilter
from silhouette_core.monocular.window import Window
from silhouette_core.progress import SilentReporter
from tests.silhouette_core.monocular.filming import camera_at
from tests.silhouette_core.monocular.making.small_library import SETTINGS, small_bases, swaying
from voxelpose.demo.room import make_recording
from voxelpose.recording.folder import Recording

DISTANCE_M = 264 * 1.75 / 158  # at which the camera's focal length is the window's


@pytest.fixture(scope="module")
def library():
    settings = replace(SETTINGS, poses=240)
    return build_library(small_bases(settings), swaying().model, settings)


@pytest.fixture(scope="module")
def camera():
    """Sees a window's silhouette of the library as it is."""
    return camera_at((0, -DISTANCE_M, 1.0), size=(320, 240))


def seen(library, sample):
    return library.render(np.array([sample])).windows[0] > 0


def follow(library, camera, matrix, masks, monkeypatch, numbers=None):
    """Estimates and the priors from which they came."""
    priors, update = [], TreeFilter.update
    monkeypatch.setattr(TreeFilter, "update", lambda *args: priors.append(args[1]) or update(*args))
    tracker = PaperFilter(library, matrix, camera, DISTANCE_M, "nwxor", 0.05)
    numbers = range(len(masks)) if numbers is None else numbers
    return [tracker.step(*pair) for pair in zip(numbers, masks, strict=True)], priors


def test_largest_component_alone_is_kept():
    mask = np.zeros((20, 30), bool)
    mask[2:10, 2:10] = mask[2:8, 12:16] = True
    assert (largest_component(mask) == (mask & (np.arange(30) < 11))).all()
    assert not largest_component(np.zeros((4, 5), bool)).any()


@pytest.mark.parametrize(("level", "reduction"), [(0, 4), (1, 2), (2, 1)])
def test_distance_is_the_density_of_weighted_disagreement_without_shifts(library, level, reduction):
    mask = np.roll(seen(library, 7), (3, 2), (0, 1))
    window = Window(mask, np.ones_like(mask), np.eye(3), np.zeros(3), 1.0, np.zeros(2), 1.0)
    spans, size_px = library.levels[level].spans, library.levels[level].size_px
    nodes = np.arange(len(spans))
    result = PaperEvidence((window,), "nwxor", bounds_px=library.bounds_px).distances(
        spans, nodes, reduction
    )
    for _ in range(2 - level):
        mask = reduce_silhouette(mask)
    weights = pixel_weights(mask, "nwxor", library.bounds_px).astype(float)
    images = masks_of(spans, nodes, size_px)
    expected = [weights[mask ^ image].sum() / mask.size for image in images]
    np.testing.assert_allclose(result.distance, expected, rtol=1e-9, atol=1e-12)
    assert not result.shift_px.any() and not result.scale.any()


def test_initial_prior_is_a_gaussian_about_upright_and_facing(library):
    prior = initial_prior(library)
    assert prior.sum() == pytest.approx(1)
    base = library.sample_base == library.sample_base[prior.argmax()]
    by_view = [prior[base & (library.sample_view == k)][0] for k in range(len(library.views))]
    assert np.argmax(by_view) == np.argmax(np.cos(library.views[:, 0]))
    assert pytest.approx(np.radians(45)) == INITIAL_SIGMA_RAD


def test_prior_is_the_motion_model_alone(library, camera, monkeypatch):
    """No floor: what the motion model does not reach has no probability."""
    matrix = transitions(library, True, neighbours=8)
    masks = [seen(library, sample) for sample in (5, 5, 40)]
    _, priors = follow(library, camera, matrix, masks, monkeypatch, (0, 1, 4))
    np.testing.assert_array_equal(priors[0], initial_prior(library))
    assert (priors[1] == 0).any()
    assert [prior.sum() for prior in priors] == pytest.approx([1, 1, 1])


def test_lost_track_is_not_started_again(library, camera, monkeypatch):
    stay = identity(len(library), format="csr")
    box = np.zeros((240, 320), bool)
    box[60:100, 30:290] = True
    masks = [seen(library, 5), box, box, seen(library, 100)]
    samples, priors = follow(library, camera, stay, masks, monkeypatch)
    possible = priors[1] > 0
    assert all(not (prior[~possible] > 0).any() for prior in priors[1:])
    assert possible[samples[1:]].all() and 100 not in np.flatnonzero(possible)


def test_frames_that_are_missing_are_steps_of_the_motion_model(library, camera, monkeypatch):
    steps, predict = [], TreeFilter.predict
    monkeypatch.setattr(
        TreeFilter, "predict", lambda *args: steps.append(args[2]) or predict(*args)
    )
    masks = [seen(library, 5)] * 3
    follow(library, camera, transitions(library, True), masks, monkeypatch, (0, 1, 4))
    assert steps == [1, 3]


def test_silhouettes_are_those_of_the_paper_unless_with_additions(tmp_path):
    folder = make_recording(tmp_path / "film", 1, performance="arm_swing")
    recording = Recording.open(folder)
    own, refined = (
        SilhouetteVideo.from_recording(recording, 1.75, SilentReporter(), additions).mask(0)
        for additions in (False, True)
    )
    model = BackgroundModel.from_frames(recording.backgrounds()["cam_3"], "paper")
    (_, _, frames), *_ = recording
    expected = largest_component(model.silhouette(frames["cam_3"]))
    assert (own == expected).mean() > 0.999 and (own != refined).any()
