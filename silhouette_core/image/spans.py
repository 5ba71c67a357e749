"""Silhouettes as runs of foreground in image rows."""

from collections.abc import Iterable
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

    rows: NDArray[np.int32]  #: (S,) int32, image row of each run.
    starts: NDArray[np.int32]  #: (S,) int32, its first column.
    ends: NDArray[np.int32]  #: (S,) int32, the column after its last.
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
    def from_masks(cls, masks: Iterable[BoolArray]) -> "Spans":
        """Takes the runs of silhouettes (h, w) bool, row by row from the top."""
        result = []
        for mask in masks:
            steps = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8), axis=1)
            rows, starts = np.nonzero(steps > 0)
            result.append((rows, starts, np.nonzero(steps < 0)[1]))
        offsets = np.cumsum([0] + [len(rows) for rows, _, _ in result], dtype=np.int64)
        columns = (
            np.concatenate([np.zeros(0, np.int32), *column]).astype(np.int32)
            for column in zip(*result, strict=True)
        )
        rows, starts, ends = columns if result else (np.zeros(0, np.int32),) * 3
        return cls(rows, starts, ends, offsets)
