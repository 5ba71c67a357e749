"""The filter of paper A, without this program's additions.

Its state is a pose of the library and the person's position in the picture: a cell of a grid of
shifts that follows the silhouette. The distance is followed beside it, since with (9) the larger
body always fits better. What the paper does not state is chosen here: the deviations of (10), of
the first pose and of the position, and the threshold of the surviving nodes.
"""

from functools import partial

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from calib.camera import Camera
from calib.checks import BoolArray, Float32Array, FloatArray
from silhouette_core.monocular.tree.descent import (
    SHIFTS_PX,
    Alignments,
    Posterior,
    log_sums,
    tree_posterior,
)
from silhouette_core.monocular.tree.pose_library import PoseLibrary, nwxor_weights
from silhouette_core.monocular.tree.rendering import STATURE_PX, WINDOW_PX
from silhouette_core.monocular.tuning import DISTANCES, FILTER
from silhouette_core.monocular.window import Window, look_at
from silhouette_core.motion.dynamics import FPS, ROOT_STEP_M
from silhouette_core.motion.keyposes.notation import STANDING, Movement
from silhouette_core.motion.keyposes.perform import perform
from silhouette_core.ranking import rounded
from silhouette_core.scoring.backend import Backend, Target

_COARSEST = 4  # pixels of the window in one of the first level
_MOST_STEPS = 30  # frame intervals without a silhouette that are predicted one by one


