"""Training of a mixture density network on the likelihood, and of the encoders, by whose codes
alone poses are to be told from single frames. Gradients are JAX's, Adam is optax's.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import lgamma
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jax.typing import ArrayLike

from calib.checks import BoolArray, RealArray
from silhouette_core.monocular.making.learning_settings import TrainingSettings
from silhouette_core.monocular.proposal.convolutional_encoder import (
    SIZES,
    STRIDE,
    ConvolutionalEncoder,
)
from silhouette_core.monocular.proposal.mixture_network import (
    JOINT_LOG_SIGMA,
    OFFSET_LOG_SIGMA,
    SIGMA,
    MixtureNetwork,
)
from silhouette_core.monocular.proposal.pose_proposal import SilhouetteEncoding
from silhouette_core.monocular.proposal.silhouette_features import (
    INSIDE_CODES,
    OUTLINE_CODES,
    SilhouetteBasis,
)
from silhouette_core.monocular.tuning import TRAINING
from silhouette_core.progress import Reporter
from silhouette_core.read_ahead import side_by_side
from silhouette_core.tuning import REFINEMENT

_PARTS = 4  # of a batch, worked on side by side; their number changes the last digits
_WARM_UP = 200  # steps over which the rate grows
_FILTERS, _INSIDE_FILTERS = 16, 12
_SAMPLE = 4000  # frames, over which the codes' variance is measured
_FREEDOM = REFINEMENT.student_freedom
# Logarithms of the densities' constants for one dimension and for two.
_LOG_1 = lgamma((_FREEDOM + 1) / 2) - lgamma(_FREEDOM / 2) - np.log(_FREEDOM * np.pi) / 2
_LOG_2 = lgamma((_FREEDOM + 2) / 2) - lgamma(_FREEDOM / 2) - np.log(_FREEDOM * np.pi)
# Sums do not depend on the number of threads; parts of a batch are worked on side by side.
_compiled = partial(jax.jit, compiler_options={"xla_cpu_multi_thread_eigen": False})
_Parameters = TypeVar("_Parameters")
_Batch = TypeVar("_Batch")
_Layers = tuple[tuple[RealArray, ...], tuple[RealArray, ...]]  # weights and biases


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False)
class TrainingBatch:
    """Samples of a step."""

    inputs: RealArray  #: (N, I) float32.
    joints: RealArray  #: (N, J, 3) float32, statures.
    offset: RealArray  #: (N, 3) float32, as in `VirtualTake`.


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False)
class PictureBatch:
    """Samples of a step: N single frames."""

    outline: RealArray  #: (N, 60, 80, 1) float32, what the first encoder reads.
    inside: RealArray  #: (N, 60, 80, 2) float32, what the second encoder reads.
    coloured: BoolArray  #: (N,) bool, whether what lies inside the silhouettes is read.
    samples: TrainingBatch
    """What is to be told, and as inputs what the network reads beside the codes."""


@partial(jax.custom_vjp, nondiff_argnums=(1,))
def _limited(raw: jax.Array, limits: tuple[float, float]) -> jax.Array:
    """Values within limits. A value beyond one is not pushed outward, and may come back."""
    return jnp.clip(raw, *limits)


def _inward(limits: tuple[float, float], raw: jax.Array, slope: jax.Array) -> tuple[jax.Array]:
    outward = ((raw < limits[0]) & (slope > 0)) | ((raw > limits[1]) & (slope < 0))
    return (jnp.where(outward, 0.0, slope),)


_limited.defvjp(lambda raw, limits: (_limited(raw, limits), raw), _inward)


def mixture_loss(
    network: MixtureNetwork, batch: TrainingBatch, share: float = 0.0
) -> tuple[jax.Array, jax.Array]:
    r"""What is descended along, and the loss.

    .. math::

        L = -\frac{1}{N} \sum_n \log \sum_m \pi_m \prod_j t_2(\Delta_{mj}^{\perp};
        \sigma_{mj}^{\perp}) \, t_1(\Delta_{mj}^{\parallel}; \sigma_{mj}^{\parallel})
        - \frac{1}{N} \sum_n \sum_k \log t_1(\delta_k; \sigma_k)

    with Student's t of 4 degrees of freedom over the errors of the joints across and along the
    line of sight, and of the offsets.

    Args:
        share: if above 0, the mode nearest to the truth is responsible for 1 - share of a sample
            whatever its probability, and all modes for the rest ("winner takes most"). The gradient
            of the first result follows this, the second result does not.

    Source: Bishop (1994); winner takes most as in Makansi et al., Overcoming limitations of
    mixture density networks (2019).
    """
    outputs = network.split(network.outputs(batch.inputs, jnp))
    errors = outputs.joints + network.mean_joints - batch.joints[:, None]
    across, along = jnp.moveaxis(_limited(outputs.log_sigma, JOINT_LOG_SIGMA), -1, 0)
    squared = jnp.square(errors)
    joint_log = _student_log((squared[..., 0] + squared[..., 2]), across, 2)
    joint_log += _student_log(squared[..., 1], along, 1)
    mode_log = jax.nn.log_softmax(outputs.logits) + joint_log.sum(axis=-1)
    likelihood = jax.nn.logsumexp(mode_log, axis=1)
    nearest = jax.nn.one_hot(squared.sum(axis=(2, 3)).argmin(axis=1), network.modes)
    claimed = share / network.modes + (1 - share) * nearest
    followed = jnp.where(share > 0, (claimed * mode_log).sum(axis=1), likelihood)
    offset_log = _student_log(
        jnp.square(outputs.offset - batch.offset),
        _limited(outputs.offset_log_sigma, OFFSET_LOG_SIGMA),
        1,
    ).sum(axis=1)
    return -(followed + offset_log).mean(), -(likelihood + offset_log).mean()


def _student_log(squared: jax.Array, log_sigma: jax.Array, dimensions: int) -> jax.Array:
    """Logarithm of Student's t of squared errors, with deviations relative to `SIGMA`."""
    constant = (_LOG_1 if dimensions == 1 else _LOG_2) - dimensions * np.log(SIGMA)
    scaled = squared * jnp.exp(-2 * log_sigma) / SIGMA**2
    power = (_FREEDOM + dimensions) / 2
    return constant - dimensions * log_sigma - power * jnp.log1p(scaled / _FREEDOM)


