"""What a scoring backend must do, and the arrays it is given."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from silhouette_core.image.spans import Spans

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Voxels:
    """An observed volume.

    Attributes:
        occupancy: (nx, ny, nz) bool, True where the body is.
        origin_m: (3,) float64, world, m: the lower corner of voxel (0, 0, 0).
        voxel_size_m: Edge of a voxel, m.

    Raises:
        TypeError: The occupancy is not bool.
        ValueError: A value has the wrong shape.
    """

    occupancy: NDArray[np.bool_]
    origin_m: FloatArray
    voxel_size_m: float

    def __post_init__(self) -> None:
        """Checks every value once."""
        if self.occupancy.dtype != np.bool_:
            raise TypeError(
                f"occupancy must be (nx, ny, nz) bool, got {self.occupancy.shape}"
                f" {self.occupancy.dtype}"
            )
        if self.occupancy.ndim != 3:
            raise ValueError(f"occupancy must be (nx, ny, nz) bool, got {self.occupancy.shape}")
        if np.shape(self.origin_m) != (3,):
            raise ValueError(f"origin_m must be (3,), got {np.shape(self.origin_m)}")
        if not self.voxel_size_m > 0:
            raise ValueError(f"voxel_size_m must be positive, got {self.voxel_size_m}")


class Backend(Protocol):
    """Scores many candidates against one observation. All backends give the same numbers, for any
    number of threads.
    """

    def voxel_overlap(
        self,
        voxels: Voxels,
        points: FloatArray,
        weights: FloatArray,
        rotations: FloatArray,
        translations: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Says for K placements of a part how much of it lies in occupied and how much in empty
        voxels.

        Args:
            voxels: The observed volume; what lies outside of it counts as empty.
            points: (P, 3) float64, m, points that fill the part, in the part's frame.
            weights: (P,) float64, what each point counts, for example its volume.
            rotations: (K, 3, 3) float64, world from part.
            translations: (K, 3) float64, m, world from part.

        Returns:
            Weight in occupied voxels (K,) float64, and in empty ones (K,) float64.

        Source: Iiyama, Kameda and Minoh, the overlap of a part with the voxels.
        """
        ...

    def span_distance(self, prefix: FloatArray, base: float, spans: Spans) -> FloatArray:
        """Measures K silhouettes' distance from an observed one.

        With P the observation, d its pixel weights and s = d (1 - 2 P), the weighted disagreement
        of P with a silhouette Q is sum(d P) + sum of s over Q, and the latter is a difference of
        two prefix sums for every run of Q in a row.

        Args: prefix: (h, w + 1) float64, sums of s along rows; the first column is zero (see
            `signed_prefix`). base: sum(d P). spans: K silhouettes of at most (h, w).

        Returns:
            (K,) float64.

        Source: Okada and Stenger, eq. (7)-(9), rearranged.
        """
        ...


def signed_prefix(observation: NDArray[np.bool_], weights: FloatArray) -> tuple[FloatArray, float]:
    """Prepares an observed silhouette (h, w) bool with pixel weights (h, w) for `span_distance`;
    returns prefix and base.
    """
    if observation.shape != weights.shape:
        raise ValueError(
            f"weights must be {observation.shape} as the observation, got {weights.shape}"
        )
    signed = np.where(observation, -weights, weights).astype(np.float64)
    prefix = np.zeros((signed.shape[0], signed.shape[1] + 1))
    np.cumsum(signed, axis=1, out=prefix[:, 1:])
    return prefix, float(weights[observation].sum())


def check_placements(
    points: FloatArray, weights: FloatArray, rotations: FloatArray, translations: FloatArray
) -> None:
    """Raises ValueError where the arguments of `voxel_overlap` do not belong together."""
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"points must be (P, 3), got {points.shape}")
    if weights.shape != (len(points),):
        raise ValueError(f"weights must be ({len(points)},) as the points, got {weights.shape}")
    if rotations.ndim != 3 or rotations.shape[1:] != (3, 3):
        raise ValueError(f"rotations must be (K, 3, 3), got {rotations.shape}")
    if translations.shape != (len(rotations), 3):
        raise ValueError(
            f"translations must be ({len(rotations)}, 3) as the rotations, got {translations.shape}"
        )


def check_spans(prefix: FloatArray, spans: Spans) -> None:
    """Raises ValueError where a silhouette reaches out of the prefix image."""
    if prefix.ndim != 2:
        raise ValueError(f"prefix must be (h, w + 1), got {prefix.shape}")
    if len(spans.rows) and (
        spans.rows.min() < 0
        or spans.rows.max() >= prefix.shape[0]
        or spans.starts.min() < 0
        or spans.ends.max() >= prefix.shape[1]
    ):
        raise ValueError(
            f"a silhouette reaches out of the image of {prefix.shape[0]} rows and"
            f" {prefix.shape[1] - 1} columns"
        )