class PaperFilter:
    r"""Recursive filter over the frames of one camera, as the paper writes it.

    The posterior of the state :math:`x_t`, a pose and a position, given the silhouettes
    :math:`z_{1:t}` so far, is that of `descent.tree_posterior`. Its prior is predicted,

    .. math::
        :label: okada-2

        p(x_t|z_{1:t-1}) = \int p(x_t|x_{t-1})\, p(x_{t-1}|z_{1:t-1})\, dx_{t-1}

    which for sample :math:`n` of leaf :math:`j` at the last level :math:`L` becomes a sum over the
    :math:`N_R` samples of the library,

    .. math::
        :label: okada-14

        p(x_t^{njL}|z_{1:t-1}) =
        \sum_{i=1}^{N_R} p(x_t^{njL}|x_{t-1}^i)\, p(x_{t-1}^i|z_{1:t-1})

    The rest of a frame is `tree_posterior`.

    Args:
        library: poses and their tree; N samples.
        transitions: (N, N) sparse, for one frame interval.
        camera: pinhole camera without distortion.
        distance_m: distance of the person in the first frame.
        first: (N,) prior of a first frame, see `initial_prior`.
        sigma: of eq. (10), as a fraction of the weight of the first frame's silhouette, constant
            from then on.
        interval_s: time between two frames.
        in_place: the person stays in one place and at one distance, as in the paper.

    Source: Okada and Stenger, eq. (2), (14); the grid and the followed distance are ours.
    """

    def __init__(
        self,
        library: PoseLibrary,
        transitions: csr_matrix,
        camera: Camera,
        distance_m: float,
        first: FloatArray,
        backend: Backend,
        sigma: float = FILTER.sigma,
        interval_s: float = 1 / FPS,
        in_place: bool = False,
    ):
        self.library, self._transitions, self._camera = library, transitions, camera
        self._distance_m, self._first, self._in_place = distance_m, first, in_place
        self._share, self._interval_s, self._backend = sigma, interval_s, backend
        self._shifts_px = np.zeros((1, 2), np.int64) if in_place else _COARSEST * SHIFTS_PX
        self._sigma = 0.0  # until the first frame
        self._last: Posterior | None = None
        self._last_s = 0.0

    def step(self, time_s: float, mask: BoolArray) -> Posterior:
        """Posterior of the next frame given all frames up to it, of which the mask (h, w) bool, not
        empty, is the silhouette. Frames that are left out are predicted across.
        """
        window = self._window(mask, 1.0)
        if self._last is None:
            weights = self._weights(window.mask)
            self._sigma = self._share * float(weights[window.mask].sum()) / weights.size
            count = len(self._shifts_px)
            prior = np.outer(self._first, np.full(count, 1 / count))
        else:
            prior = self._predict(self._last, time_s - self._last_s, window)
        self._last, self._last_s = self._update(prior, window), time_s
        if not self._in_place:
            self._follow_distance(mask, self._last)
        return self._last

    def places_m(self, window: Window) -> FloatArray:
        """Positions (C, 3) in the world, where the middle of a silhouette would be."""
        middle = (np.array(WINDOW_PX) - 1) / 2 + self._shifts_px
        return window.unproject(middle, window.distance_m)

    def _window(self, mask: BoolArray, factor: float) -> Window:
        """The silhouette as the library's camera would see it at a multiple of the distance."""
        metre_px = STATURE_PX / self.library.model.length_m
        return look_at(self._camera, mask, factor * self._distance_m, metre_px)

    def _predict(self, last: Posterior, elapsed_s: float, window: Window) -> FloatArray:
        """Prior (N, C), eq. (14): the library's transitions move the pose, chance the position."""
        steps = int(np.clip(round(elapsed_s / self._interval_s), 1, _MOST_STEPS))
        sigma_m = ROOT_STEP_M * np.sqrt(steps * self._interval_s * FPS)
        before_m = self.places_m(last.alignments.windows[0])
        moved = -0.5 * cdist(before_m, self.places_m(window), "sqeuclidean") / sigma_m**2
        moved = np.exp(moved - log_sums(moved)[:, None])
        prior = self._transitions[last.samples].T @ (last.probability @ moved)  # eq. (2), (14)
        for _ in range(steps - 1):
            prior = self._transitions.T @ prior
        return prior

    def _update(self, prior: FloatArray, window: Window) -> Posterior:
        """Posterior by a prior (N, C)."""
        alignments = Alignments((window,), self._shifts_px, partial(self._target, window))
        return tree_posterior(self.library, prior, alignments, self._sigma, self._backend)

    def _target(self, window: Window, reduction: int) -> Target:
        """The silhouette in all positions at a resolution."""
        mask, weights = window.weighed(reduction, self._weights)
        return Target((mask,), (weights,), self._shifts_px // reduction, 1 / mask.size)

    def _weights(self, mask: BoolArray) -> Float32Array:
        """Weights (h, w) of the pixels of a silhouette (h, w) bool."""
        return nwxor_weights(mask, self.library.bounds_px)

    def _follow_distance(self, mask: BoolArray, posterior: Posterior) -> None:
        """Follows the distance by the size in which the silhouettes of the surviving leaves fit
        best, in the mean over their posterior, by XOR, eq. (6).

        It counts relative to the root of the silhouette's area: with that of the leaf, which stays,
        to their geometric mean, so that neither is preferred to be the larger one. Relative to the
        area alone, a wrong pose would go farther and farther away.
        """
        factors = np.exp(DISTANCES.step * np.arange(-1, 2))
        masks = tuple(self._window(mask, float(factor)).mask for factor in factors)
        weights = tuple(np.full(one.shape, max(one.sum(), 1) ** -0.5) for one in masks)
        target = Target(masks, weights, self._shifts_px)
        leaves, of_leaves = posterior.leaves, posterior.of_leaves
        distances = self._backend.span_distances(target, self.library.levels[-1].spans, leaves)
        by_size = distances.reshape(len(leaves), len(masks), -1)
        mean = np.einsum("kc,ksc->s", of_leaves, by_size)
        self._distance_m *= float(factors[int(rounded(mean).argmin())] ** DISTANCES.gain)


def initial_prior(library: PoseLibrary) -> FloatArray:
    """Prior of a first frame: a Gaussian about the upright pose that faces the camera.

    Args:
        library: poses, N samples.

    Returns:
        (N,) float64, summing to 1; every joint angle and the orientation deviates by 45 degrees.

    Source: Okada and Stenger, section 6; the deviation is ours.
    """
    standing = Movement(np.array([0.0, 1.0]), np.stack([STANDING, STANDING]), (0.0, 0.0))
    upright = perform(standing, library.model).angles_rad[0]
    turn, angles = library.pose(np.arange(len(library)))
    facing = Rotation.from_quat(turn, scalar_first=True).magnitude()
    square = ((angles - upright) ** 2).sum(axis=1) + facing**2
    prior = np.exp(-0.5 * (square - square.min()) / np.radians(FILTER.first_deg) ** 2)
    return prior / prior.sum()
