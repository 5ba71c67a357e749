"""Training of the encoders: poses are to be told from single frames by their codes alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from silhouette_core.monocular.making.network_training import (
    TrainingBatch,
    TrainingSettings,
    descend,
    loss_gradient,
)
from silhouette_core.monocular.proposal.convolutional_encoder import ConvolutionalEncoder
from silhouette_core.monocular.proposal.mixture_network import MixtureNetwork
from silhouette_core.monocular.proposal.pose_proposal import SilhouetteEncoding
from silhouette_core.monocular.proposal.silhouette_features import (
    INSIDE_CODES,
    OUTLINE_CODES,
    SilhouetteBasis,
    inside_images,
    outline_images,
    product,
)
from silhouette_core.progress import Reporter

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
        samples: what is to be told, and as inputs what the network reads beside the codes.
    """

    coverage: NDArray[np.uint8]
    skin: NDArray[np.uint8]
    shading: NDArray[np.uint8]
    coloured: NDArray[np.bool_]
    samples: TrainingBatch


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
        settings: settings of the training and of the network; its noise is not used.

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
    found = loss_gradient(network, replace(batch.samples, inputs=inputs), share)
    ends = outline.codes, outline.codes + inside.codes
    slope = product(found.first, network.weights[0][: ends[1]].T)
    return found.loss, [
        *seen_trace.gradients(slope[:, : ends[0]]),
        *read_trace.gradients(slope[:, ends[0] :] * known),
        *found.weights,
        *found.biases,
    ]
