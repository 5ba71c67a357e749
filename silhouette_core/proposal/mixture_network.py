"""Mixture density network: from features to several probable poses, each with its deviations.

Source: Bishop, Mixture density networks (1994).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from silhouette_core.proposal.kernels.mixture import JOINT_LOG_SIGMA, OFFSET_LOG_SIGMA, SIGMA
from silhouette_core.proposal.silhouette_features import product

_LAST_GAIN, _FIRST_SPREAD = 0.3, 0.05  # of the last layer; statures between the modes at first


@dataclass(frozen=True, eq=False)
class Mixture:
    """M modes of a pose for N inputs, J joints; statures.

    Attributes:
        probability: (N, M), summing to 1.
        joints: (N, M, J, 3), right, away and up.
        sigma: (N, M, J, 2), deviations across and along the line of sight, scales of Student's t
            with 4 degrees of freedom.
        offset: (N, 3), as in `VirtualTake`.
        offset_sigma: (N, 3), its deviations, likewise.
    """

    probability: NDArray[np.floating]
    joints: NDArray[np.floating]
    sigma: NDArray[np.floating]
    offset: NDArray[np.floating]
    offset_sigma: NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class MixtureNetwork:
    """Fully connected network with rectified units, and the mixture at its end.

    Attributes:
        weights: one (inputs, outputs) per layer.
        biases: one (outputs,) per layer.
        mean_joints: (J, 3), to which the modes' joints are relative, statures.
        modes: number M of modes.
    """

    weights: tuple[NDArray[np.floating], ...]
    biases: tuple[NDArray[np.floating], ...]
    mean_joints: NDArray[np.floating]
    modes: int

    @classmethod
    def initial(
        cls,
        inputs: int,
        hidden: Sequence[int],
        modes: int,
        mean_joints: NDArray[np.floating],
        rng: np.random.Generator,
    ) -> MixtureNetwork:
        """Network with random weights, of the dtype of `mean_joints`.

        Args:
            inputs: number of inputs.
            hidden: numbers of units of the hidden layers.
            modes: number of modes.
            mean_joints: (J, 3), statures.
            rng: random numbers.
        """
        dtype, count = mean_joints.dtype, len(mean_joints)
        sizes = [inputs, *hidden, modes * (count * 5 + 1) + 6]
        weights = [
            (rng.normal(size=(a, b)) * np.sqrt(2 / a)).astype(dtype) for a, b in pairwise(sizes)
        ]
        weights[-1] *= _LAST_GAIN
        biases = [np.zeros(size, dtype) for size in sizes[1:]]
        biases[-1][: modes * count * 3] = rng.normal(0, _FIRST_SPREAD, modes * count * 3)
        return cls(tuple(weights), tuple(biases), mean_joints, modes)

    def outputs(self, inputs: NDArray[np.floating]) -> NDArray[np.floating]:
        """Outputs (N, O) of inputs (N, I), see `kernels.mixture.mixture_gradients`."""
        layer = inputs
        for number, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            layer = product(layer if number == 0 else np.maximum(layer, 0), weight) + bias
        return layer

    def mixture(self, inputs: NDArray[np.floating]) -> Mixture:
        """Mixture for inputs (N, I)."""
        outputs, count = self.outputs(inputs), len(self.mean_joints)
        ends = np.cumsum(np.array([count * 3, count * 2, 1]) * self.modes)
        joints, log_sigma, logits, offset = np.split(outputs, ends, axis=1)
        shape = len(outputs), self.modes, count
        odds = np.exp(logits - logits.max(axis=1, keepdims=True))
        return Mixture(
            odds / odds.sum(axis=1, keepdims=True),
            joints.reshape(*shape, 3) + self.mean_joints,
            SIGMA * np.exp(np.clip(log_sigma.reshape(*shape, 2), *JOINT_LOG_SIGMA)),
            offset[:, :3],
            SIGMA * np.exp(np.clip(offset[:, 3:], *OFFSET_LOG_SIGMA)),
        )
