"""Convolutional encoder: from grids of a silhouette to a few numbers that tell poses apart.

All shapes are those of the grids of `silhouette_features`, of 60 x 80 cells.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from calib.checks import Float32Array, check_array
from silhouette_core.monocular.proposal.silhouette_features import GRID, product, scaled_components

SIZES = (5, 3, 3)  #: Side of the filters of every convolution, in cells.
STRIDE = 2
_WIDTHS = (1, 2, 4)  # channels after every convolution, relative to the first one
_AT_ONCE = 16  # images, whose patches stay in the cache of a processor


@dataclass(frozen=True, eq=False)
class ConvolutionalEncoder:
    r"""Three convolutions that halve the grid, and a linear layer.

    .. math::

        x_{i+1} = \max(0, W_i \star_2 x_i + b_i), \; i = 0, 1, 2, \qquad c = W_3 x_3 + b_3

    where :math:`\star_2` is the convolution at every other cell, 0 outside the grid.

    Source: LeCun et al., Gradient-based learning applied to document recognition (1998).
    """

    weights: tuple[Float32Array, ...]
    """Of the convolutions, (5 x 5 x channels, C), (3 x 3 x C, 2 C) and (3 x 3 x 2 C, 4 C) with C
    filters in the first; of the linear layer (8 x 10 x 4 C, K)."""
    biases: tuple[Float32Array, ...]  #: one (outputs,) each.

    @classmethod
    def initial(
        cls, channels: int, filters: int, codes: int, rng: np.random.Generator
    ) -> "ConvolutionalEncoder":
        """Encoder with random weights.

        Args:
            filters: number C of filters of the first convolution.
            codes: number K of codes.
        """
        shapes = layer_shapes(channels, filters, codes)
        weights = [
            (rng.normal(size=shape) * np.sqrt(2 / shape[0])).astype(np.float32) for shape in shapes
        ]
        biases = [np.zeros(shape[1], np.float32) for shape in shapes]
        return cls(tuple(weights), tuple(biases))

    @classmethod
    def from_arrays(
        cls, name: str, channels: int, arrays: Mapping[str, NDArray]
    ) -> "ConvolutionalEncoder":
        """Encoder of the arrays of a file; `arrays` is the inverse. Raises KeyError where an array
        is missing; TypeError where an array is not float32; ValueError where the arrays do not fit
        together, or hold NaN.

        Args:
            name: of the encoder, with which the arrays' names begin.
            arrays: all arrays of the file.
        """
        layers = range(len(SIZES) + 1)
        weights = [arrays[f"{name}_weight{layer}"] for layer in layers]
        biases = [arrays[f"{name}_bias{layer}"] for layer in layers]
        filters, codes = biases[0].size, biases[-1].size
        check_layers(f"{name}_", weights, biases, layer_shapes(channels, filters, codes))
        return cls(tuple(weights), tuple(biases))

    def arrays(self, name: str) -> dict[str, NDArray]:
        """All arrays by name, for a file."""
        return {
            **{f"{name}_weight{layer}": one for layer, one in enumerate(self.weights)},
            **{f"{name}_bias{layer}": one for layer, one in enumerate(self.biases)},
        }

    @property
    def codes(self) -> int:
        """Number K of codes."""
        return len(self.biases[-1])

    def encode(self, images: Float32Array) -> Float32Array:
        """Codes (N, K) of images (N, 60, 80, channels)."""
        starts = range(0, len(images), _AT_ONCE)
        codes = [self._codes(images[start : start + _AT_ONCE]) for start in starts]
        return np.concatenate([np.zeros((0, self.codes), np.float32), *codes])

    def ordered(self, images: Float32Array) -> "ConvolutionalEncoder":
        """The encoder whose codes are the principal components of these over images (N, 60, 80,
        channels), scaled as by `fit_basis`.
        """
        codes = self.encode(images).astype(np.float64)
        mean = codes.mean(axis=0)
        basis = scaled_components(codes - mean)
        weights = product(self.weights[-1], basis.astype(np.float32))
        bias = ((self.biases[-1] - mean)[None] @ basis)[0].astype(np.float32)
        return ConvolutionalEncoder((*self.weights[:-1], weights), (*self.biases[:-1], bias))

    def _codes(self, state: Float32Array) -> Float32Array:
        for size, weights, bias in zip(SIZES, self.weights, self.biases, strict=False):
            patches = _patches(state, size)
            outputs = product(patches.reshape(-1, len(weights)), weights)
            outputs += bias
            np.maximum(outputs, 0, out=outputs)
            state = outputs.reshape(*patches.shape[:3], -1)
        return product(state.reshape(len(state), -1), self.weights[-1]) + self.biases[-1]


def _halved(cells: int) -> int:
    return -(-cells // STRIDE)


def _patches(state: Float32Array, size: int) -> Float32Array:
    """Patches (N, h / 2, w / 2, size, size, C) of a state (N, h, w, C)."""
    beyond = [(_halved(cells) - 1) * STRIDE + size - cells for cells in state.shape[1:3]]
    margins = [(0, 0), *((cells // 2, cells - cells // 2) for cells in beyond), (0, 0)]
    windows = sliding_window_view(np.pad(state, margins), (size, size), (1, 2))
    return np.ascontiguousarray(np.moveaxis(windows[:, ::STRIDE, ::STRIDE], 3, -1))


def layer_grid(layer: int) -> tuple[int, int]:
    """Rows and columns of what a convolution (0, 1, 2) or the linear layer (3) reads."""
    rows, columns = GRID
    for _ in range(layer):
        rows, columns = _halved(rows), _halved(columns)
    return rows, columns


def layer_shapes(channels: int, filters: int, codes: int) -> list[tuple[int, int]]:
    """Shapes of the weights of an encoder, see `ConvolutionalEncoder.initial`."""
    counts = [channels, *(width * filters for width in _WIDTHS)]
    shapes = [
        (size * size * before, after)
        for size, before, after in zip(SIZES, counts[:-1], counts[1:], strict=True)
    ]
    rows, columns = layer_grid(len(SIZES))
    return [*shapes, (rows * columns * counts[-1], codes)]


def check_layers(
    name: str,
    weights: Sequence[NDArray],
    biases: Sequence[NDArray],
    shapes: Iterable[tuple[int, int]],
) -> None:
    """Refuses layers (TypeError, ValueError) that are not float32, of these shapes and finite."""
    for layer, (shape, weight, bias) in enumerate(zip(shapes, weights, biases, strict=True)):
        for kind, array, wanted in (("weight", weight, shape), ("bias", bias, shape[1:])):
            label = f"proposal.{name}{kind}{layer}"
            check_array(label, array, wanted, np.float32, finite=True)
