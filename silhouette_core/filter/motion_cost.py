"""The likeliest course through the candidates of a finished recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation


@dataclass(frozen=True, eq=False)
class PoseCandidates:
    """Poses that one frame allows. M of them, with D joint angles.

    Attributes:
        root_m: (M, 3) float64, world.
        root_rotation: (M, 3, 3) float64, world from body.
        angles_rad: (M, D) float64.
        occluded: (M, D) bool, whether the part that an angle turns is hidden, eq. (3).
        log_likelihood: (M,) float64.
        time_s: when.
    """

    root_m: NDArray[np.float64]
    root_rotation: NDArray[np.float64]
    angles_rad: NDArray[np.float64]
    occluded: NDArray[np.bool_]
    log_likelihood: NDArray[np.float64]
    time_s: float


@dataclass(frozen=True, eq=False)
class ProcessNoise:
    """How far a body moves within 1/30 s. D joint angles.

    Attributes: angles_rad: (D,) float64. turn_rad: of the whole body. place_m: of the whole body.
        occluded: how many times farther hidden parts go, m of eq. (5). jump: what a transition
        costs at most, as a number of nats: beyond it the track is taken to start anew. grain_rad:
        distance of neighbouring poses in the library, which no motion can be finer than.
    """

    angles_rad: NDArray[np.float64]
    turn_rad: float = 0.10
    place_m: float = 0.05
    occluded: float = 5.0
    jump: float = 40.0
    grain_rad: float = 0.10


def transition_cost(
    before: PoseCandidates, after: PoseCandidates, rest: ProcessNoise
) -> NDArray[np.float64]:
    """Returns (M, M') float64: the negative logarithm of eq. (4) between all candidates of two
    frames, up to a constant each.

    Source: Okada and Stenger, eq. (4) and (5): the source pose decides how far its hidden parts may
    go.
    """
    pace = max(abs(after.time_s - before.time_s) * 30.0, 0.5)
    sigma = np.sqrt(
        (rest.angles_rad * pace * np.where(before.occluded, rest.occluded, 1.0)) ** 2
        + rest.grain_rad**2
    )
    scaled = before.angles_rad / sigma
    # |a - b|^2 with a's own scale: expanded, so that no (M, M', D) array is made.
    precision = 1.0 / sigma**2
    cost = (
        (scaled**2).sum(1)[:, None]
        - 2 * (scaled / sigma) @ after.angles_rad.T
        + precision @ (after.angles_rad**2).T
    )
    # The angle between rotations from the trace of their quotient.
    trace = np.einsum("aij,bij->ab", before.root_rotation, after.root_rotation)
    turn = np.arccos(np.clip((trace - 1) / 2, -1.0, 1.0))
    cost += turn**2 / ((rest.turn_rad * pace) ** 2 + rest.grain_rad**2)
    gap = before.root_m[:, None] - after.root_m[None]
    cost += (gap**2).sum(-1) / ((rest.place_m * pace) ** 2 + 0.05**2)
    return np.minimum(0.5 * np.maximum(cost, 0.0), rest.jump)


def viterbi(
    frames: Sequence[PoseCandidates], rest: ProcessNoise, start: NDArray[np.float64] | None = None
) -> NDArray[np.int64]:
    """Finds the course of least cost.

    Args:
        frames: the candidates of T frames, each at least one.
        rest: how the body moves.
        start: (M,) log prior of the first frame's candidates; None: all alike.

    Returns:
        (T,) int64, the candidate taken in every frame.

    Source: Viterbi's algorithm over the samples that Okada and Stenger's filter leaves.
    """
    cost = -frames[0].log_likelihood - (0.0 if start is None else start)
    back: list[NDArray[np.int64]] = []
    for before, after in pairwise(frames):
        total = cost[:, None] + transition_cost(before, after, rest)
        back.append(total.argmin(0))
        cost = total.min(0) - after.log_likelihood
    taken = [int(cost.argmin())]
    for choice in back[::-1]:
        taken.append(int(choice[taken[-1]]))
    return np.array(taken[::-1], np.int64)


def turned(heading_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the rotations (N, 3, 3) about the vertical by (N,) headings."""
    return Rotation.from_rotvec(np.asarray(heading_rad)[:, None] * [0.0, 0.0, 1.0]).as_matrix()