def train_network(
    network: MixtureNetwork,
    draw: Callable[[np.random.Generator, int], TrainingBatch],
    settings: TrainingSettings,
    rng: np.random.Generator,
    reporter: Reporter,
    further: bool = False,
) -> MixtureNetwork:
    """The network, trained.

    Args:
        draw: draws a number of samples; called in several threads.
        further: whether the network has learned already, and its modes have parted.
    """

    def noisy(stream: np.random.Generator, samples: int) -> TrainingBatch:
        batch = draw(stream, samples)
        noise = stream.standard_normal(batch.inputs.shape, np.float32) * np.float32(settings.noise)
        return replace(batch, inputs=batch.inputs + noise)

    layers, claimed = (network.weights, network.biases), TRAINING.claimed
    rates = jax.tree.map(lambda _: 1.0, layers)
    if further:
        # Of inputs that nothing has learned to read, all weights are 0.
        learned = int(np.flatnonzero(network.weights[0].any(axis=1))[-1]) + 1
        is_learned = np.arange(len(network.weights[0]))[:, None] < learned
        rate = settings.kept_rate
        of_first = np.where(is_learned, rate, 1.0)
        rates = (of_first, *(rate for _ in layers[0][1:])), tuple(rate for _ in layers[1])
        claimed = 0.0
    gradient = partial(_network_gradient, mean=network.mean_joints, modes=network.modes)
    layers = descend(layers, gradient, noisy, settings, rng, reporter, claimed, rates)
    return replace(network, weights=layers[0], biases=layers[1])


@partial(_compiled, static_argnames="modes")
@partial(jax.grad, has_aux=True)
def _network_gradient(
    layers: _Layers, batch: TrainingBatch, share: float, mean: RealArray, modes: int
) -> tuple[jax.Array, jax.Array]:
    return mixture_loss(MixtureNetwork(*layers, mean, modes), batch, share)


