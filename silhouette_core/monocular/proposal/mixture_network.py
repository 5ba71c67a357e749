"""Mixture density network: from features to several probable poses, each with its deviations.

Source: Bishop, Mixture density networks (1994).
"""

from dataclasses import dataclass
from itertools import pairwise
from types import ModuleType

import numpy as np

from calib.checks import RealArray
from silhouette_core.monocular.proposal.silhouette_features import product
from silhouette_core.monocular.tuning import MIXTURE, TRAINING

SIGMA = MIXTURE.sigma
JOINT_LOG_SIGMA, OFFSET_LOG_SIGMA = MIXTURE.joint_log_sigma, MIXTURE.offset_log_sigma


@dataclass(frozen=True, eq=False)
class Mixture:
    """M probable poses for each of N inputs, J joints; lengths in statures."""

    probability: RealArray  #: (N, M) float32, summing to 1.
    joints: RealArray
    """(N, M, J, 3) float32, relative to the pelvis, in the order of LANDMARK_NAMES, in the frame of
    a level camera with the heading of the features: right, away and up."""
    sigma: RealArray
    """(N, M, J, 2) float32, deviations across (right and up) and along (away) the line of sight,
    scales of Student's t with 4 degrees of freedom."""
    offset: RealArray
    """(N, 3) float32, the pelvis's place in the window from its middle, right and down, at the
    assumed distance (1: 158 px of 240), and the logarithm of the pelvis's true distance along the
    optical axis over the assumed one."""
    offset_sigma: RealArray  #: (N, 3) float32, its deviations, likewise.


@dataclass(frozen=True, eq=False)
class MixtureNetwork:
    r"""Residual network of fully connected layers, and the mixture at its end.

    .. math::

        x_0 = W_0 v + b_0, \quad
        x_{i+1} = x_i + W''_i \max(0, W'_i \, n(x_i) + b'_i) + b''_i, \quad
        o = W_e \max(0, n(x_R)) + b_e,

    where n subtracts the mean of a vector's elements and divides by their deviation.

    Source: He et al., Identity mappings in deep residual networks (2016); Ba, Kiros and Hinton,
    Layer normalization (2016).
    """

    weights: tuple[RealArray, ...]
    """One (inputs, outputs) per layer: the first, two of each of R blocks, the last."""
    biases: tuple[RealArray, ...]  #: one (outputs,) per layer.
    mean_joints: RealArray  #: (J, 3), to which the modes' joints are relative, statures.
    modes: int  #: number M of modes.

    @classmethod
    def initial(
        cls,
        inputs: int,
        units: int,
        blocks: int,
        modes: int,
        mean_joints: RealArray,
        rng: np.random.Generator,
    ) -> "MixtureNetwork":
        """Network with random weights, of the dtype of `mean_joints`.

        Args:
            units: number of units of the hidden layers.
            blocks: number R of residual blocks.
            mean_joints: (J, 3), statures.
        """
        dtype, count = mean_joints.dtype, len(mean_joints)
        sizes = [inputs, *[units] * (2 * blocks + 1), modes * (count * 5 + 1) + 6]
        weights = [
            (rng.normal(size=(a, b)) * np.sqrt(2 / a)).astype(dtype) for a, b in pairwise(sizes)
        ]
        for weight in [*weights[2:-1:2], weights[-1]]:
            weight *= TRAINING.last_gain
        biases = [np.zeros(size, dtype) for size in sizes[1:]]
        biases[-1][: modes * count * 3] = rng.normal(0, SIGMA, modes * count * 3)
        return cls(tuple(weights), tuple(biases), mean_joints, modes)

    @property
    def blocks(self) -> range:
        """Numbers of the first layers of the residual blocks."""
        return range(1, len(self.weights) - 1, 2)

    def layer(self, number: int, inputs: RealArray) -> RealArray:
        """What a layer makes of its inputs, before any rectification."""
        return product(inputs, self.weights[number]) + self.biases[number]

    def outputs(self, inputs: RealArray, numpy: ModuleType = np) -> RealArray:
        """Outputs (N, O) of inputs (N, I), see `split`.

        Args:
            numpy: NumPy, or `jax.numpy`, of whose arrays the layers may be.
        """
        state = self.layer(0, inputs)
        for number in self.blocks:
            hidden = self.layer(number, _normalised(state, numpy))
            state = state + self.layer(number + 1, numpy.maximum(hidden, 0))
        last = numpy.maximum(_normalised(state, numpy), 0)
        return self.layer(len(self.weights) - 1, last)

    def split(self, outputs: RealArray) -> "MixtureOutputs":
        """Outputs (N, O) by what they state."""
        modes, count = self.modes, len(self.mean_joints)
        log_sigma, logits, offset = modes * count * 3, modes * count * 5, modes * (count * 5 + 1)
        return MixtureOutputs(
            outputs[:, :log_sigma].reshape(-1, modes, count, 3),
            outputs[:, log_sigma:logits].reshape(-1, modes, count, 2),
            outputs[:, logits:offset],
            outputs[:, offset : offset + 3],
            outputs[:, offset + 3 :],
        )

    def mixture(self, inputs: RealArray) -> Mixture:
        """Mixture for inputs (N, I)."""
        outputs = self.split(self.outputs(inputs))
        odds = np.exp(outputs.logits - outputs.logits.max(axis=1, keepdims=True))
        return Mixture(
            odds / odds.sum(axis=1, keepdims=True),
            outputs.joints + self.mean_joints,
            SIGMA * np.exp(np.clip(outputs.log_sigma, *JOINT_LOG_SIGMA)),
            outputs.offset,
            SIGMA * np.exp(np.clip(outputs.offset_log_sigma, *OFFSET_LOG_SIGMA)),
        )


@dataclass(frozen=True, eq=False)
class MixtureOutputs:
    """What a network states of N inputs; deviations are relative to `SIGMA`."""

    joints: RealArray  #: (N, M, J, 3), less the network's mean joints.
    log_sigma: RealArray  #: (N, M, J, 2), logarithms of deviations, not yet within their limits.
    logits: RealArray  #: (N, M), of the modes' probabilities.
    offset: RealArray  #: (N, 3).
    offset_log_sigma: RealArray  #: (N, 3), likewise.


def _normalised(state: RealArray, numpy: ModuleType) -> RealArray:
    """Vectors (N, K) less the means of their elements, over their deviations."""
    centred = state - state.mean(axis=1, keepdims=True)
    variance = (centred * centred).mean(axis=1, keepdims=True)
    return centred / numpy.sqrt(variance + state.dtype.type(1e-5))
