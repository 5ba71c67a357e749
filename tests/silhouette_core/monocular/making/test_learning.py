"""The proposal learns poses from rendered motion, the same for any number of threads."""

import hashlib
import os
import re
import subprocess
import sys
from dataclasses import replace
from functools import cache
from unittest.mock import Mock

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from calib.errors import InputError
from silhouette_core.jit import one_thread
from silhouette_core.monocular.making import from_motion, network_training
from silhouette_core.monocular.making.from_motion import make_library
from silhouette_core.monocular.making.learning_settings import LearningSettings, TrainingSettings
from silhouette_core.monocular.making.network_training import train_encoders
from silhouette_core.monocular.making.proposal_learning import FramePool, learn_proposal
from silhouette_core.monocular.making.virtual_takes import VirtualBodies, film_take
from silhouette_core.monocular.proposal.shipped import shipped_proposal
from silhouette_core.monocular.proposal.silhouette_features import FrameFeatures, InsideGrids
from silhouette_core.motion.keyposes import keypose_motions
from silhouette_core.progress import SilentReporter
from tests.silhouette_core.monocular.filming import MOVEMENTS, body, performed
from tests.silhouette_core.monocular.tree.small_library import SETTINGS, swaying

STEPS = TrainingSettings(steps=3, batch=16, modes=2, units=8, blocks=1)
TINY = LearningSettings(frames=120, pictures=60, encoding=STEPS, training=STEPS)


