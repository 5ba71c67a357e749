"""A proposal that has learned one performance of every movement, made once."""

from dataclasses import replace

import pytest

from silhouette_core.monocular.making.network_training import TrainingSettings
from silhouette_core.monocular.making.proposal_learning import LearningSettings, learn_proposal
from silhouette_core.motion.keyposes import keypose_motions
from tests.silhouette_core.monocular.filming import MOVEMENTS, body


@pytest.fixture(scope="session")
def learned_proposal():
    motions = keypose_motions(body())
    training = TrainingSettings(steps=800, batch=256, units=192, blocks=1, modes=4, rate=2e-3)
    settings = LearningSettings(
        frames=12_000, takes=30, passes=20, encoding=replace(training, steps=400), training=training
    )
    return learn_proposal([motions[f"{name} 1"] for name in MOVEMENTS], body(), settings)
