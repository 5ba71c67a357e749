"""Training of a mixture density network by Adam on the likelihood."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silhouette_core.progress import Reporter
from silhouette_core.proposal.kernels import mixture as kernels
from silhouette_core.proposal.mixture_network import MixtureNetwork
from silhouette_core.proposal.silhouette_features import product

_WARM_UP = 200  # steps over which the rate grows
_LAST_RATE = 1e-5
_LARGEST_GRADIENT = 300.0  # longer gradients are shortened
_CLAIMED = 0.4  # of the steps, in which the nearest mode alone learns
_SHARE, _LEAST_SHARE = 0.3, 0.02  # of all modes meanwhile, at first and at last


@dataclass(frozen=True)
class TrainingSettings:
    """Settings of a training.

    Attributes:
        steps: number of steps.
        batch: samples of a step.
        rate: largest learning rate; it falls as a half cosine.
        hidden: units of the hidden layers.
        modes: modes of the mixture.
        dropout: fraction of the hidden units that are left out at random.
        noise: deviation of the noise on the inputs.
        decay: decay of the weights per unit of rate.
    """

    steps: int = 12_000
    batch: int = 320
    rate: float = 1e-3
    hidden: tuple[int, ...] = (512, 512)
    modes: int = 8
    dropout: float = 0.1
    noise: float = 0.03
    decay: float = 3e-3


@dataclass(frozen=True, eq=False)
class TrainingBatch:
    """Samples of a step.

    Attributes:
        inputs: (N, I).
        joints: (N, J, 3), statures.
        offset: (N, 3), as in `VirtualTake`.
    """

    inputs: NDArray[np.floating]
    joints: NDArray[np.floating]
    offset: NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class LossGradient:
    """Gradient of the mean of -log p over a batch.

    Attributes:
        loss: the mean.
        weights: its gradient, one array per layer.
        biases: likewise.
    """

    loss: float
    weights: list[NDArray[np.floating]]
    biases: list[NDArray[np.floating]]


def loss_gradient(
    network: MixtureNetwork,
    batch: TrainingBatch,
    share: float = 0.0,
    dropout: float = 0.0,
    rng: np.random.Generator | None = None,
) -> LossGradient:
    r"""Gradient of the loss with respect to a network's weights and biases.

    .. math::

        L = -\frac{1}{N} \sum_n \log \sum_m \pi_m \prod_j t_2(\Delta_{mj}^{\perp};
        \sigma_{mj}^{\perp}) \, t_1(\Delta_{mj}^{\parallel}; \sigma_{mj}^{\parallel})
        - \frac{1}{N} \sum_n \sum_k \log t_1(\delta_k; \sigma_k)

    with Student's t of 4 degrees of freedom over the errors of the joints across and along the
    line of sight, and of the offsets.

    Args:
        network: the network.
        batch: the samples.
        share: if above 0, the mode nearest to the truth is responsible for 1 - share of a sample
            whatever its probability, and all modes for the rest ("winner takes most").
        dropout: fraction of the hidden units that are left out.
        rng: random numbers for dropout.

    Source: Bishop (1994); winner takes most as in Makansi et al., Overcoming limitations of
    mixture density networks (2019).
    """
    dtype, layers = network.weights[0].dtype, [batch.inputs]
    kept: list[NDArray[np.floating]] = []
    for number, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        layer = product(layers[-1], weight)
        layer += bias
        if number < len(network.weights) - 1:
            mask = (layer > 0).astype(dtype)
            if dropout and rng is not None:
                mask *= (rng.random(layer.shape, np.float32) > dropout) / dtype.type(1 - dropout)
            layer *= mask
            kept.append(mask)
        layers.append(layer)
    gradient, likelihood = np.empty_like(layers[-1]), np.empty(len(layers[-1]))
    kernels.mixture_gradients(
        layers[-1],
        batch.joints,
        batch.offset,
        network.mean_joints,
        network.modes,
        share,
        gradient,
        likelihood,
    )
    gradient /= len(gradient)
    weights: list[NDArray[np.floating]] = []
    biases: list[NDArray[np.floating]] = []
    for number in reversed(range(len(network.weights))):
        weights.insert(0, product(layers[number].T, gradient))
        biases.insert(0, gradient.sum(axis=0))
        if number:
            gradient = product(gradient, network.weights[number].T)
            gradient *= kept[number - 1]
    return LossGradient(-float(likelihood.mean()), weights, biases)


def train_network(
    network: MixtureNetwork,
    draw: Callable[[np.random.Generator], TrainingBatch],
    settings: TrainingSettings,
    rng: np.random.Generator,
    reporter: Reporter,
) -> float:
    """Trains a network in place.

    Args:
        network: the network, with random weights.
        draw: draws the batch of a step.
        settings: settings of the training.
        rng: random numbers, on which alone and on the batches the result depends.
        reporter: informed of every step.

    Returns:
        Mean loss of the last tenth of the steps.

    Source: Kingma and Ba, Adam (2015).
    """
    parameters = [*network.weights, *network.biases]
    first = [np.zeros_like(array) for array in parameters]
    second = [np.zeros_like(array) for array in parameters]
    losses: list[float] = []
    for step in range(settings.steps):
        batch, done = draw(rng), step / settings.steps
        noise = rng.standard_normal(batch.inputs.shape, np.float32) * np.float32(settings.noise)
        noisy = TrainingBatch(batch.inputs + noise, batch.joints, batch.offset)
        share = max(_SHARE * (1 - done / _CLAIMED), _LEAST_SHARE) if done < _CLAIMED else 0.0
        found = loss_gradient(network, noisy, share, settings.dropout, rng)
        gradients = [*found.weights, *found.biases]
        length = np.sqrt(sum(float(np.square(array).sum(dtype=float)) for array in gradients))
        scale = min(1.0, _LARGEST_GRADIENT / max(length, 1e-9))
        warm = min(1.0, (step + 1) / min(_WARM_UP, settings.steps))
        rate = settings.rate * warm * 0.5 * (1 + np.cos(np.pi * done)) + _LAST_RATE
        for array, gradient, one, two in zip(parameters, gradients, first, second, strict=True):
            kernels.adam_step(
                array.reshape(-1),
                gradient.reshape(-1),
                one.reshape(-1),
                two.reshape(-1),
                step + 1,
                rate,
                settings.decay if array.ndim == 2 else 0.0,
                scale,
            )
        losses.append(found.loss)
        reporter.advance()
    return float(np.mean(losses[-max(1, settings.steps // 10) :]))
