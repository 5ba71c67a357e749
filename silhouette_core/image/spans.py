"""Silhouettes as runs of foreground in image rows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.checks import BoolArray, IntArray, check_array

Rectangle = tuple[int, int, int, int]
"""(left, top, right, bottom) in pixels; columns left to right - 1, rows top to bottom - 1."""


@dataclass(frozen=True, eq=False)
class Spans:
    """Silhouettes as runs of foreground in image rows; those of silhouette k are number offsets[k]
    to offsets[k + 1]. Raises ValueError where the arrays do not belong together.
    """

    rows: NDArray[np.int16]  #: (S,) int16, image row of each run.
    starts: NDArray[np.int16]  #: (S,) int16, its first column.
    ends: NDArray[np.int16]  #: (S,) int16, the column after its last.
    offsets: IntArray  #: (K + 1,) int64.

    def __post_init__(self) -> None:
        count = len(self.rows)
        check_array("starts", self.starts, (count,))
        check_array("ends", self.ends, (count,))
        offsets = self.offsets
        if (
            not len(offsets)
            or offsets[0] != 0
            or offsets[-1] != count
            or (np.diff(offsets) < 0).any()
        ):
            raise ValueError(
                f"offsets must rise from 0 to the number of runs, {count}, got {offsets}"
            )

    def __len__(self) -> int:
        """Counts the silhouettes."""
        return len(self.offsets) - 1

    @property
    def bounds(self) -> Rectangle:
        """Smallest rectangle that holds all silhouettes; (0, 0, 0, 0) where all are empty."""
        if not len(self.rows):
            return 0, 0, 0, 0
        left, top = int(self.starts.min()), int(self.rows.min())
        return left, top, int(self.ends.max()), int(self.rows.max()) + 1

    @classmethod
    def from_masks(cls, masks: Sequence[BoolArray] | BoolArray) -> "Spans":
        """Takes the runs of N silhouettes (h, w) bool of one size, row by row from the top."""
        edges = np.diff(np.pad(masks, ((0, 0), (0, 0), (1, 1))), axis=2)
        runs = np.flatnonzero(edges).reshape(-1, 2)  # where each begins, and where it has ended
        lines, columns = np.divmod(runs, edges.shape[2])
        number, rows = np.divmod(lines[:, 0], edges.shape[1])
        starts, ends = np.ascontiguousarray(columns.T, np.int16)
        offsets = np.searchsorted(number, np.arange(len(edges) + 1))
        return cls(rows.astype(np.int16), starts, ends, offsets)
