"""From the grids of silhouettes to their codes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.checks import check_array
from silhouette_core.monocular.proposal.convolutional_encoder import ConvolutionalEncoder
from silhouette_core.monocular.proposal.silhouette_features import (
    FEET_GRID,
    InsideGrids,
    SilhouetteBasis,
    SilhouetteCodes,
    inside_images,
    outline_images,
)


@dataclass(frozen=True, eq=False)
class SilhouetteEncoding:
    """What makes codes of grids.

    Attributes:
        outline: encoder of the grids of coverage, reads `outline_images`.
        feet: basis of the grids of the lowest parts.
        inside: encoder of what lies inside, reads `inside_images`.
    """

    outline: ConvolutionalEncoder
    feet: SilhouetteBasis
    inside: ConvolutionalEncoder

    @property
    def parameters(self) -> list[NDArray[np.float32]]:
        """Weights and biases of both encoders."""
        return [*self.outline.parameters, *self.inside.parameters]

    def codes(self, coverage: NDArray[np.uint8], feet: NDArray[np.uint8]) -> SilhouetteCodes:
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
    def from_arrays(cls, arrays: Mapping[str, NDArray]) -> SilhouetteEncoding:
        """Encoding of the arrays of a file.

        Raises:
            KeyError: an array is missing.
            TypeError: an array is not float32.
            ValueError: the arrays do not fit together, or hold NaN.
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
