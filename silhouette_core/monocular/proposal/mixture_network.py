"""Mixture density network: from features to several probable poses, each with its deviations.

Source: Bishop, Mixture density networks (1994).
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from calib.checks import RealArray
from silhouette_core.monocular.proposal.kernels.mixture import (
    JOINT_LOG_SIGMA,
    OFFSET_LOG_SIGMA,
    SIGMA,
)
from silhouette_core.monocular.proposal.silhouette_features import product
from silhouette_core.monocular.tuning import TRAINING


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

    def outputs(self, inputs: RealArray) -> RealArray:
        """Outputs (N, O) of inputs (N, I), see `kernels.mixture.mixture_gradients`."""
        state = self.layer(0, inputs)
        for number in self.blocks:
            hidden = self.layer(number, normalised(state)[0])
            state += self.layer(number + 1, np.maximum(hidden, 0))
        return self.layer(len(self.weights) - 1, np.maximum(normalised(state)[0], 0))

    def mixture(self, inputs: RealArray) -> Mixture:
        """Mixture for inputs (N, I)."""
        outputs, count = self.outputs(inputs), len(self.mean_joints)
        ends = np.cumsum(np.array([count * 3, count * 2, 1]) * self.modes)
        joints, log_sigma, logits, offset = np.split(outputs, ends, axis=1)
        odds = np.exp(logits - logits.max(axis=1, keepdims=True))
        return Mixture(
            odds / odds.sum(axis=1, keepdims=True),
            joints.reshape(-1, self.modes, count, 3) + self.mean_joints,
            SIGMA * np.exp(np.clip(log_sigma, *JOINT_LOG_SIGMA)).reshape(-1, self.modes, count, 2),
            offset[:, :3],
            SIGMA * np.exp(np.clip(offset[:, 3:], *OFFSET_LOG_SIGMA)),
        )


def normalised(state: RealArray) -> tuple[RealArray, RealArray]:
    """Vectors (N, K) less the means of their elements, over their deviations, and these (N, 1)."""
    centred = state - state.mean(axis=1, keepdims=True)
    deviation = np.sqrt(np.square(centred).mean(axis=1, keepdims=True) + state.dtype.type(1e-5))
    return centred / deviation, deviation
