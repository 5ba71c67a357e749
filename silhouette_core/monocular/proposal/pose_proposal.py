"""Learned proposal: probable poses from silhouettes, stored in the pose library."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from calib.checks import check_array
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.image.cleanup import reduce_silhouette
from silhouette_core.monocular.proposal.mixture_network import MixtureNetwork
from silhouette_core.monocular.proposal.silhouette_encoding import SilhouetteEncoding
from silhouette_core.monocular.proposal.silhouette_features import (
    FrameFeatures,
    SilhouetteCodes,
    coverage_grid,
    feet_grid,
    input_count,
    nearby_frames,
    network_inputs,
)

_MOST_MODES = 1000


@dataclass(frozen=True, eq=False)
class PoseModes:
    """M probable poses in each of T frames; lengths in statures.

    Attributes:
        probability: (T, M) float32, summing to 1.
        joints: (T, M, 15, 3) float32, relative to the pelvis, in the order of LANDMARK_NAMES, in
            the frame of a level camera with the heading of the features: right, away and up.
        sigma: (T, M, 15, 2) float32, deviations across (right and up) and along (away) the line of
            sight, scales of Student's t with 4 degrees of freedom; 0 for the pelvis.
        offset: (T, 3) float32, the pelvis's place in the window from its middle, right and down, at
            the assumed distance (1: 158 px of 240), and the logarithm of the pelvis's true distance
            along the optical axis over the assumed one.
        offset_sigma: (T, 3) float32, deviations of `offset`, likewise.
    """

    probability: NDArray[np.float32]
    joints: NDArray[np.float32]
    sigma: NDArray[np.float32]
    offset: NDArray[np.float32]
    offset_sigma: NDArray[np.float32]

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.probability)


@dataclass(frozen=True, eq=False)
class PoseProposal:
    """Trained network and encoding of silhouettes, see `proposal_learning.learn_proposal`.

    Attributes:
        encoding: makes what the network reads of silhouettes.
        network: the network, float32.
    """

    encoding: SilhouetteEncoding
    network: MixtureNetwork

    def codes(self, masks: NDArray[np.bool_]) -> SilhouetteCodes:
        """Codes of T silhouettes (T, 240, 320) bool in the window of the library, without colours.

        The window is that of `monocular.window.look_at`: the silhouette's centroid in its
        middle, 158 pixels per stature at the assumed distance.

        Raises:
            ValueError: the masks have another shape.
        """
        return self.encoding.codes(coverage_grid(masks), feet_grid(reduce_silhouette(masks)))

    def modes(
        self,
        features: FrameFeatures,
        causal: bool = False,
        frames: NDArray[np.integer] | None = None,
    ) -> PoseModes:
        """Probable poses in every frame.

        Args:
            causal: whether each frame's poses depend on no later frame.
            frames: (n,), frames whose poses are asked for; None: all.

        Returns:
            The modes of these frames.
        """
        return self.modes_many([features], causal, frames)[0]

    def modes_many(
        self,
        sequences: Sequence[FrameFeatures],
        causal: bool = False,
        frames: NDArray[np.integer] | None = None,
    ) -> list[PoseModes]:
        """Probable poses in the same frames of several sequences, see `modes`: the network reads
        them at once.
        """
        inputs = []
        for features in sequences:
            chosen = np.arange(len(features)) if frames is None else np.asarray(frames)
            nearby = nearby_frames(features.time_s)[chosen]
            inputs.append(network_inputs(features, chosen, nearby, np.full(len(chosen), causal)))
        found = self.network.mixture(np.concatenate(inputs))
        joints, sigma = (
            np.pad(one, ((0, 0), (0, 0), (1, 0), (0, 0))) for one in (found.joints, found.sigma)
        )
        ends = np.cumsum([len(one) for one in inputs])[:-1]
        whole = found.probability, joints, sigma, found.offset, found.offset_sigma
        return [
            PoseModes(*parts) for parts in zip(*(np.split(one, ends) for one in whole), strict=True)
        ]

    def arrays(self) -> dict[str, NDArray]:
        """All arrays by name, for a file; `from_arrays` is the inverse."""
        network = self.network
        return {
            **self.encoding.arrays(),
            "mean_joints": network.mean_joints,
            "modes": np.array([network.modes], np.int32),
            **{f"weight{number}": array for number, array in enumerate(network.weights)},
            **{f"bias{number}": array for number, array in enumerate(network.biases)},
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray]) -> PoseProposal:
        """Proposal of the arrays of a file.

        Raises:
            KeyError: an array is missing.
            TypeError: an array is not float32.
            ValueError: the arrays do not fit together, hold NaN, or are those of an earlier
                version.
        """
        layers = range(sum(name.startswith("weight") for name in arrays))
        # Earlier versions read principal components, by networks of three layers.
        if "inside_weight0" not in arrays or len(layers) % 2:
            raise ValueError("its proposal was learned by an earlier version")
        encoding = SilhouetteEncoding.from_arrays(arrays)
        check_array("proposal.modes", arrays["modes"], (1,), np.int32)
        joints = arrays["mean_joints"]
        shape = (len(LANDMARK_NAMES) - 1, 3)
        check_array("proposal.mean_joints", joints, shape, np.float32, finite=True)
        network = MixtureNetwork(
            tuple(arrays[f"weight{number}"] for number in layers),
            tuple(arrays[f"bias{number}"] for number in layers),
            joints,
            int(arrays["modes"][0]),
        )
        inputs = input_count(
            encoding.outline.codes, encoding.feet.components.shape[1], encoding.inside.codes
        )
        if not 1 <= network.modes <= _MOST_MODES or not layers:
            raise ValueError(f"proposal.modes is {network.modes}, and it has {len(layers)} layers")
        units = network.weights[0].shape[-1] if network.weights[0].ndim else 0
        ends = network.modes * (5 * len(network.mean_joints) + 1) + 6
        sizes = [inputs, *[units] * (len(layers) - 1), ends]
        for number, (shape, bias) in enumerate(zip(pairwise(sizes), network.biases, strict=True)):
            name = f"proposal.weight{number}"
            check_array(name, network.weights[number], shape, np.float32, finite=True)
            check_array(f"proposal.bias{number}", bias, shape[1:], np.float32, finite=True)
        return cls(encoding, network)
