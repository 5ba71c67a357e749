"""What each part of the filter adds, on motion that the library does not contain: with the part
switched off, the same outcome is clearly worse. Parts that need a learned proposal are in
test_with_proposal.py.
"""

import numpy as np
import pytest

from silhouette_core.monocular.tree.forward import ForwardFilter, candidates_of
from silhouette_core.monocular.tree.transitions import transitions
from silhouette_core.monocular.tree.tree_filter import TreeFilter
from silhouette_core.monocular.tuning import FilterSettings
from silhouette_core.motion.kinematics import forward, landmarks, quaternions
from silhouette_core.scoring.cpu import CpuBackend
from tests.silhouette_core.monocular.filming import camera_at, films, performed

FRONT = camera_at((0, -4.0, 1.3), size=(320, 240))
STEP, INTERVAL_S = 2, 1 / 15
EVERY_NODE = FilterSettings(survivors=0.0, most=10**9, moved=10**9)


@pytest.fixture(scope="module")
def stroll():
    """Somebody strolls toward the camera, which sees both legs alike: joints and silhouettes."""
    motion, rows = performed("stroll"), range(0, 50, STEP)
    return motion.landmarks()[list(rows)], films(motion, FRONT, rows)


@pytest.fixture
def sparse(library):
    """A tree filter of its own for frames at 15 Hz."""
    matrix = transitions(library, True, interval_s=INTERVAL_S)
    return TreeFilter(library, matrix, CpuBackend())


class FromTheFront(ForwardFilter):
    """Begins with people who face the camera."""

    def _prior(self, window, last, time_s, restarted):
        prior = super()._prior(window, last, time_s, restarted)
        if last is not None:
            return prior
        return self.tree.weigh_views(prior, np.exp(2 * np.cos(self.tree.library.views[:, 0])))


def follow(tree, masks):
    filter_ = FromTheFront(tree, FRONT, interval_s=INTERVAL_S)
    return [filter_.step(INTERVAL_S * k, mask) for k, mask in enumerate(masks)]


def expected_error_m(tree, filter_frame, truth):
    """Mean distance of the joints about the pelvis, expected over the posterior."""
    posterior = filter_frame.posterior
    rows = np.arange(min(200, len(posterior.samples)))
    poses = candidates_of(tree, filter_frame, rows)
    turns = quaternions(poses.root_rotation)
    model = tree.library.model
    joints = landmarks(model, *forward(model, poses.root_m, turns, poses.angles_rad))
    apart = np.linalg.norm((joints - joints[:, :1]) - (truth - truth[:1]), axis=-1).mean(axis=1)
    return np.average(apart, weights=posterior.probability[rows])


def facing(tree, filter_frame):
    """Probability of facing the camera."""
    library, posterior = tree.library, filter_frame.posterior
    yaw = library.views[library.sample_view[posterior.samples], 0]
    return posterior.probability[np.cos(yaw) > 0].sum()


def test_the_prior_decides_what_silhouettes_leave_open(sparse, stroll, monkeypatch):
    """From the front, a leg in front looks like the other one behind, and facing the camera like
    facing away. With a uniform prior both halves of the posterior stay equally likely.
    """
    truth, masks = stroll
    error, least_facing = {}, {}
    for prior in ("motion model", "uniform"):
        if prior == "uniform":
            uniform = np.full(len(sparse.library), 1 / len(sparse.library))
            monkeypatch.setattr(sparse, "predict", lambda *_, uniform=uniform: uniform)
        frames = follow(sparse, masks)
        later = list(zip(frames, truth, strict=True))[5:]
        error[prior] = np.mean([expected_error_m(sparse, *pair) for pair in later])
        least_facing[prior] = min(facing(sparse, frame) for frame, _ in later)
    assert error["motion model"] < 0.09
    assert error["motion model"] < 0.6 * error["uniform"]
    assert least_facing["motion model"] > 0.9 > 0.7 > least_facing["uniform"]


def test_pruning_scores_few_leaves_and_loses_nothing(sparse, stroll, monkeypatch):
    """Against the exhaustive search under the same prior. Without thresholds every leaf is scored;
    with thresholds that are too high, probable leaves are lost.
    """
    exhaustive = TreeFilter(sparse.library, sparse.transitions, CpuBackend(), EVERY_NODE)
    leaf = np.empty(len(sparse.library), np.int64)
    counts = np.diff(sparse.library.leaf_offsets)
    leaf[sparse.library.leaf_samples] = np.repeat(np.arange(len(counts)), counts)
    update, scored, same_leaf, lost = sparse.update, [], [], []

    def compared(prior, evidence):
        pruned, whole = update(prior, evidence), exhaustive.update(prior, evidence)
        scored.append(np.array(pruned.scored) / len(sparse.library.levels[-1]))
        same_leaf.append(leaf[pruned.samples[0]] == leaf[whole.samples[0]])
        lost.append(whole.probability[~np.isin(whole.samples, pruned.samples)].sum())
        return pruned

    monkeypatch.setattr(sparse, "update", compared)
    follow(sparse, stroll[1][:16])
    of_leaves, of_all = np.array(scored)[1:, -1].mean(), np.array(scored)[1:].sum(axis=1).mean()
    assert of_leaves < 0.2 and of_all < 0.4
    assert np.mean(same_leaf) >= 0.9
    assert np.mean(lost) < 0.03 and max(lost) < 0.1
