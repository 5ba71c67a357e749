"""Learned proposal: probable poses from silhouettes, stored in the pose library."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from silhouette_core.image.cleanup import reduce_silhouette
from silhouette_core.proposal.mixture_network import MixtureNetwork
from silhouette_core.proposal.silhouette_features import (
    FrameFeatures,
    SilhouetteBasis,
    SilhouetteCodes,
    coverage_grid,
    feet_grid,
    nearby_frames,
    network_inputs,
)


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
    """Trained network and the basis of its silhouettes, see `proposal_learning.learn_proposal`.

    Attributes:
        coverage: basis of the grids of coverage.
        feet: basis of the grids of the lowest parts.
        skin: basis of the grids of what has the colours of the head.
        network: the network, float32.
    """

    coverage: SilhouetteBasis
    feet: SilhouetteBasis
    skin: SilhouetteBasis
    network: MixtureNetwork

    def codes(self, masks: NDArray[np.bool_]) -> SilhouetteCodes:
        """Codes of T silhouettes (T, 240, 320) bool in the window of the library, without colours.

        The window is that of `silhouette_core.filter.window.look_at`: the silhouette's centroid in
        its middle, 158 pixels per stature at the assumed distance.

        Raises:
            ValueError: the masks have another shape.
        """
        return SilhouetteCodes(
            self.coverage.encode(coverage_grid(masks)),
            self.feet.encode(feet_grid(reduce_silhouette(masks))),
            np.zeros((len(masks), self.skin.components.shape[1]), np.float32),
            np.zeros(len(masks), bool),
        )

    def with_skin(self, codes: SilhouetteCodes, skin: NDArray[np.uint8]) -> SilhouetteCodes:
        """Codes of T silhouettes with grids (T, 60, 80) uint8, 0 to 4, of what has the colours of
        the head.
        """
        return replace(codes, skin=self.skin.encode(skin), coloured=np.ones(len(codes), bool))

    def modes(
        self,
        features: FrameFeatures,
        causal: bool = False,
        frames: NDArray[np.integer] | None = None,
    ) -> PoseModes:
        """Probable poses in every frame.

        Args:
            features: of the frames.
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
            "mean_coverage": self.coverage.mean,
            "coverage_basis": self.coverage.components,
            "mean_feet": self.feet.mean,
            "feet_basis": self.feet.components,
            "mean_skin": self.skin.mean,
            "skin_basis": self.skin.components,
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
            ValueError: the arrays do not fit together, or are those of an earlier version.
        """
        if "mean_skin" not in arrays:
            raise ValueError("its proposal was learned by an earlier version")
        bases = {
            name: SilhouetteBasis(arrays[f"mean_{name}"], arrays[f"{name}_basis"])
            for name in ("coverage", "feet", "skin")
        }
        layers = range(sum(name.startswith("weight") for name in arrays))
        network = MixtureNetwork(
            tuple(arrays[f"weight{number}"] for number in layers),
            tuple(arrays[f"bias{number}"] for number in layers),
            arrays["mean_joints"],
            int(arrays["modes"][0]),
        )
        sizes = [weight.shape for weight in network.weights]
        ends = network.modes * (5 * len(network.mean_joints) + 1) + 6
        if (
            not sizes
            or any(a[1] != b[0] for a, b in pairwise(sizes))
            or any(bias.shape != size[1:] for bias, size in zip(network.biases, sizes, strict=True))
            or sizes[-1][1] != ends
            or any(len(basis.mean) != len(basis.components) for basis in bases.values())
        ):
            raise ValueError("the arrays of the proposal do not fit together")
        return cls(**bases, network=network)
