"""How a pose moves on to the next: the motion models DM1 and DM2 as sparse matrices over a library.

The motion model is a random walk: the next pose is normally distributed about the last, with a
standard deviation sigma_j for every joint angle (4), five times as much for joints of parts that
the last pose hides (5). Since the source pose decides its own deviations, all transitions are known
when the library is made. For every sample the nearest others, in its own sigmas, are kept with
their squared distances; what is farther counts as impossible. The weight of a kept one is exact.
What is lost is little: in a library of 60,000 recorded samples the farthest of the 64 that are kept
has, for 95 % of the sources, less than 1e-7 of the weight of staying.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from silhouette_core.library.kernels import transitions as kernels
from silhouette_core.motion.kinematics import rotation_matrices
from silhouette_core.progress import Reporter

if TYPE_CHECKING:
    from silhouette_core.library.pose_library import PoseLibrary

MAGNIFICATION = 5.0
"""m of eq. (5)."""
KEPT = 64
_CANDIDATES = 256  # base poses, the nearest by their joints, of which all views are looked at
_AT_ONCE = 2048


def transitions(
    library: PoseLibrary,
    occlusion_aware: bool,
    sigma_scale: float = 1.0,
    neighbours: int = KEPT,
    normalised: bool = True,
) -> csr_matrix:
    """Makes the matrix of p(x_t | x_t-1) over a library.

    Args: library: the library. occlusion_aware: DM2, with eq. (5); else DM1, without. sigma_scale:
        factor on all sigmas, which are those of 1/30 s: at another frame rate sqrt(30 / fps), for a
        random walk. neighbours: how many of the kept samples are used, at most. normalised: every
        sample shares its whole probability out among its neighbours. Else a sample near to it gets
        the same whether
            there are many others or none, and what is believed gathers where poses are dense.

    Returns: (N, N) float32: row i holds where sample i goes, summing to 1 if normalised; the prior
        (14) is `matrix.T @ posterior`.

    Source: Okada and Stenger, eq. (3)-(5) and (14).
    """
    kept = library.neighbours or find_neighbours(library)
    name = "dm2" if occlusion_aware else "dm1"
    index, square = (
        np.asarray(kept[f"{name}.{what}"])[:, :neighbours] for what in ("index", "square")
    )
    weight = np.exp(square.astype(np.float64) / (-2 * sigma_scale**2))
    if normalised:
        weight /= weight.sum(axis=1, keepdims=True)
    rows = np.arange(0, index.size + 1, index.shape[1])
    matrix = csr_matrix(
        (weight.ravel().astype(np.float32), index.ravel().copy(), rows),
        shape=(len(library), len(library)),
    )
    matrix.sum_duplicates()
    return matrix


def find_neighbours(
    library: PoseLibrary, kept: int = KEPT, reporter: Reporter | None = None
) -> dict[str, NDArray]:
    """Finds the nearest samples of every sample, for both motion models.

    They are exact as long as they are among the views of the 256 base poses that are nearest by
    their joints. Only samples of the same
    pitch count: a camera does not nod.

    Args:
        library: the library.
        kept: how many, the sample itself included.
        reporter: told of every sample and model.

    Returns: dm1.index and dm2.index (N, K) int32, dm1.square and dm2.square (N, K) float32: squared
        distance in sigmas, nearest first.
    """
    if reporter is not None:
        reporter.stage("motion models", 2 * len(library))
    orientation = turned_orientations(
        library.base_quaternion[library.sample_base], library.views[library.sample_view]
    )
    found: dict[str, NDArray] = {}
    for name, occluded in (("dm1", np.zeros_like(library.occluded)), ("dm2", library.occluded)):
        index, square = (
            np.empty((len(library), kept), np.int32),
            np.empty((len(library), kept), np.float32),
        )
        for start in range(0, len(library), _AT_ONCE):
            some = np.arange(start, min(start + _AT_ONCE, len(library)))
            _nearest(
                library,
                orientation,
                some,
                occluded[some],
                index[start : some[-1] + 1],
                square[start : some[-1] + 1],
            )
            if reporter is not None:
                reporter.advance(len(some))
        found |= {f"{name}.index": index, f"{name}.square": square}
    return found


def turned_orientations(
    quaternions: NDArray[np.floating], views: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Returns (n, 9): rotation matrices of the pelvis (n, 4), turned by the yaw of its view (n, 2),
    over the square root of 2.

    For small turns, the Euclidean distance between two of these is the angle between the
    orientations in radians.
    """
    half = np.asarray(views, float)[:, 0] / 2
    yaw = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], -1)
    return (rotation_matrices(yaw) @ rotation_matrices(quaternions)).reshape(-1, 9) / np.sqrt(2)


def scaled_weights(
    library: PoseLibrary, occluded: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns 1 / sigma'_j^2 for sources whose parts are hidden or not (n, 27): per joint angle (n,
    D), and of the orientation (n,).

    Source: Okada and Stenger, eq. (5).
    """
    model = library.model
    sigma = np.where(occluded[:, model.dof_part], MAGNIFICATION, 1.0) * library.sigma_rad
    root = np.where(occluded[:, 0], MAGNIFICATION, 1.0) * library.root_sigma_rad
    return 1 / sigma**2, 1 / root**2


def _nearest(
    library: PoseLibrary,
    orientation: NDArray[np.float64],
    sources: NDArray[np.int64],
    occluded: NDArray[np.bool_],
    index: NDArray[np.int32],
    square: NDArray[np.float32],
) -> None:
    """Fills index and square (n, K) for some sources."""
    per_joint, per_root = scaled_weights(library, occluded)
    angles = library.base_angles.astype(np.float64)
    own = angles[library.sample_base[sources]]
    # (a - b)^2 multiplied out, so that it becomes two matrix products.
    joints = (
        (per_joint * own**2).sum(axis=1)[:, None]
        - 2 * (per_joint * own) @ angles.T
        + per_joint @ (angles**2).T
    )
    joints = np.maximum(joints, 0.0)
    joints[np.arange(len(sources)), library.sample_base[sources]] = 0.0
    count = min(_CANDIDATES, len(angles))
    bases = (
        np.argpartition(joints, count - 1, axis=1)[:, :count]
        if count < len(angles)
        else np.tile(np.arange(count), (len(sources), 1))
    )
    near = np.take_along_axis(joints, bases, 1)
    order = np.argsort(near, axis=1, kind="stable")
    bases, near = np.take_along_axis(bases, order, 1), np.take_along_axis(near, order, 1)
    same_pitch = int((library.views[:, 1] == library.views[0, 1]).sum())
    kernels.nearest_samples(
        sources, bases, near, orientation, per_root, len(library.views), same_pitch, index, square
    )
