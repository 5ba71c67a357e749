"""The likeliest poses of every frame, so that what one camera leaves open can be seen."""

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
_LOOKED_AT = 120
_ALIKE_M = 0.10  # mean distance of the joints within which two samples count as one hypothesis


def top_hypotheses(
    tree: TreeFilter, filter_frame: FilterFrame, count: int = COUNT
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Groups a posterior's samples into poses that differ.

    Args:
        tree: the filter.
        filter_frame: a frame's posterior.
        count: how many at most.

    Returns: probabilities (n,), falling, and the 15 joints (n, 15, 3) of each group's likeliest
        sample, world, m.
    """
    model = tree.library.model
    rows = np.arange(min(len(filter_frame.posterior.samples), _LOOKED_AT))
    poses = candidates_of(tree, filter_frame, rows)
    joints = landmarks(
        model, *place(model, poses.root_m, quaternions(poses.root_rotation), poses.angles_rad)
    )
    apart = np.linalg.norm(joints[:, None] - joints, axis=-1).mean(-1)
    chosen: list[int] = []
    probability = np.zeros(len(rows))
    for row in rows:
        near = apart[row, chosen]
        if len(near) and near.min() < _ALIKE_M:
            probability[chosen[int(near.argmin())]] += filter_frame.posterior.probability[row]
        else:
            chosen.append(int(row))
            probability[row] += filter_frame.posterior.probability[row]
    best = sorted(chosen, key=lambda row: -probability[row])[:count]
    return probability[best], joints[best]


class HypothesisStore:
    """Hypotheses of all frames, kept in a scratch file, so that memory does not grow with time."""

    def __init__(self) -> None:
        """Makes the scratch file; it vanishes with the process."""
        self._file = tempfile.TemporaryFile()  # noqa: SIM115
        self._frames, self._counts = array("q"), array("q")

    def put(
        self, frame: int, probability: NDArray[np.float64], joints_m: NDArray[np.float64]
    ) -> None:
        """Keeps a frame's n hypotheses: probabilities (n,) and joints (n, 15, 3), world, m."""
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
