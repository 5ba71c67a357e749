"""Training of a mixture density network by Adam on the likelihood, and of the encoders, by whose
codes alone poses are to be told from single frames.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.checks import BoolArray, ByteArray, RealArray
from silhouette_core.monocular.proposal.convolutional_encoder import ConvolutionalEncoder
from silhouette_core.monocular.proposal.kernels import mixture as kernels
from silhouette_core.monocular.proposal.mixture_network import MixtureNetwork, normalised
from silhouette_core.monocular.proposal.pose_proposal import SilhouetteEncoding
from silhouette_core.monocular.proposal.silhouette_features import (
    INSIDE_CODES,
    OUTLINE_CODES,
    SilhouetteBasis,
    inside_images,
    outline_images,
    product,
)
from silhouette_core.monocular.tuning import TRAINING
from silhouette_core.progress import Reporter
from silhouette_core.read_ahead import side_by_side

_PARTS = 4  # of a batch, worked on side by side; their number changes the last digits
_WARM_UP = 200  # steps over which the rate grows
_FILTERS, _INSIDE_FILTERS = 16, 12
_SAMPLE = 4000  # frames, over which the codes' variance is measured


@dataclass(frozen=True)
class TrainingSettings:
    """Settings of a training."""

    steps: int = 16_000  #: number of steps.
    batch: int = 320  #: samples of a step, a multiple of 4.
    rate: float = 2e-3  #: largest learning rate; it falls as a half cosine.
    kept_rate: float = 0.25  #: that of what has learned before, relative to it.
    units: int = 768  #: units of the hidden layers.
    blocks: int = 2  #: residual blocks.
    modes: int = 8  #: modes of the mixture.
    noise: float = 0.03  #: deviation of the noise on the inputs.
    decay: float = 3e-3  #: decay of the weights per unit of rate.


@dataclass(frozen=True, eq=False)
class TrainingBatch:
    """Samples of a step."""

    inputs: RealArray  #: (N, I).
    joints: RealArray  #: (N, J, 3), statures.
    offset: RealArray  #: (N, 3), as in `VirtualTake`.


@dataclass(frozen=True, eq=False)
class LossGradient:
    """Gradient of the mean of -log p over a batch."""

    loss: float  #: the mean.
    weights: list[RealArray]  #: its gradient, one array per layer.
    biases: list[RealArray]  #: likewise.
    first: RealArray  #: (N, K), with respect to what the first layer makes of every sample.


def loss_gradient(
    network: MixtureNetwork, batch: TrainingBatch, share: float = 0.0
) -> LossGradient:
    r"""Gradient of the loss with respect to a network's weights and biases.

    .. math::

        L = -\frac{1}{N} \sum_n \log \sum_m \pi_m \prod_j t_2(\Delta_{mj}^{\perp};
        \sigma_{mj}^{\perp}) \, t_1(\Delta_{mj}^{\parallel}; \sigma_{mj}^{\parallel})
        - \frac{1}{N} \sum_n \sum_k \log t_1(\delta_k; \sigma_k)

    with Student's t of 4 degrees of freedom over the errors of the joints across and along the
    line of sight, and of the offsets.

    Args:
        share: if above 0, the mode nearest to the truth is responsible for 1 - share of a sample
            whatever its probability, and all modes for the rest ("winner takes most").

    Source: Bishop (1994); winner takes most as in Makansi et al., Overcoming limitations of
    mixture density networks (2019).
    """
    state = network.layer(0, batch.inputs)
    blocks: list[_Block] = []
    for number in network.blocks:
        normal, deviation = normalised(state)
        hidden = network.layer(number, normal)
        np.maximum(hidden, 0, out=hidden)
        blocks.append(_Block(number, normal, deviation, hidden))
        state = state + network.layer(number + 1, hidden)
    normal, deviation = normalised(state)
    last = np.maximum(normal, 0)
    outputs = network.layer(len(network.weights) - 1, last)
    slope, likelihood = np.empty_like(outputs), np.empty(len(outputs))
    kernels.mixture_gradients(
        outputs,
        batch.joints,
        batch.offset,
        network.mean_joints,
        network.modes,
        share,
        slope,
        likelihood,
    )
    slope /= len(slope)
    layers = [(last, slope)]  # inputs of every layer, and gradient with respect to its outputs
    gradient = _before_normalising(
        product(slope, network.weights[-1].T) * (last > 0), normal, deviation
    )
    for block in reversed(blocks):
        inner = product(gradient, network.weights[block.number + 1].T) * (block.hidden > 0)
        layers += [(block.hidden, gradient.copy()), (block.normal, inner)]
        normal_gradient = product(inner, network.weights[block.number].T)
        gradient += _before_normalising(normal_gradient, block.normal, block.deviation)
    layers = [*layers, (batch.inputs, gradient)][::-1]
    return LossGradient(
        -float(likelihood.mean()),
        [product(inputs.T, slope) for inputs, slope in layers],
        [slope.sum(axis=0) for _, slope in layers],
        gradient,
    )


@dataclass(frozen=True, eq=False)
class _Block:
    """What a residual block made of a batch: N vectors of K elements."""

    number: int  # of its first layer
    normal: RealArray  # (N, K), what it read
    deviation: RealArray  # (N, 1)
    hidden: RealArray  # (N, K)


def _before_normalising(gradient: RealArray, normal: RealArray, deviation: RealArray) -> RealArray:
    """Gradient (N, K) with respect to vectors, from that of what `normalised` makes of them."""
    along = (gradient * normal).mean(axis=1, keepdims=True)
    return (gradient - gradient.mean(axis=1, keepdims=True) - normal * along) / deviation


def train_network(
    network: MixtureNetwork,
    draw: Callable[[np.random.Generator, int], TrainingBatch],
    settings: TrainingSettings,
    rng: np.random.Generator,
    reporter: Reporter,
    further: bool = False,
) -> float:
    """Trains a network in place.

    Args:
        draw: draws a number of samples; called in several threads.
        further: whether the network has learned already, and its modes have parted.

    Returns:
        Mean loss of the last tenth of the steps.
    """

    def gradients(
        stream: np.random.Generator, samples: int, share: float
    ) -> tuple[float, list[NDArray]]:
        batch = draw(stream, samples)
        noise = stream.standard_normal(batch.inputs.shape, np.float32) * np.float32(settings.noise)
        noisy = TrainingBatch(batch.inputs + noise, batch.joints, batch.offset)
        gradient = loss_gradient(network, noisy, share)
        return gradient.loss, [*_parted(gradient.weights, learned), *gradient.biases]

    # Of inputs that nothing has learned to read, all weights are 0.
    learned = int(np.flatnonzero(network.weights[0].any(axis=1))[-1]) + 1 if further else 0
    parameters = [*_parted(network.weights, learned), *network.biases]
    rates = np.full(len(parameters), settings.kept_rate if further else 1.0)
    rates[1] = 1.0
    claimed = 0.0 if further else TRAINING.claimed
    return descend(parameters, gradients, settings, rng, reporter, claimed, rates.tolist())


def _parted(weights: Sequence[NDArray], rows: int) -> list[NDArray]:
    """Weights by layers, the first in two: so many rows, and the others."""
    return [weights[0][:rows], weights[0][rows:], *weights[1:]]


def descend(
    parameters: Sequence[RealArray],
    gradients: Callable[[np.random.Generator, int, float], tuple[float, list[NDArray]]],
    settings: TrainingSettings,
    rng: np.random.Generator,
    reporter: Reporter,
    claimed: float = TRAINING.claimed,
    rates: Sequence[float] | None = None,
) -> float:
    """Lets parameters descend along the gradients of random samples, in place.

    Args:
        parameters: arrays; those of two dimensions decay.
        gradients: from random numbers, a number of samples to draw and the share of
            `loss_gradient`: the loss and its gradient with respect to every array; called in
            several threads.
        reporter: informed of every step, and of the mean loss of each tenth of them.
        claimed: share of the steps in which the nearest mode alone learns.
        rates: of each array, relative to the settings' rate; None: 1.

    Returns:
        Mean loss of the last tenth of the steps.

    Source: Kingma and Ba, Adam (2015).
    """
    first = [np.zeros_like(array) for array in parameters]
    second = [np.zeros_like(array) for array in parameters]
    streams = rng.spawn(_PARTS)
    losses: list[float] = []
    tenth, batch = max(1, settings.steps // 10), settings.batch // _PARTS
    rates = rates or [1.0] * len(parameters)
    for step in range(settings.steps):
        done = step / settings.steps
        share = (
            max(TRAINING.share * (1 - done / claimed), TRAINING.least_share)
            if done < claimed
            else 0.0
        )
        parts = side_by_side(lambda stream, share=share: gradients(stream, batch, share), streams)
        means = [
            sum(arrays[1:], start=arrays[0]) / np.float32(_PARTS)
            for arrays in zip(*(of_part for _, of_part in parts), strict=True)
        ]
        length = np.sqrt(sum(float(np.square(array).sum(dtype=float)) for array in means))
        scale = min(1.0, TRAINING.largest_gradient / max(length, 1e-9))
        warm = min(1.0, (step + 1) / min(_WARM_UP, settings.steps))
        rate = settings.rate * warm * 0.5 * (1 + np.cos(np.pi * done)) + TRAINING.last_rate
        columns = zip(parameters, means, first, second, rates, strict=True)
        for array, gradient, one, two, relative in columns:
            kernels.adam_step(
                array.reshape(-1),
                gradient.reshape(-1),
                one.reshape(-1),
                two.reshape(-1),
                step + 1,
                relative * rate,
                settings.decay if array.ndim == 2 else 0.0,
                scale,
            )
        losses.append(float(np.mean([loss for loss, _ in parts])))
        reporter.advance()
        if len(losses) % tenth == 0:
            mean = np.mean(losses[-tenth:])
            reporter.note(f"after {len(losses)} of {settings.steps} steps the loss is {mean:.2f}")
    return float(np.mean(losses[-tenth:]))


@dataclass(frozen=True, eq=False)
class PictureBatch:
    """Samples of a step: N single frames."""

    coverage: ByteArray  #: (N, 60, 80) uint8, as in `VirtualTake`.
    skin: ByteArray  #: (N, 60, 80) uint8, likewise.
    shading: ByteArray  #: (N, 60, 80) uint8, likewise.
    coloured: BoolArray  #: (N,) bool, whether what lies inside the silhouettes is read.
    samples: TrainingBatch
    """What is to be told, and as inputs what the network reads beside the codes."""


def train_encoders(
    draw: Callable[[np.random.Generator, int], PictureBatch],
    feet: SilhouetteBasis,
    settings: TrainingSettings,
    rng: np.random.Generator,
    reporter: Reporter,
) -> SilhouetteEncoding:
    """Encoders trained together with a mixture density network that reads the codes of one frame
    and is thrown away.

    BLAS must run in one thread, see `EncoderTrace.gradients`.

    Args:
        draw: draws a number of samples; called in several threads.
        feet: basis of the grids of the feet, which is not changed.
        settings: its noise is not used.

    Returns:
        The encoding. The codes of its encoders have no correlation over a sample of frames and fall
        in variance; they are scaled like those of `fit_basis`.
    """
    encoding = SilhouetteEncoding(
        ConvolutionalEncoder.initial(1, _FILTERS, OUTLINE_CODES, rng),
        feet,
        ConvolutionalEncoder.initial(2, _INSIDE_FILTERS, INSIDE_CODES, rng),
    )
    first = draw(rng, _SAMPLE)
    network = MixtureNetwork.initial(
        OUTLINE_CODES + INSIDE_CODES + 1 + first.samples.inputs.shape[1],
        settings.units,
        settings.blocks,
        settings.modes,
        first.samples.joints.mean(axis=0),
        rng,
    )

    def gradients(
        stream: np.random.Generator, samples: int, share: float
    ) -> tuple[float, list[NDArray]]:
        return encoder_gradients(encoding, network, draw(stream, samples), share)

    parameters = [*encoding.parameters, *network.weights, *network.biases]
    descend(parameters, gradients, settings, rng, reporter)
    return SilhouetteEncoding(
        encoding.outline.ordered(outline_images(first.coverage)),
        feet,
        encoding.inside.ordered(inside_images(first.skin, first.shading)),
    )


def encoder_gradients(
    encoding: SilhouetteEncoding, network: MixtureNetwork, batch: PictureBatch, share: float
) -> tuple[float, list[NDArray]]:
    """Loss of a batch, see `loss_gradient`, and its gradients with respect to the parameters of the
    encoders, the network's weights and its biases.

    Args:
        network: reads the codes of the outline, those of the inside, or 0 where colours are not
            known, whether they are, and the samples' inputs.
        share: as for `loss_gradient`.
    """
    outline, inside = encoding.outline, encoding.inside
    known = batch.coloured[:, None].astype(np.float32)
    seen, seen_trace = outline.traced(outline_images(batch.coverage))
    read, read_trace = inside.traced(inside_images(batch.skin, batch.shading))
    inputs = np.concatenate([seen, read * known, known, batch.samples.inputs], axis=1)
    gradient = loss_gradient(network, replace(batch.samples, inputs=inputs), share)
    ends = outline.codes, outline.codes + inside.codes
    slope = product(gradient.first, network.weights[0][: ends[1]].T)
    return gradient.loss, [
        *seen_trace.gradients(slope[:, : ends[0]]),
        *read_trace.gradients(slope[:, ends[0] :] * known),
        *gradient.weights,
        *gradient.biases,
    ]
