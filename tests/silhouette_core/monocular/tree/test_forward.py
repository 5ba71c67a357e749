"""The forward pass: distance, lost tracks, the first frame."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from silhouette_core.monocular.tree.forward import FilterFrame, ForwardFilter, candidates_of, slim
from silhouette_core.monocular.tree.tree_filter import Posterior, TreeFilter
from silhouette_core.monocular.tuning import DISTANCES
from silhouette_core.scoring.cpu import CpuBackend
from tests.silhouette_core.monocular.filming import camera_at, films, performed, window_pixels

CAMERA = camera_at((0, -4.0, 1.3))


@pytest.fixture(scope="module")
def walk():
    motion = performed("walk")
    rows = range(45)
    return motion.root_m[rows], films(motion, CAMERA, rows)


def follow(forward, masks, step_s=1 / 30):
    return [forward.step(step_s * k, mask) for k, mask in enumerate(masks)]


def test_somebody_who_comes_nearer_is_seen_to(tree, walk):
    places, masks = walk
    filter_frames = follow(ForwardFilter(tree, CAMERA), masks)
    truth = np.linalg.norm(places - CAMERA.center_m, axis=1)
    result = np.array([filter_frame.distance_m for filter_frame in filter_frames])
    assert np.ptp(truth) > 0.8
    np.testing.assert_allclose(result, truth, rtol=0.10)
    assert not any(filter_frame.lost for filter_frame in filter_frames)


def test_a_distance_that_is_told_is_kept(tree, walk):
    filter_frames = follow(ForwardFilter(tree, CAMERA, distance_m=3.9), walk[1][:2])
    assert [filter_frame.distance_m for filter_frame in filter_frames] == pytest.approx(
        [3.9, 3.9]
    ) and len(filter_frames[0].windows) == 1


@pytest.mark.parametrize("fps", [10, 15, 25, 30, 60])
def test_every_frame_interval_is_one_step_of_the_motion_model(tree, walk, fps, monkeypatch):
    steps, predict = [], tree.predict
    monkeypatch.setattr(tree, "predict", lambda *args: steps.append(args[1]) or predict(*args))
    forward = ForwardFilter(tree, CAMERA, interval_s=1 / fps)
    for number in (0, 1, 2, 5, 6):  # two frames are missing
        forward.step(number / fps, walk[1][number])
    assert steps == [1, 1, 3, 1]


def test_what_resembles_nothing_is_lost_and_found_again(tree, walk):
    masks = list(walk[1][:20])
    box = np.zeros_like(masks[0])
    box[150:210, 100:380] = True
    masks[5:14] = [box] * 9  # longer than what was seen before
    lost = [filter_frame.lost for filter_frame in follow(ForwardFilter(tree, CAMERA), masks)]
    assert lost == [5 <= k < 14 for k in range(len(masks))]


def test_a_share_of_the_measured_distance_is_believed_and_all_of_a_first(tree, walk):
    masks = list(walk[1][:6])
    masks[3] = np.zeros_like(masks[3])
    masks[3][150:210, 100:380] = True  # lost
    forward, last = ForwardFilter(tree, CAMERA), None
    for k, mask in enumerate(masks):
        frame = forward.step(k / 30, mask)
        restarted = last is None or last.lost
        places = np.array([window.distance_m for window in frame.windows])
        middle = places[4] if restarted else last.distance_m
        if last is not None and last.lost:
            area_m = forward._first_distance(mask)
            assert middle == pytest.approx(np.sqrt(last.distance_m * area_m))
        scale, probability = frame.posterior.scale, frame.posterior.probability
        change = probability @ np.log(places[scale] / middle)
        expected = middle * np.exp(change * (1.0 if restarted else DISTANCES.gain))
        assert frame.distance_m == pytest.approx(expected)
        last = frame
    assert not frame.lost and not restarted


def test_of_a_frame_the_likeliest_and_the_best_samples_are_kept(tree, walk):
    frame = ForwardFilter(tree, CAMERA).step(0.0, walk[1][0])
    kept = slim(frame, 5).posterior
    whole = frame.posterior
    best = set(whole.samples[np.argsort(whole.distance, kind="stable")[:5]])
    assert set(kept.samples) == best | set(whole.samples[:5])
    assert (np.diff(kept.probability) <= 0).all()


def test_candidates_stand_where_their_silhouettes_are_moved_to(tree, walk):
    filter_frame = follow(ForwardFilter(tree, CAMERA), walk[1][:1])[0]
    result, posterior = candidates_of(tree, filter_frame, np.arange(5)), filter_frame.posterior
    for k, root_m in enumerate(result.root_m):
        pelvis = tree.library.pelvis_px[posterior.samples[k]] + posterior.shift_px[k]
        window = filter_frame.windows[posterior.scale[k]]
        np.testing.assert_allclose(window_pixels(window, root_m)[0], pelvis, atol=1e-3)
    assert posterior.shift_px[:5].any()
    np.testing.assert_allclose(np.linalg.det(result.root_rotation), 1.0, atol=1e-6)
    assert result.angles_rad.shape == (5, tree.library.model.dof_count)


def test_views_of_another_pitch_are_unlikely(library):
    """By the camera's own; the library's only pitch says nothing."""
    pitches = np.radians(np.where(np.arange(len(library.views)) % 2, 8.0, 24.0))
    views = np.column_stack([library.views[:, 0], pitches])
    forward = ForwardFilter(TreeFilter(replace(library, views=views), None, CpuBackend()), CAMERA)
    prior = forward._prior(SimpleNamespace(pitch_rad=np.radians(8.0)), None, 0.0, True)
    own = np.bincount(library.sample_view % 2, prior)
    away = 16.0 / DISTANCES.pitch_sigma_deg
    assert prior.sum() == pytest.approx(1)
    assert own[0] / own[1] == pytest.approx(np.exp(-0.5 * away**2))


def test_half_of_a_lost_track_is_anywhere(tree):
    count = len(tree.library)
    sure = Posterior(*(np.array(one) for one in ([5], [1.0], [0.1], [0], [[0, 0]])), (1, 1, 1))
    window = SimpleNamespace(pitch_rad=tree.library.views[0, 1])
    forward = ForwardFilter(tree, CAMERA)
    prior = {}
    for lost in (True, False):
        last = FilterFrame(0.0, (), sure, 4.0, lost)
        prior[lost] = forward._prior(window, last, 1 / 30, lost)
    np.testing.assert_allclose(prior[True], 0.5 * prior[False] + 0.5 / count, rtol=1e-9)
