"""Learned proposal: probable poses from silhouettes, stored in the pose library."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from calib.checks import BoolArray, ByteArray, IndexArray, check_array
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.image.cleanup import reduce_silhouette
from silhouette_core.monocular.proposal.convolutional_encoder import (
    ConvolutionalEncoder,
    check_layers,
)
from silhouette_core.monocular.proposal.mixture_network import Mixture, MixtureNetwork
from silhouette_core.monocular.proposal.silhouette_features import (
    FEET_GRID,
    OFFSETS_S,
    SEEN_CODES,
    FrameFeatures,
    InsideGrids,
    SilhouetteBasis,
    SilhouetteCodes,
    coverage_grid,
    feet_grid,
    input_count,
    inside_images,
    nearby_frames,
    network_inputs,
    outline_images,
)

_MOST_MODES = 1000
_JOINT_INPUTS = SEEN_CODES * (1 + len(OFFSETS_S))


@dataclass(frozen=True, eq=False)
class PoseProposal:
    """Trained network and encoding of silhouettes, see `proposal_learning.learn_proposal`."""

    encoding: "SilhouetteEncoding"  #: makes what the network reads of silhouettes.
    network: MixtureNetwork  #: the network, float32.

    def codes(self, masks: BoolArray) -> SilhouetteCodes:
        """Codes of T silhouettes (T, 240, 320) bool in the window of the library, without colours.

        The window is that of `monocular.window.look_at`: the silhouette's centroid in its middle,
        158 pixels per stature at the assumed distance. Raises ValueError where the masks have
        another shape.
        """
        return self.encoding.codes(coverage_grid(masks), feet_grid(reduce_silhouette(masks)))

    def modes(
        self,
        sequences: Sequence[FrameFeatures],
        causal: bool = False,
        frames: IndexArray | None = None,
    ) -> list[Mixture]:
        """Probable poses in the same frames of several sequences, which the network reads at once.

        Args:
            causal: whether each frame's poses depend on no later frame.
            frames: (n,), frames whose poses are asked for; None: all.

        Returns:
            The modes of these frames in each sequence, the pelvis, at 0, the first of 15 joints.
        """
        inputs = []
        for features in sequences:
            chosen = np.arange(len(features)) if frames is None else np.asarray(frames)
            nearby = nearby_frames(features.time_s)[chosen]
            inputs.append(network_inputs(features, chosen, nearby, np.full(len(chosen), causal)))
        mixture = self.network.mixture(np.concatenate(inputs))
        joints, sigma = (
            np.pad(one, ((0, 0), (0, 0), (1, 0), (0, 0))) for one in (mixture.joints, mixture.sigma)
        )
        ends = np.cumsum([len(one) for one in inputs])[:-1]
        whole = mixture.probability, joints, sigma, mixture.offset, mixture.offset_sigma
        return [
            Mixture(*parts) for parts in zip(*(np.split(one, ends) for one in whole), strict=True)
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
    def from_arrays(cls, arrays: Mapping[str, NDArray]) -> "PoseProposal":
        """Proposal of the arrays of a file. Raises KeyError where an array is missing; TypeError
        where an array is not float32; ValueError where the arrays do not fit together, hold NaN, or
        are an earlier version's.
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
        weights = [arrays[f"weight{number}"] for number in layers]
        inputs = input_count(
            encoding.outline.codes, encoding.feet.components.shape[1], encoding.inside.codes
        )
        if weights and weights[0].ndim == 2 and len(weights[0]) == inputs - _JOINT_INPUTS:
            # Learned before joints were read: it goes on without them.
            weights[0] = np.pad(weights[0], ((0, _JOINT_INPUTS), (0, 0)))
        network = MixtureNetwork(
            tuple(weights),
            tuple(arrays[f"bias{number}"] for number in layers),
            joints,
            int(arrays["modes"][0]),
        )
        if not 1 <= network.modes <= _MOST_MODES or not layers:
            raise ValueError(f"proposal.modes is {network.modes}, and it has {len(layers)} layers")
        units = network.weights[0].shape[-1] if network.weights[0].ndim else 0
        ends = network.modes * (5 * len(network.mean_joints) + 1) + 6
        sizes = [inputs, *[units] * (len(layers) - 1), ends]
        check_layers("", network.weights, network.biases, pairwise(sizes))
        return cls(encoding, network)


@dataclass(frozen=True, eq=False)
class SilhouetteEncoding:
    """What makes codes of grids."""

    outline: ConvolutionalEncoder  #: encoder of the grids of coverage, reads `outline_images`.
    feet: SilhouetteBasis  #: basis of the grids of the lowest parts.
    inside: ConvolutionalEncoder  #: encoder of what lies inside, reads `inside_images`.

    def codes(self, coverage: ByteArray, feet: ByteArray) -> SilhouetteCodes:
        """Codes of T silhouettes without colours.

        Args:
            coverage: (T, 60, 80), see `coverage_grid`.
            feet: (T, 28, 48), see `feet_grid`.
        """
        return SilhouetteCodes(
            self.outline.encode(outline_images(coverage)),
            self.feet.encode(feet),
            np.zeros((len(coverage), self.inside.codes), np.float32),
            np.zeros(len(coverage), bool),
            np.zeros((len(coverage), SEEN_CODES), np.float32),
        )

    def with_inside(self, codes: SilhouetteCodes, inside: InsideGrids) -> SilhouetteCodes:
        """Codes of T silhouettes with what lies inside them, grids (T, 60, 80)."""
        return replace(
            codes,
            inside=self.inside.encode(inside_images(inside.skin, inside.shading)),
            coloured=np.ones(len(codes), bool),
        )

    def arrays(self) -> dict[str, NDArray]:
        """All arrays by name, for a file; `from_arrays` is the inverse."""
        return {
            **self.outline.arrays("outline"),
            "mean_feet": self.feet.mean,
            "feet_basis": self.feet.components,
            **self.inside.arrays("inside"),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray]) -> "SilhouetteEncoding":
        """Encoding of the arrays of a file. Raises KeyError where an array is missing; TypeError
        where an array is not float32; ValueError where the arrays do not fit together, or hold NaN.
        """
        cells = FEET_GRID[0] * FEET_GRID[1]
        feet = SilhouetteBasis(arrays["mean_feet"], arrays["feet_basis"])
        check_array("proposal.mean_feet", feet.mean, (cells,), np.float32, finite=True)
        shape = (cells, "K")
        check_array("proposal.feet_basis", feet.components, shape, np.float32, finite=True)
        return cls(
            ConvolutionalEncoder.from_arrays("outline", 1, arrays),
            feet,
            ConvolutionalEncoder.from_arrays("inside", 2, arrays),
        )
