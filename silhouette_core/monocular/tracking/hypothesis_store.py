"""Likeliest poses of every frame, which show the ambiguity of a single view."""

from __future__ import annotations

from array import array
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from calib.upright import Z_UP, UprightFrame
from silhouette_core.scratch_file import ScratchFile

COUNT = 5
"""Largest number of hypotheses that are stored of a frame."""


class HypothesisStore:
    """Hypotheses of all frames in a temporary file, so that memory does not grow with time."""

    def __init__(self, upright: UprightFrame | None = None) -> None:
        """Creates the file, which is deleted with the process.

        Args:
            upright: the frame in which joints are given; None: the world, in which they are stored.
        """
        self._upright = upright or UprightFrame.from_up(Z_UP)
        self._file = ScratchFile()
        self._frames, self._counts = array("q"), array("q")
        self._joints = 0

    def put(
        self, frame: int, probability: NDArray[np.float64], joints_m: NDArray[np.float64]
    ) -> None:
        """Stores a frame's n hypotheses: probabilities (n,) and joints (n, L, 3), m."""
        joints_m = self._upright.world_points(joints_m)
        self._joints = joints_m.shape[1]
        rows = np.concatenate(
            [probability[:, None], joints_m.reshape(len(probability), -1)], axis=1
        )
        self._file.append(rows.astype(np.float32).tobytes())
        self._frames.append(frame)
        self._counts.append(len(rows))

    def __iter__(self) -> Iterator[tuple[int, NDArray[np.float32], NDArray[np.float32]]]:
        """Yields frame number, probabilities (n,) and joints (n, L, 3), world, m."""
        start, width = 0, 1 + 3 * self._joints
        for frame, count in zip(self._frames, self._counts, strict=True):
            size = count * width * 4
            rows = np.frombuffer(self._file.read_at(start, size), np.float32).reshape(count, width)
            start += size
            yield frame, rows[:, 0], rows[:, 1:].reshape(count, self._joints, 3)
