"""The network of the proposal: its likelihood, and what is learned along its gradient."""

from dataclasses import replace

import jax
import numpy as np
import pytest
from scipy.stats import multivariate_t, t

from silhouette_core.monocular.making.learning_settings import TrainingSettings
from silhouette_core.monocular.making.network_training import (
    TrainingBatch,
    mixture_loss,
    train_network,
)
from silhouette_core.monocular.proposal.mixture_network import (
    JOINT_LOG_SIGMA,
    OFFSET_LOG_SIGMA,
    MixtureNetwork,
)
from silhouette_core.progress import SilentReporter

MODES, JOINTS = 3, 2


@pytest.fixture
def rng():
    return np.random.default_rng(0)


@pytest.fixture
def network(rng):
    mean = rng.normal(0, 0.3, (JOINTS, 3))
    return MixtureNetwork.initial(5, 7, 2, MODES, mean, rng)


def batch(rng, count=4):
    joints = rng.normal(0, 0.2, (count, JOINTS, 3))
    return TrainingBatch(rng.normal(size=(count, 5)), joints, rng.normal(0, 0.1, (count, 3)))


def test_the_likelihood_is_that_of_a_mixture_of_student_t(network, rng):
    given = batch(rng)
    found = network.mixture(given.inputs)
    expected = np.zeros(len(given.inputs))
    for m in range(MODES):
        density = found.probability[:, m].copy()
        for j in range(JOINTS):
            error = given.joints[:, j] - found.joints[:, m, j]
            across, along = found.sigma[:, m, j].T
            for n in range(len(density)):
                shape = across[n] ** 2 * np.eye(2)
                density[n] *= multivariate_t.pdf(error[n, [0, 2]], shape=shape, df=4)
            density *= t.pdf(error[:, 1], 4, scale=along)
        expected += density
    expected = np.log(expected)
    expected += t.logpdf(given.offset, 4, found.offset, found.offset_sigma).sum(axis=1)
    for loss in mixture_loss(network, given):
        assert float(loss) == pytest.approx(-expected.mean(), rel=1e-5)


def output_gradient(network, batch, share=0.0):
    """Gradient of what is descended along with respect to the biases of the last layer."""

    def followed(last):
        return mixture_loss(replace(network, biases=(*network.biases[:-1], last)), batch, share)[0]

    return np.asarray(jax.grad(followed)(network.biases[-1]))


def test_a_deviation_at_its_limit_may_come_back(rng):
    """Beyond its limits a deviation has no effect, but the gradient that leads back is kept."""
    network = MixtureNetwork.initial(1, 4, 1, 1, np.zeros((1, 3)), rng)
    network.weights[-1][:] = 0
    outputs = network.biases[-1]
    outputs[:] = 0
    outputs[3:5] = JOINT_LOG_SIGMA[1] + 1  # too wide for an error of 0
    outputs[9:12] = OFFSET_LOG_SIGMA[0] - 1  # too narrow for an error of 1
    given = TrainingBatch(np.ones((1, 1)), np.zeros((1, 1, 3)), np.ones((1, 3)))
    gradient = output_gradient(network, given)
    assert (gradient[3:5] > 0).all() and (gradient[9:12] < 0).all()
    outputs[9:12] = OFFSET_LOG_SIGMA[1] + 1
    outputs[3:5] = JOINT_LOG_SIGMA[0] - 1
    outputs[6:9] = 1
    outputs[:3] = 1
    given = replace(given, joints=np.ones((1, 1, 3)))
    gradient = output_gradient(network, given)
    assert (gradient[3:5] == 0).all() and (gradient[9:12] > 0).all()


def test_the_nearest_mode_learns_whatever_its_probability(network, rng):
    given = batch(rng, 40)
    network.biases[-1][MODES * JOINTS * 5 :][:MODES] = (0, 40, 40)
    nearest = (
        ((network.mixture(given.inputs).joints - given.joints[:, None]) ** 2)
        .sum(axis=(2, 3))
        .argmin(axis=1)
    )
    given = TrainingBatch(
        *(array[nearest == 0] for array in (given.inputs, given.joints, given.offset))
    )
    assert len(given.inputs)
    first = slice(0, JOINTS * 3)
    assert np.abs(output_gradient(network, given)[first]).max() < 1e-3
    assert np.abs(output_gradient(network, given, share=0.1)[first]).max() > 0.1


def test_training_finds_both_of_two_answers(rng):
    """Every input has two equally probable answers, mirrored in depth."""
    mean = np.zeros((1, 3), np.float32)
    network = MixtureNetwork.initial(1, 32, 1, 2, mean, rng)

    def draw(rng, count):
        inputs = rng.uniform(-1, 1, (count, 1)).astype(np.float32)
        side = rng.choice([-1, 1], count)
        joints = np.stack([inputs[:, 0] * 0.2, side * 0.3, np.full(count, 0.1)], axis=-1)
        joints = (joints + rng.normal(0, 0.01, joints.shape)).astype(np.float32)
        return TrainingBatch(inputs, joints[:, None], np.tile(inputs, 3) * np.float32(0.1))

    settings = TrainingSettings(steps=600, batch=64, rate=5e-3, modes=2)
    network = train_network(network, draw, settings, rng, SilentReporter())
    found = network.mixture(np.array([[-0.8], [0.0], [0.8]], np.float32))
    np.testing.assert_allclose(found.probability, 0.5, atol=0.1)
    np.testing.assert_allclose(np.sort(found.joints[:, :, 0, 1]), [[-0.3, 0.3]] * 3, atol=0.05)
    np.testing.assert_allclose(found.joints[:, 0, 0, 0], [-0.16, 0, 0.16], atol=0.03)
    np.testing.assert_allclose(found.offset[:, 0], [-0.08, 0, 0.08], atol=0.02)
    assert found.sigma.max() < 0.05


def test_all_parts_of_a_batch_are_learned_from(rng):
    """The parts, which have random numbers of their own, see the joint at -1, -1, 1 and 1."""
    network = MixtureNetwork.initial(1, 8, 1, 1, np.zeros((1, 3), np.float32), rng)

    def draw(rng, count):
        side = 1 if rng.bit_generator.seed_seq.spawn_key[-1] < 2 else -1
        joints = np.full((count, 1, 3), 0.1 * side, np.float32)
        return TrainingBatch(np.ones((count, 1), np.float32), joints, joints[:, 0])

    settings = TrainingSettings(steps=300, batch=64, rate=5e-3, modes=1)
    network = train_network(network, draw, settings, rng, SilentReporter())
    found = network.mixture(np.ones((1, 1), np.float32))
    assert np.abs(found.joints).max() < 0.05
    assert found.sigma.min() > 0.05
