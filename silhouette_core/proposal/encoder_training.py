"""Training of the encoders: poses are to be told from single frames by their codes alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silhouette_core.progress import Reporter
from silhouette_core.proposal.convolutional_encoder import ConvolutionalEncoder
from silhouette_core.proposal.mixture_network import MixtureNetwork
from silhouette_core.proposal.network_training import (
    TrainingBatch,
    TrainingSettings,
    descend,
    loss_gradient,
)
from silhouette_core.proposal.silhouette_features import (
    INSIDE_CODES,
    OUTLINE_CODES,
    inside_images,
    outline_images,
    product,
)

_FILTERS, _INSIDE_FILTERS = 16, 12
_SAMPLE = 4000  # frames, over which the codes' variance is measured


@dataclass(frozen=True, eq=False)
class PictureBatch:
    """Samples of a step: N single frames.

    Attributes:
        coverage: (N, 60, 80) uint8, as in `VirtualTake`.
        skin: (N, 60, 80) uint8, likewise.
        shading: (N, 60, 80) uint8, likewise.
        coloured: (N,) bool, whether what lies inside the silhouettes is read.
        others: (N, I), what the network reads beside the codes.
        joints: (N, J, 3), statures.
        offset: (N, 3), as in `VirtualTake`.
    """

    coverage: NDArray[np.uint8]
    skin: NDArray[np.uint8]
    shading: NDArray[np.uint8]
    coloured: NDArray[np.bool_]
    others: NDArray[np.float32]
    joints: NDArray[np.floating]
    offset: NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class SilhouetteEncoders:
    """The two encoders of a proposal.

    Attributes:
        outline: reads `outline_images`.
        inside: reads `inside_images`.
    """

    outline: ConvolutionalEncoder
    inside: ConvolutionalEncoder

    @property
    def parameters(self) -> list[NDArray[np.float32]]:
        """Weights and biases of both."""
        return [*self.outline.parameters, *self.inside.parameters]


def train_encoders(
    draw: Callable[[np.random.Generator, int], PictureBatch],
    settings: TrainingSettings,
    rng: np.random.Generator,
    reporter: Reporter,
) -> SilhouetteEncoders:
    """Encoders trained together with a mixture density network that reads the codes of one frame
    and is thrown away.

    BLAS must run in one thread, see `EncoderTrace.gradients`.

    Args:
        draw: draws a number of samples; called in several threads.
        settings: settings of the training and of the network; its noise is not used.
        rng: random numbers, on which alone and on the samples the result depends.
        reporter: informed of every step.

    Returns:
        The encoders. Their codes have no correlation over a sample of frames and fall in variance;
        they are scaled like those of `fit_basis`.
    """
    encoders = SilhouetteEncoders(
        ConvolutionalEncoder.initial(1, _FILTERS, OUTLINE_CODES, rng),
        ConvolutionalEncoder.initial(2, _INSIDE_FILTERS, INSIDE_CODES, rng),
    )
    sample = draw(rng, _SAMPLE)
    network = MixtureNetwork.initial(
        OUTLINE_CODES + INSIDE_CODES + 1 + sample.others.shape[1],
        settings.units,
        settings.blocks,
        settings.modes,
        sample.joints.mean(axis=0),
        rng,
    )

    def gradients(
        stream: np.random.Generator, samples: int, share: float
    ) -> tuple[float, list[NDArray]]:
        return encoder_gradients(encoders, network, draw(stream, samples), share)

    parameters = [*encoders.parameters, *network.weights, *network.biases]
    descend(parameters, gradients, settings, rng, reporter)
    return SilhouetteEncoders(
        encoders.outline.ordered(outline_images(sample.coverage)),
        encoders.inside.ordered(inside_images(sample.skin, sample.shading)),
    )


def encoder_gradients(
    encoders: SilhouetteEncoders, network: MixtureNetwork, batch: PictureBatch, share: float
) -> tuple[float, list[NDArray]]:
    """Loss of a batch, see `loss_gradient`, and its gradients with respect to the parameters of the
    encoders, the network's weights and its biases.

    Args:
        encoders: the encoders.
        network: reads the codes of the outline, those of the inside, or 0 where colours are not
            known, whether they are, and the batch's other inputs.
        batch: the samples.
        share: as for `loss_gradient`.
    """
    outline, inside = encoders.outline, encoders.inside
    known = batch.coloured[:, None].astype(np.float32)
    seen, seen_trace = outline.traced(outline_images(batch.coverage))
    read, read_trace = inside.traced(inside_images(batch.skin, batch.shading))
    inputs = np.concatenate([seen, read * known, known, batch.others], axis=1)
    found = loss_gradient(network, TrainingBatch(inputs, batch.joints, batch.offset), share)
    ends = outline.codes, outline.codes + inside.codes
    slope = product(found.first, network.weights[0][: ends[1]].T)
    return found.loss, [
        *seen_trace.gradients(slope[:, : ends[0]]),
        *read_trace.gradients(slope[:, ends[0] :] * known),
        *found.weights,
        *found.biases,
    ]
