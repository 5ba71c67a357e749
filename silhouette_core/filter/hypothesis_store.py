"""Likeliest poses of every frame, which show the ambiguity of a single view."""

from __future__ import annotations

import tempfile
from array import array
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from silhouette_core.filter.forward import FilterFrame, candidates_of
from silhouette_core.filter.tree_filter import TreeFilter
from silhouette_core.motion.kinematics import forward as place
from silhouette_core.motion.kinematics import landmarks, quaternions

COUNT = 5
_SAMPLES = 120
_SAME_M = 0.10  # mean distance of the joints within which two samples are one hypothesis


def top_hypotheses(
    tree: TreeFilter, filter_frame: FilterFrame, count: int = COUNT
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Likeliest groups of similar poses among the samples of a posterior.

    Args:
        tree: the tree filter.
        filter_frame: a frame and its posterior.
        count: largest number of groups.

    Returns:
        Probabilities (n,) of the groups, decreasing, and the joints (n, 15, 3) of each group's
        likeliest sample in the world, m.
    """
    model = tree.library.model
    rows = np.arange(min(len(filter_frame.posterior.samples), _SAMPLES))
    poses = candidates_of(tree, filter_frame, rows)
    joints = landmarks(
        model, *place(model, poses.root_m, quaternions(poses.root_rotation), poses.angles_rad)
    )
    apart = np.linalg.norm(joints[:, None] - joints, axis=-1).mean(-1)
    chosen: list[int] = []
    probability = np.zeros(len(rows))
    for row in rows:
        near = apart[row, chosen]
        if len(near) and near.min() < _SAME_M:
            probability[chosen[int(near.argmin())]] += filter_frame.posterior.probability[row]
        else:
            chosen.append(int(row))
            probability[row] += filter_frame.posterior.probability[row]
    best = sorted(chosen, key=lambda row: -probability[row])[:count]
    return probability[best], joints[best]


class HypothesisStore:
    """Hypotheses of all frames in a temporary file, so that memory does not grow with time."""

    def __init__(self) -> None:
        """Creates the file, which is deleted with the process."""
        self._file = tempfile.TemporaryFile()  # noqa: SIM115
        self._frames, self._counts = array("q"), array("q")

    def put(
        self, frame: int, probability: NDArray[np.float64], joints_m: NDArray[np.float64]
    ) -> None:
        """Stores a frame's n hypotheses: probabilities (n,) and joints (n, 15, 3), world, m."""
        rows = np.concatenate(
            [probability[:, None], joints_m.reshape(len(probability), -1)], axis=1
        )
        self._file.write(rows.astype(np.float32).tobytes())
        self._frames.append(frame)
        self._counts.append(len(rows))

    def __iter__(self) -> Iterator[tuple[int, NDArray[np.float32], NDArray[np.float32]]]:
        """Yields frame number, probabilities (n,) and joints (n, 15, 3)."""
        self._file.seek(0)
        for frame, count in zip(self._frames, self._counts, strict=True):
            rows = np.frombuffer(self._file.read(count * 46 * 4), np.float32).reshape(count, 46)
            yield frame, rows[:, 0], rows[:, 1:].reshape(count, 15, 3)
