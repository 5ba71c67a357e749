"""Motion models DM1 and DM2: probabilities of the next pose as sparse matrices over a library.

The source pose decides the deviations of its step, so that all transitions are known when the
library is built. For every sample the nearest others, in its own sigmas, are stored with their
squared distances; farther ones count as impossible. With the sigmas as wide as the program has
them, 64 hold 98 % of DM2's weight at 30 frames a second and 87 % at 15; with 512 nothing was
estimated better (docs/decisions.md).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from calib.checks import BoolArray, Float32Array, FloatArray, IntArray, RealArray
from silhouette_core.monocular.tree.kernels import near_poses as kernels
from silhouette_core.monocular.tree.rendering import view_rotations
from silhouette_core.monocular.tuning import MOTION_MODEL
from silhouette_core.motion.dynamics import FPS
from silhouette_core.progress import Reporter, SilentReporter

if TYPE_CHECKING:
    from silhouette_core.monocular.tree.pose_library import PoseLibrary

#: Number of neighbours stored for every sample.
KEPT = 64
# Base poses, the nearest by their joints, whose views are candidates for the nearest samples.
_CANDIDATES = 256
_AT_ONCE = 2048


def transitions(
    library: PoseLibrary,
    occlusion_aware: bool,
    sigma_scale: float = MOTION_MODEL.sigma_scale,
    neighbours: int = KEPT,
    normalised: bool = True,
    interval_s: float = 1 / FPS,
) -> csr_matrix:
    r"""Matrix of :math:`p(x_t|x_{t-1})` over a library, one frame interval apart.

    The motion model is a random walk: the next pose is normally distributed about the last,

    .. math::
        :label: okada-4

        p(x_t|x_{t-1}) \sim N(x_{t-1}, \Sigma)

    with one variance for each joint angle, see :eq:`okada-5`. The variance of a random walk grows
    in proportion to time: this is the only place where that is taken into account, and whoever
    skips frames applies the matrix once for every frame interval that passed. Only the 64 nearest
    samples of each sample have a probability other than 0. The paper does not normalise.

    Args:
        occlusion_aware: DM2, with eq. (5); else DM1, without.
        sigma_scale: factor on all sigmas; the paper has none.
        neighbours: largest number of neighbours used.
        normalised: rows sum to 1. Else a neighbour has the same weight whether there are many
            others or none, and probability gathers where poses are dense.
        interval_s: time between two frames, s. The library's sigmas are those of 1/30 s; variances
            are multiplied by interval_s over that.

    Returns:
        (N, N) float32, row i the distribution after sample i; the prior (14) is `matrix.T @
        posterior`.

    Source: Okada and Stenger, eq. (4); the restriction to neighbours is ours.
    """
    name, stored = "dm2" if occlusion_aware else "dm1", library.neighbours
    if f"{name}.index" not in stored:
        stored = find_neighbours(library, occlusion_aware)
    index, square = (
        np.asarray(stored[f"{name}.{array}"])[:, :neighbours] for array in ("index", "square")
    )
    variance = sigma_scale**2 * interval_s * FPS
    weight = np.exp(square.astype(np.float64) / (-2 * variance))  # eq. (4)
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
    library: PoseLibrary,
    occlusion_aware: bool = True,
    count: int = KEPT,
    reporter: Reporter | None = None,
) -> dict[str, NDArray]:
    """Nearest samples of every sample, for one motion model.

    Exact as long as they are among the views of the 256 base poses that are nearest in joint
    angles. Only samples of the same pitch count, since the camera does not move.

    Args:
        occlusion_aware: DM2; else DM1.
        count: number of neighbours, including the sample itself.

    Returns:
        dm2.index (N, K) int32 and dm2.square (N, K) float32, or those of dm1: squared distance in
        sigmas, nearest first.
    """
    reporter = reporter or SilentReporter()
    reporter.stage("motion model", len(library))
    orientation = view_orientations(
        library.bases.quaternion[library.sample_base], library.views[library.sample_view]
    )
    occluded = library.occluded if occlusion_aware else np.zeros_like(library.occluded)
    index = np.empty((len(library), count), np.int32)
    square = np.empty((len(library), count), np.float32)
    for start in range(0, len(library), _AT_ONCE):
        sources = np.arange(start, min(start + _AT_ONCE, len(library)))
        part = slice(start, start + _AT_ONCE)
        _nearest(library, orientation, sources, occluded[part], index[part], square[part])
        reporter.advance(len(sources))
    name = "dm2" if occlusion_aware else "dm1"
    return {f"{name}.index": index, f"{name}.square": square}


def view_orientations(quaternions: RealArray, views: RealArray) -> FloatArray:
    """Orientations of the pelvis as vectors whose Euclidean distance is an angle.

    Args:
        quaternions: (n, 4), orientation of the pelvis without heading.
        views: (n, 2), yaw and pitch, radians.

    Returns:
        (n, 9) float64, rotation matrices, turned by the yaw, over the square root of 2; the
        distance of two is about the angle between the orientations in radians if it is small.
    """
    return view_rotations(quaternions, views).reshape(-1, 9) / np.sqrt(2)


def step_precisions(library: PoseLibrary, occluded: BoolArray) -> tuple[FloatArray, FloatArray]:
    r"""Inverse variances of steps, magnified where the source pose occludes a part.

    .. math::
        :label: okada-5

        \Sigma = \mathrm{diag}(\sigma_j'^2), \qquad
        \sigma_j' = \begin{cases} \sigma_j & \text{if } f_j = 0 \\
        m\,\sigma_j & \text{if } f_j = 1 \end{cases}

    where :math:`\sigma_j` is the standard deviation of joint angle :math:`j`, radians,
    :math:`f_j` the occlusion flag :eq:`okada-3` of the part that it turns in the source pose
    :math:`x_{t-1}`, and :math:`m = 5`. All :math:`f_j = 0` gives DM1. The orientation has the flag
    of the pelvis.

    Args:
        library: the library, with :math:`\sigma_j` as measured on recorded motion.
        occluded: (n, 27) bool, flags of the sources' parts.

    Returns:
        :math:`1 / \sigma_j'^2` for the D joint angles (n, D) and for the orientation (n,), float64.

    Source: Okada and Stenger, eq. (5).
    """
    model = library.model
    factor = np.where(occluded, MOTION_MODEL.magnification, 1.0)  # eq. (5)
    sigma = factor[:, model.tree.dof_part] * library.bases.sigma_rad
    root = factor[:, 0] * library.bases.root_sigma_rad
    return 1 / sigma**2, 1 / root**2


def _nearest(
    library: PoseLibrary,
    orientation: FloatArray,
    sources: IntArray,
    occluded: BoolArray,
    index: NDArray[np.int32],
    square: Float32Array,
) -> None:
    """Fills index and square (n, K) for some sources."""
    per_joint, per_root = step_precisions(library, occluded)
    angles = library.bases.angles.astype(np.float64)
    source_angles = angles[library.sample_base[sources]]
    # (a - b)^2 multiplied out, so that it becomes two matrix products.
    joints = (
        (per_joint * source_angles**2).sum(axis=1)[:, None]
        - 2 * (per_joint * source_angles) @ angles.T
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
