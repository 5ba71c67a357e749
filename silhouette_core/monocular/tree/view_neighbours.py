"""Neighbours of the samples of a large library, found for some of its poses at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from silhouette_core.monocular.occlusion import MAGNIFICATION
from silhouette_core.monocular.tree.kernels import transitions as kernels
from silhouette_core.monocular.tree.transitions import view_orientations

KEPT_OF_MANY = 32
"""Number of neighbours stored for every sample: half as many as in a library of one tree, whose
samples are farther apart."""
_CANDIDATES = 96  # base poses, the nearest by their joints, whose views are candidates
_AT_ONCE = 1024


@dataclass(frozen=True, eq=False)
class NeighbourTask:
    """Base poses first to last - 1, whose samples' neighbours are wanted.

    Attributes:
        first: first base pose.
        last: one past the last.
        angles: (B, D) float32, joint angles of all base poses, radians.
        quaternion: (B, 4) float32, orientations of all base poses.
        views: (V, 2) float64, yaw and pitch, radians.
        occluded: ((last - first) V, 27) bool, flags of the samples, view by view of each pose.
        dof_part: (D,) int32, part of each joint angle.
        sigma_rad: (D,) float32, step sizes of the joint angles.
        root_sigma_rad: step size of the orientation.
    """

    first: int
    last: int
    angles: NDArray[np.float32]
    quaternion: NDArray[np.float32]
    views: NDArray[np.float64]
    occluded: NDArray[np.bool_]
    dof_part: NDArray[np.int32]
    sigma_rad: NDArray[np.float32]
    root_sigma_rad: float


def view_neighbours(task: NeighbourTask) -> dict[str, NDArray]:
    """Nearest samples of some samples, for both motion models, see `transitions.find_neighbours`.

    Candidates are the views of the 96 base poses that are nearest in joint angles, in sigmas of
    model DM1, for DM2 too: it magnifies the sigmas of what is occluded, and the poses that become
    near thereby are not all among them.

    Args:
        task: the samples.

    Returns:
        dm1.index and dm2.index (n, K) int32, dm1.square and dm2.square (n, K) float32, for the n
        samples of the task's base poses: sample b V + v is base pose b from view v.
    """
    views = len(task.views)
    scaled = task.angles / task.sigma_rad.astype(np.float64)
    bases = np.empty((task.last - task.first, min(_CANDIDATES, len(scaled))), np.int32)
    squares = np.empty(bases.shape)
    kernels.nearest_rows(scaled, task.first, bases, squares)
    orientation = _sample_orientations(task)
    count = (task.last - task.first) * views
    result: dict[str, NDArray] = {}
    for name in ("dm1", "dm2"):
        index = np.empty((count, KEPT_OF_MANY), np.int32)
        square = np.empty((count, KEPT_OF_MANY), np.float32)
        for start in range(0, count, _AT_ONCE):
            rows = slice(start, min(start + _AT_ONCE, count))
            _fill(task, name, bases, squares, orientation, rows, index[rows], square[rows])
        result |= {f"{name}.index": index, f"{name}.square": square}
    return result


def neighbour_tasks(
    count: int, blocks: int, occluded: NDArray[np.bool_], **shared: object
) -> Sequence[NeighbourTask]:
    """Tasks for all of `count` base poses, in `blocks` of about equal size."""
    views = len(occluded) // count
    edges = np.linspace(0, count, min(blocks, count) + 1).astype(int)
    return [
        NeighbourTask(
            int(first),
            int(last),
            occluded=np.ascontiguousarray(occluded[first * views : last * views]),
            **shared,  # type: ignore[arg-type]
        )
        for first, last in pairwise(edges)
    ]


def _sample_orientations(task: NeighbourTask) -> NDArray[np.float64]:
    """Orientations of all samples (B V, 9), see `transitions.view_orientations`."""
    turns = view_orientations(np.tile([1.0, 0, 0, 0], (len(task.views), 1)), task.views)
    upright = view_orientations(task.quaternion, np.zeros((len(task.quaternion), 2)))
    product = turns.reshape(1, -1, 3, 3) @ upright.reshape(-1, 1, 3, 3)
    return product.reshape(-1, 9) * np.sqrt(2)


def _fill(
    task: NeighbourTask,
    name: str,
    bases: NDArray[np.int32],
    squares: NDArray[np.float64],
    orientation: NDArray[np.float64],
    rows: slice,
    index: NDArray[np.int32],
    square: NDArray[np.float32],
) -> None:
    """Fills index and square of some of the task's samples."""
    views = len(task.views)
    base = np.arange(rows.start, rows.stop) // views
    candidates, near = bases[base], squares[base]
    per_root = np.full(len(base), 1.0 / task.root_sigma_rad**2)
    if name == "dm2":
        hidden = task.occluded[rows]
        magnified = np.where(hidden[:, task.dof_part], MAGNIFICATION, 1.0) * task.sigma_rad
        own = task.angles[task.first + base].astype(np.float64)
        apart = (task.angles[candidates] - own[:, None]) / magnified[:, None]
        near = (apart**2).sum(axis=2)
        order = np.argsort(near, axis=1, kind="stable")
        candidates = np.take_along_axis(candidates, order, 1)
        near = np.take_along_axis(near, order, 1)
        per_root = np.where(hidden[:, 0], 1.0 / MAGNIFICATION**2, 1.0) * per_root
    same_pitch = int((task.views[:, 1] == task.views[0, 1]).sum())
    sources = np.arange(rows.start, rows.stop) + task.first * views
    kernels.nearest_samples(
        sources, candidates, near, orientation, per_root, views, same_pitch, index, square
    )
