"""Observed silhouettes prepared for comparison with many others."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from calib.checks import BoolArray, FloatArray, IntArray, RealArray
from silhouette_core.ranking import summable
from silhouette_core.scoring.kernels import spans as kernels


@dataclass(frozen=True, eq=False)
class Target:
    """Silhouettes seen through P windows, each compared with candidates moved by S shifts.

    Combination c of the C = P S is window c // S and shift c % S.
    """

    masks: tuple[BoolArray, ...]  #: P arrays (h, w) bool, P of eq. (7).
    weights: tuple[RealArray, ...]
    """P arrays (h, w) float32 or float64, d_P, made `summable`. Beyond the window the weight at its
    border goes on."""
    shifts_px: IntArray = field(default_factory=lambda: np.zeros((1, 2), np.int64))
    """(S, 2) int64, whole pixels (right, down) by which candidates are moved."""
    scale: float = 1.0  #: Factor on the weighted disagreement.

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", tuple(map(summable, self.weights)))

    @property
    def margin_px(self) -> int:
        """Largest shift, px."""
        return int(np.abs(self.shifts_px).max(initial=0))

    @cached_property
    def prefixes(self) -> tuple[FloatArray, FloatArray]:
        """Sums of the signed weights d_P (1 - 2 P) along rows, of every window and a margin m about
        it, (P, h + 2 m, w + 2 m + 1) float64; and the weight of each silhouette P, (C,) float64.
        """
        (height, width), margin = self.masks[0].shape, self.margin_px
        prefixes = np.empty((len(self.masks), height + 2 * margin, width + 2 * margin + 1))
        bases = [
            kernels.padded_prefix(mask, weights, margin, prefix)
            for mask, weights, prefix in zip(self.masks, self.weights, prefixes, strict=True)
        ]
        return prefixes, np.repeat(bases, len(self.shifts_px))