def descend(
    parameters: _Parameters,
    gradient: Callable[[_Parameters, _Batch, float], tuple[_Parameters, jax.Array]],
    draw: Callable[[np.random.Generator, int], _Batch],
    settings: TrainingSettings,
    rng: np.random.Generator,
    reporter: Reporter,
    claimed: float = TRAINING.claimed,
    rates: _Parameters | None = None,
) -> _Parameters:
    """Parameters that descended along the gradients of random samples.

    Args:
        parameters: tuples of arrays; those of two dimensions decay.
        gradient: from parameters, a batch and the share of `mixture_loss`: the gradient, and the
            loss that is reported.
        draw: draws a number of samples; called in several threads.
        reporter: informed of every step, and of the mean loss of each tenth of them.
        claimed: share of the steps in which the nearest mode alone learns.
        rates: of each array, relative to the settings' rate; None: 1.

    Source: Kingma and Ba, Adam (2015); Loshchilov and Hutter (2019).
    """
    rates = jax.tree.map(lambda _: 1.0, parameters) if rates is None else rates
    streams, state = rng.spawn(_PARTS), _adam(settings).init(parameters)  # type: ignore[arg-type]
    losses: list[float] = []
    tenth, samples = max(1, settings.steps // 10), settings.batch // _PARTS
    for step in range(settings.steps):
        done, share = step / settings.steps, 0.0
        if done < claimed:
            share = max(TRAINING.share * (1 - done / claimed), TRAINING.least_share)

        def of_part(stream, parameters=parameters, share=share):
            return jax.block_until_ready(gradient(parameters, draw(stream, samples), share))

        gradients, of_parts = zip(*side_by_side(of_part, streams), strict=True)
        parameters, state = _moved(parameters, state, gradients, rates, settings)
        losses.append(float(np.mean(of_parts)))
        reporter.advance()
        if len(losses) % tenth == 0:
            mean = np.mean(losses[-tenth:])
            reporter.note(f"after {len(losses)} of {settings.steps} steps the loss is {mean:.2f}")
    return jax.tree.map(np.array, parameters)


@partial(_compiled, static_argnames="settings")
def _moved(parameters, state, gradients, rates, settings):
    """Parameters and the optimiser's state after a step along the mean of some gradients."""
    mean = jax.tree.map(lambda *parts: sum(parts) / _PARTS, *gradients)
    steps, state = _adam(settings).update(mean, state, parameters)
    return optax.apply_updates(parameters, jax.tree.map(jnp.multiply, steps, rates)), state


def _adam(settings: TrainingSettings) -> optax.GradientTransformation:
    def rate(step: ArrayLike) -> jax.Array:
        warm = jnp.minimum(1.0, (step + 1) / min(_WARM_UP, settings.steps))
        cosine = 0.5 * (1 + jnp.cos(jnp.pi * step / settings.steps))
        return settings.rate * warm * cosine + TRAINING.last_rate

    def decaying(arrays: _Parameters) -> _Parameters:
        return jax.tree.map(lambda array: array.ndim == 2, arrays)

    return optax.chain(
        optax.clip_by_global_norm(TRAINING.largest_gradient),
        optax.adamw(rate, weight_decay=settings.decay, mask=decaying),
    )


def train_encoders(
    draw: Callable[[np.random.Generator, int], PictureBatch],
    feet: SilhouetteBasis,
    settings: TrainingSettings,
    rng: np.random.Generator,
    reporter: Reporter,
) -> SilhouetteEncoding:
    """Encoders trained together with a mixture density network that reads the codes of one frame
    and is thrown away.

    Args:
        draw: draws a number of samples; called in several threads.
        feet: basis of the grids of the feet, which is not changed.
        settings: its noise is not used.

    Returns:
        The encoding. The codes of its encoders have no correlation over a sample of frames and fall
        in variance; they are scaled like those of `fit_basis`.
    """
    outline = ConvolutionalEncoder.initial(1, _FILTERS, OUTLINE_CODES, rng)
    inside = ConvolutionalEncoder.initial(2, _INSIDE_FILTERS, INSIDE_CODES, rng)
    first = draw(rng, _SAMPLE)
    network = MixtureNetwork.initial(
        OUTLINE_CODES + INSIDE_CODES + 1 + first.samples.inputs.shape[1],
        settings.units,
        settings.blocks,
        settings.modes,
        first.samples.joints.mean(axis=0),
        rng,
    )

    layers = tuple((one.weights, one.biases) for one in (outline, inside, network))
    gradient = partial(_encoder_gradient, mean=network.mean_joints, modes=network.modes)
    layers = descend(layers, gradient, draw, settings, rng, reporter)
    return SilhouetteEncoding(
        ConvolutionalEncoder(*layers[0]).ordered(first.outline),
        feet,
        ConvolutionalEncoder(*layers[1]).ordered(first.inside),
    )


@partial(_compiled, static_argnames="modes")
@partial(jax.grad, has_aux=True)
def _encoder_gradient(
    layers: tuple[_Layers, _Layers, _Layers],
    batch: PictureBatch,
    share: float,
    mean: RealArray,
    modes: int,
) -> tuple[jax.Array, jax.Array]:
    outline, inside, (weights, biases) = layers
    network = MixtureNetwork(weights, biases, mean, modes)
    return mixture_loss(network, read_codes(outline, inside, batch), share)


def read_codes(outline: _Layers, inside: _Layers, batch: PictureBatch) -> TrainingBatch:
    """Samples whose inputs are the codes of the outline, those of the inside, or 0 where colours
    are not known, whether they are, and the inputs of the batch's samples.
    """
    known = batch.coloured[:, None].astype(np.float32)
    codes = _encoded(outline, batch.outline), _encoded(inside, batch.inside) * known
    inputs = jnp.concatenate([*codes, known, batch.samples.inputs], axis=1)
    return replace(batch.samples, inputs=inputs)


def _encoded(layers: _Layers, images: RealArray) -> jax.Array:
    """What `ConvolutionalEncoder.encode` makes of images, by JAX."""
    weights, biases = layers
    state = jnp.asarray(images)
    for size, weight, bias in zip(SIZES, weights, biases, strict=False):
        filters = jnp.reshape(weight, (size, size, state.shape[-1], -1))
        order = ("NHWC", "HWIO", "NHWC")
        state = jax.lax.conv_general_dilated(
            state, filters, (STRIDE, STRIDE), "SAME", dimension_numbers=order
        )
        state = jnp.maximum(state + bias, 0)
    return state.reshape(len(state), -1) @ weights[-1] + biases[-1]
