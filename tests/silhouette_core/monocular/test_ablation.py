"""What each part of the filter adds, on motion that the library does not contain: with the part
switched off, the same outcome is clearly worse. Parts that need a learned proposal are in
test_with_proposal.py.
"""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.monocular.person import upright_distance
from silhouette_core.monocular.tree import descent
from silhouette_core.monocular.tree.paper_filter import PaperFilter, initial_prior
from silhouette_core.monocular.tree.transitions import transitions
from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.scoring.cpu import CpuBackend
from tests.silhouette_core.monocular.filming import camera_at, films, performed

FRONT = camera_at((0, -4.0, 1.3), size=(320, 240))
STEP, INTERVAL_S = 2, 1 / 15


@pytest.fixture(scope="module")
def stroll():
    """Somebody strolls toward the camera, which sees both legs alike: joints and silhouettes."""
    motion, rows = performed("stroll"), range(0, 50, STEP)
    return motion.landmarks()[list(rows)], films(motion, FRONT, rows)


def follow(library, masks, kind=PaperFilter):
    """The filter, and its posteriors."""
    matrix = transitions(library, True, normalised=False, interval_s=INTERVAL_S)
    distance_m = upright_distance(FRONT, masks[0], library.model.length_m)
    given = library, matrix, FRONT, distance_m, initial_prior(library), CpuBackend()
    tracker = kind(*given, interval_s=INTERVAL_S)
    return tracker, [tracker.step(INTERVAL_S * k, mask) for k, mask in enumerate(masks)]


def expected_error_m(tracker, frame, truth):
    """Mean distance of the joints about the pelvis, expected over the posterior."""
    rows = np.arange(min(200, len(frame.samples)))
    model = tracker.library.model
    joints = landmarks(model, *place(model, *frame.poses(rows).arrays))
    apart = np.linalg.norm((joints - joints[:, :1]) - (truth - truth[:1]), axis=-1).mean(axis=1)
    return np.average(apart, weights=frame.probability[rows].sum(axis=1))


def facing(library, frame):
    """Probability of facing the camera."""
    yaw = library.views[library.sample_view[frame.samples], 0]
    return frame.probability[np.cos(yaw) > 0].sum()


class WithoutMotion(PaperFilter):
    """After the first frame, every pose is as likely before."""

    def _predict(self, last, elapsed_s, window):
        even = super()._predict(last, elapsed_s, window).sum(axis=0) / len(self.library)
        return np.tile(even, (len(self.library), 1))


def test_the_prior_decides_what_silhouettes_leave_open(library, stroll):
    """From the front, a leg in front looks like the other one behind, and facing the camera like
    facing away. With a uniform prior both halves of the posterior stay equally likely.
    """
    truth, masks = stroll
    error, least_facing = {}, {}
    for kind in (PaperFilter, WithoutMotion):
        tracker, frames = follow(library, masks, kind)
        later = list(zip(frames, truth, strict=True))[5:]
        error[kind] = np.mean([expected_error_m(tracker, *pair) for pair in later])
        least_facing[kind] = min(facing(library, frame) for frame, _ in later)
    assert error[PaperFilter] < 0.09
    assert error[PaperFilter] < 0.6 * error[WithoutMotion]
    assert least_facing[PaperFilter] > 0.9 > 0.7 > least_facing[WithoutMotion]


def test_pruning_scores_few_leaves_and_loses_nothing(library, stroll, monkeypatch):
    """Against the exhaustive search under the same prior. Without thresholds every leaf is scored;
    with thresholds that are too high, probable leaves are lost.
    """
    scored, lost, same = [], [], []
    every = replace(descent.FILTER, survivors=1e-300)

    class Compared(PaperFilter):
        def _update(self, prior, window):
            pruned = super()._update(prior, window)
            with monkeypatch.context() as exhaustive:
                exhaustive.setattr(descent, "FILTER", every)
                whole = super()._update(prior, window)
            scored.append(len(pruned.leaves) / len(library.levels[-1]))
            same.append(pruned.samples[0] == whole.samples[0])
            lost.append(whole.probability[~np.isin(whole.samples, pruned.samples)].sum())
            return pruned

    follow(library, stroll[1][:16], Compared)
    assert np.mean(scored[1:]) < 0.2
    assert np.mean(same) >= 0.9
    assert np.mean(lost) < 0.03 and max(lost) < 0.1