def learn_tiny(motion, *more, settings=TINY, **named):
    """What `learn_proposal` gives where the codes' variance is measured over few frames."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(network_training, "_SAMPLE", 400)
        return learn_proposal([motion], motion.model, settings, *more, **named)


@pytest.fixture(scope="module")
def learned():
    """A proposal that learned in few steps, and what was reported."""
    stages = Stages()
    return learn_tiny(swaying(), stages), stages


class Stages(SilentReporter):
    def __init__(self):
        self.totals, self.counts, self.notes = {}, {}, []

    def stage(self, name, total=None):
        self.totals[name], self.counts[name], self.now = total, 0, name

    def advance(self, steps=1):
        self.counts[self.now] += steps

    def note(self, text):
        self.notes.append(text)


@cache
def unseen_takes():
    """Movements that no proposal has learned, twice each, of other people."""
    model = body()
    motions, bodies = keypose_motions(model), VirtualBodies(model)
    unseen = [motions[f"{name} 2"] for name in MOVEMENTS]
    return [
        film_take(motion, bodies, np.random.default_rng([1, seed]))
        for seed, motion in enumerate(unseen * 2)
    ]


def errors_of(proposal, *, joints_seen=False):
    """Median errors over movements, statures: of the mean pose, of the likeliest mode (causal or
    not), of the best mode, of the offset.
    """
    errors = {"mean": [], True: [], False: [], "best": []}
    offsets: list[float] = []
    for take in unseen_takes():
        codes = replace(
            proposal.encoding.with_inside(
                proposal.encoding.codes(take.coverage, take.feet),
                InsideGrids(take.skin, take.shading),
            ),
            coloured=np.arange(len(take)) % 2 == 0,
            joints=take.seen * joints_seen,
        )
        geometry = take.pitch_rad, take.heading_rad, take.anchor, take.time_s
        lengths = np.linalg.norm(take.joints - proposal.network.mean_joints, axis=-1)
        errors["mean"].append(lengths.mean(axis=-1))
        for causal in (False, True):
            found = proposal.modes([FrameFeatures(codes, *geometry)], causal)[0]
            wrong = np.linalg.norm(found.joints[:, :, 1:] - take.joints[:, None], axis=-1).mean(-1)
            likeliest = found.probability.argmax(axis=1)
            errors[causal].append(wrong[np.arange(len(wrong)), likeliest])
        errors["best"].append(wrong.min(axis=1))
        offsets.append(np.abs(found.offset[:, :2] - take.offset[:, :2]).mean())
    error = {name: np.median(np.concatenate(values)) for name, values in errors.items()}
    return error | {"offset": np.median(offsets)}  # shadows pull single ones farther


def test_motion_that_the_shipped_proposal_has_not_learned_is_told():
    error = errors_of(shipped_proposal())
    # The likeliest mode may be the wrong one of two mirrored in depth, the best one is not.
    assert error[False] < 0.5 * error["mean"] and error[True] < 0.5 * error["mean"]
    assert error["best"] < 0.4 * error["mean"] and error["offset"] < 0.02


def test_joints_that_are_seen_tell_the_shipped_proposal_more():
    blind, seen = (errors_of(shipped_proposal(), joints_seen=known) for known in (False, True))
    assert seen[False] < 0.95 * blind[False] and seen[True] < 0.95 * blind[True]


@pytest.mark.accuracy
def test_a_short_training_tells_more_than_the_mean_pose(monkeypatch):
    monkeypatch.setattr(network_training, "_SAMPLE", 800)
    training = TrainingSettings(steps=600, batch=128, units=128, blocks=1, modes=4, rate=2e-3)
    encoding = replace(training, steps=30, batch=64)
    settings = LearningSettings(
        frames=2_500, takes=6, passes=32, encoding=encoding, training=training
    )
    motions = [performed(name, body()) for name in MOVEMENTS]
    error = errors_of(learn_proposal(motions, body(), settings))
    assert error[False] < error["mean"] and error["best"] < 0.7 * error["mean"]


def test_every_step_is_reported(learned):
    _, stages = learned
    assert stages.totals == stages.counts
    assert stages.totals["learning the encoders"] == stages.totals["learning the proposal"] == 3
    first, others = (stages.totals[f"filming the {which} takes"] for which in ("first", "other"))
    assert first >= TINY.pictures and 0 < others < TINY.frames


def test_the_loss_is_told_as_learning_goes_on(learned):
    _, stages = learned
    assert len(stages.notes) == 2 * 3
    assert re.fullmatch(r"after 3 of 3 steps the loss is -?\d+\.\d\d", stages.notes[-1])


def digest() -> str:
    """Digest of what is learned in steps as wide as usual ones."""
    settings = LearningSettings(
        frames=200,
        pictures=100,
        encoding=TrainingSettings(steps=4, batch=64),
        training=TrainingSettings(steps=4, batch=320),
    )
    arrays = learn_tiny(swaying(frames=200), settings=settings).arrays()
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays.values())).hexdigest()


@pytest.mark.slow
def test_the_result_does_not_depend_on_the_number_of_threads():
    module = "tests.silhouette_core.monocular.making.test_learning"
    variables = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
    done = subprocess.run(
        [sys.executable, "-c", f"from {module} import digest; print(digest())"],
        env=os.environ | dict.fromkeys(variables, "3"),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    with one_thread(), threadpool_limits(1):
        assert digest() == done.stdout.strip()


def test_a_library_learns_its_proposal_and_resumes(monkeypatch, tmp_path):
    calls = []

    def learn(motions, model, settings, *more):
        calls.append(settings)
        return learn_tiny(*motions, *more)

    monkeypatch.setattr("silhouette_core.monocular.making.proposal_learning.learn_proposal", learn)
    settings = replace(SETTINGS, poses=24)
    motions = {"sway": swaying(frames=60)}

    def make(path=tmp_path / "me.vplib", **more):
        return make_library(motions, motions["sway"].model, path, settings, **more)

    def fail(*_):
        raise OSError("no space left")

    with monkeypatch.context() as broken, pytest.raises(OSError, match="no space"):
        broken.setattr("silhouette_core.monocular.making.from_motion.write_library", fail)
        make()
    resumed = make()
    assert len(calls) == 1 and calls[0].mirror is False
    assert [path.name for path in tmp_path.iterdir()] == ["me.vplib"]
    again = make(tmp_path / "again.vplib")
    assert len(calls) == 2 and resumed.proposal is not None and again.proposal is not None
    arrays = resumed.proposal.arrays()
    for name, array in again.proposal.arrays().items():
        assert (arrays[name] == array).all()
    assert make(tmp_path / "none.vplib", learning=None).proposal is None and len(calls) == 2


def test_a_library_without_jax_says_how_to_install_it(monkeypatch, tmp_path):
    monkeypatch.setattr(from_motion, "find_spec", {}.get)
    motions = {"sway": swaying(frames=60)}
    with pytest.raises(InputError, match=r"pip install 'voxelpose\[train\]'"):
        make_library(motions, motions["sway"].model, tmp_path / "me.vplib", SETTINGS)
    assert not list(tmp_path.iterdir())


def test_an_interrupted_training_keeps_its_encoders(learned, monkeypatch):
    kept, trained = {}, []

    def step(name, make):
        if name not in kept:
            kept[name] = make()
        return kept[name]

    def train(*given):
        trained.append(given)
        return train_encoders(*given)

    monkeypatch.setattr("silhouette_core.monocular.making.proposal_learning.train_encoders", train)

    def learn():
        return learn_tiny(swaying(), step=step).arrays()

    with monkeypatch.context() as broken, pytest.raises(KeyboardInterrupt):
        broken.setattr(
            "silhouette_core.monocular.making.proposal_learning.train_network",
            Mock(side_effect=KeyboardInterrupt),
        )
        learn()
    resumed = learn()
    assert len(trained) == 1 and list(kept) == ["encoding"]
    for name, array in learned[0].arrays().items():
        assert (resumed[name] == array).all()


def test_what_has_learned_goes_on_learning_with_its_encoders(learned):
    begun, stages = learned[0], Stages()
    before = {name: array.copy() for name, array in begun.arrays().items()}
    further = learn_tiny(swaying(), stages, begun=begun)
    assert further.encoding is begun.encoding and "learning the encoders" not in stages.totals
    learned = further.arrays()
    assert any((array != learned[name]).any() for name, array in before.items())
    assert all((array == begun.arrays()[name]).all() for name, array in before.items())


def test_too_little_motion_is_refused():
    motion = swaying(frames=8)
    with pytest.raises(InputError, match="half a second"):
        learn_proposal([motion], motion.model, TINY)


def test_every_other_take_is_varied_or_all(monkeypatch):
    varied = []

    def vary(motion, others, rng):
        varied.append(motion)
        return motion

    monkeypatch.setattr("silhouette_core.monocular.making.proposal_learning.vary_motion", vary)
    counts, settings = [], replace(TINY, frames=240, pictures=120)
    for every in (False, True):
        learn_tiny(swaying(), settings=replace(settings, all_varied=every))
        counts.append(len(varied) - sum(counts))
    assert counts[0] == (counts[1] + 1) // 2 > 1


def test_a_pool_gives_the_frames_of_its_takes():
    bodies = VirtualBodies(body())
    takes = [
        film_take(swaying(frames=length), bodies, np.random.default_rng(length))
        for length in (20, 13, 17)
    ]
    pool = FramePool(takes)
    frames = np.array([0, 19, 20, 32, 33, 49, 5])
    assert len(pool) == 50
    for name in ("coverage", "skin", "joints", "pitch_rad"):
        whole = np.concatenate([getattr(take, name) for take in takes])
        np.testing.assert_array_equal(pool.gathered(frames, name), whole[frames])
