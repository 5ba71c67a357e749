"""Posterior of one frame: the tree is descended level by level."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from calib.checks import FloatArray, IndexArray, IntArray
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.monocular.tree.rendering import WINDOW_PX, yaw_rotations
from silhouette_core.monocular.tuning import FILTER
from silhouette_core.monocular.window import Window
from silhouette_core.motion.kinematics import rotation_matrices
from silhouette_core.motion.pose import PoseArrays
from silhouette_core.ranking import rounded
from silhouette_core.scoring.backend import Backend, Target

_REACH = range(-1, 2)
SHIFTS_PX = np.array([(right, down) for down in _REACH for right in _REACH])
"""(9, 2): how samples are moved (right, down), pixels: what the centroid's position leaves open."""


@dataclass(frozen=True, eq=False)
class Alignments:
    """A silhouette in C alignments, numbered as in `Target`."""

    windows: tuple[Window, ...]  #: the silhouette at several distances.
    shifts_px: IntArray  #: (S, 2), pixels of the windows by which samples are moved (right, down).
    target_of: Callable[[int], Target]
    """The silhouette in all of them, by how many times smaller than the windows the images of a
    level are."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """Posterior of a frame over poses and C alignments with its silhouette."""

    library: PoseLibrary  #: the poses.
    alignments: Alignments  #: of the silhouette.
    leaves: IntArray  #: (K,) int64, the surviving leaves.
    of_leaves: FloatArray  #: (K, C) float64, summing to 1.
    samples: IntArray  #: (M,) int64, the samples of these leaves, likeliest first.
    probability: FloatArray  #: (M, C) float64, summing to 1.

    @property
    def distance_m(self) -> float:
        """Distance of the body, in the mean."""
        windows = self.alignments.windows
        by_window = self.probability.sum(axis=0).reshape(len(windows), -1).sum(axis=1)
        return float(np.exp(by_window @ np.log([window.distance_m for window in windows])))

    def poses(self, rows: Sequence[int] | IndexArray | slice) -> PoseArrays:
        """Some of the samples as poses in the world, each where it is likeliest."""
        library, samples = self.library, self.samples[rows]
        windows, shifts_px = self.alignments.windows, self.alignments.shifts_px
        window, shift = np.divmod(self.probability[rows].argmax(axis=1), len(shifts_px))
        base, view = library.sample_base[samples], library.sample_view[samples]
        heading = windows[0].heading_rad + library.views[view, 0]
        rotation = yaw_rotations(heading) @ rotation_matrices(library.bases.quaternion[base])
        pelvis_px = library.pelvis_px[samples] + shifts_px[shift]
        roots = np.stack([one.unproject(pelvis_px, one.distance_m) for one in windows])
        root = roots[window, np.arange(len(samples))]
        return PoseArrays(root, rotation, library.bases.angles[base].astype(float))


def tree_posterior(
    library: PoseLibrary, prior: FloatArray, alignments: Alignments, sigma: float, backend: Backend
) -> Posterior:
    r"""Posterior of a frame: of the state :math:`x_t`, given the silhouettes :math:`z_{1:t}`,

    .. math::
        :label: okada-1

        p(x_t|z_{1:t}) = c_t\, p(z_t|x_t)\, p(x_t|z_{1:t-1})

    with the normalising constant :math:`c_t`. The likelihood follows from the silhouette distance
    :math:`d_{sil}` between the observation :math:`P_o` and the projection :math:`P_m` of the pose,

    .. math::
        :label: okada-10

        p(z_t|x_t) \propto \exp\left(-\frac{d_{sil}(P_o, P_m)^2}{2\sigma^2}\right)

    A node :math:`\theta_t^{jl}`, number :math:`j` of level :math:`l`, takes that of its
    representative :math:`\bar{x}_t^{jl}`; the volume of its set :math:`S^{jl}` counts as constant:

    .. math::
        :label: okada-11

        p(z_t|\theta_t^{jl}) \approx p(z_t|\bar{x}_t^{jl})\, \mathrm{vol}(S^{jl})

    The tree is descended level by level; a node is scored if its parent survived. In a surviving
    leaf all poses look alike: its likelihood counts for each of them, with their own priors:

    .. math::
        :label: okada-12

        p(x_t^{njL}|z_{1:t}) = c_t\, p(z_t|x_t^{njL})\, p(x_t^{njL}|z_{1:t-1})

    .. math::
        :label: okada-13

        p(x_t^{njL}|z_{1:t}) \approx c_t\, p(z_t|\theta_t^{jL})\, p(x_t^{njL}|z_{1:t-1})

    Args:
        library: poses and their tree; N samples.
        prior: (N, C) float64, or (N, 1): the same for every alignment.
        alignments: of the frame's silhouette with the samples.
        sigma: of eq. (10), in units of the targets' distances.

    Source: Okada and Stenger, eq. (1), (10)-(13).
    """
    of_nodes = node_sums(library, prior)
    nodes = surviving = np.arange(len(library.levels[0]))
    log_likelihood = log_posterior = np.empty((0, 0))
    for depth, level in enumerate(library.levels):
        if depth:
            first = library.child_offsets[depth - 1]
            nodes = concatenated_ranges(first[nodes[surviving]], first[nodes[surviving] + 1])
        target = alignments.target_of(WINDOW_PX[0] // level.size_px[0])
        distance = backend.span_distances(target, level.spans, nodes)
        log_likelihood = -0.5 * (distance / sigma) ** 2  # eq. (10), (11)
        with np.errstate(divide="ignore"):
            log_posterior = log_likelihood + np.log(of_nodes[depth][nodes])
        each = rounded(log_sums(log_posterior))
        surviving = np.flatnonzero(each >= each.max() + np.log(FILTER.survivors))
    samples, number = samples_of(library, nodes[surviving])
    of_leaf = surviving[number]
    with np.errstate(divide="ignore"):
        posterior = rounded(log_likelihood[of_leaf] + np.log(prior[samples]))  # eq. (12), (13)
    probability = np.exp(posterior - posterior.max())
    probability /= probability.sum()  # eq. (1): c_t
    order = np.argsort(-posterior.max(axis=1), kind="stable")
    of_leaves = np.exp(log_posterior[surviving] - log_posterior.max())
    of_leaves /= of_leaves.sum()
    return Posterior(
        library, alignments, nodes[surviving], of_leaves, samples[order], probability[order]
    )


def log_sums(logarithms: FloatArray) -> FloatArray:
    """Logarithms (N,) of the sums of the rows of what logarithms (N, C) are of, -inf of zeros.

    SciPy's `logsumexp` takes ten times as long for the few numbers of a node.
    """
    most = np.maximum(logarithms.max(axis=1), np.finfo(float).min)
    with np.errstate(divide="ignore"):
        return np.log(np.exp(logarithms - most[:, None]).sum(axis=1)) + most


def node_sums(library: PoseLibrary, prior: FloatArray) -> list[FloatArray]:
    """Prior (K, …) of the nodes of every level: the sums over their samples, of a prior (N, …)."""
    sums = [np.add.reduceat(prior[library.leaf_samples], library.leaf_offsets[:-1])]
    for offsets in library.child_offsets[-2::-1]:
        sums.insert(0, np.add.reduceat(sums[0], offsets[:-1]))
    return sums


def samples_of(library: PoseLibrary, leaves: IndexArray) -> tuple[IntArray, IntArray]:
    """Samples (M,) of some leaves (n,), leaf by leaf, and the number of each in that order (M,)."""
    first, last = library.leaf_offsets[leaves], library.leaf_offsets[leaves + 1]
    samples = library.leaf_samples[concatenated_ranges(first, last)].astype(np.int64)
    return samples, np.repeat(np.arange(len(leaves)), last - first)


def concatenated_ranges(first: IndexArray, last: IndexArray) -> IntArray:
    """Concatenated ranges first[0] .. last[0] - 1, first[1] .. last[1] - 1, ..."""
    counts = (last - first).astype(np.int64)
    ends = np.cumsum(counts)
    return (
        np.arange(ends[-1] if len(ends) else 0)
        - np.repeat(ends - counts, counts)
        + np.repeat(first, counts)
    )
