"""The filter of paper A without this program's additions, for the arm-swing experiment.

Of what the paper does not state, the standard deviations of (10) and of the initial prior and the
threshold of the surviving nodes are chosen here. What remains of the program: silhouette and
library are both centred, where the paper's state holds the person's position, and (14) is a sum
over a sparse table.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.spatial.transform import Rotation

from calib.camera import Camera
from calib.components import label_components
from silhouette_core.image.distance import Weighting, pixel_weights
from silhouette_core.image.spans import Spans
from silhouette_core.monocular.tree.evidence import Alignment, Evidence
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.monocular.tree.rendering import STATURE_PX, reduce_silhouette
from silhouette_core.monocular.tree.tree_filter import Posterior, TreeFilter
from silhouette_core.monocular.tuning import FilterSettings
from silhouette_core.monocular.window import look_at
from silhouette_core.motion.keyposes.notation import STANDING, Movement
from silhouette_core.motion.keyposes.perform import perform
from silhouette_core.scoring.target import Target

INITIAL_SIGMA_RAD = np.radians(45.0)
"""Standard deviation of every angle in the initial prior; the paper does not state it."""


class PaperEvidence(Evidence):
    """A silhouette compared with the nodes in one place: no assumed distances, no shifts.

    The distance is the density (7) over the window, not relative to the silhouette's weight.
    """

    def distances(self, spans: Spans, nodes: NDArray[np.integer], reduction: int) -> Alignment:
        """See `Evidence.distances`."""
        mask = self.windows[0].mask
        for _ in range(int(np.log2(reduction))):
            mask = reduce_silhouette(mask)
        target = Target.from_mask(mask, self.weighting, self.bounds_px)
        distance = self.backend.span_distances(target, spans, nodes)[:, 0]
        none = np.zeros(len(nodes), np.int64)
        return Alignment(distance, none, np.stack([none, none], axis=1))


class PaperFilter:
    """Recursive filter over the frames of one camera, before which the person stays in place.

    Args:
        library: poses and their tree; N samples.
        transitions: (N, N) sparse, for one frame interval.
        camera: pinhole camera without distortion.
        distance_m: distance of the person, constant.
        weighting: pixel weights of the silhouette distance.
        sigma: of eq. (10), as a fraction of the weight of the first frame's silhouette, so that one
            number suits all weightings; constant from then on.

    Source: Okada and Stenger, section 6.
    """

    def __init__(
        self,
        library: PoseLibrary,
        transitions: csr_matrix,
        camera: Camera,
        distance_m: float,
        weighting: Weighting,
        sigma: float,
    ):
        """Starts without a posterior."""
        self._library, self._transitions, self._camera = library, transitions, camera
        self._distance_m, self._sigma = distance_m, sigma
        self._weighting: Weighting = weighting
        self._tree: TreeFilter | None = None
        self._last: tuple[int, Posterior] | None = None

    def step(self, number: int, mask: NDArray[np.bool_]) -> int:
        """Most likely sample of the next frame, given all frames up to it.

        Args:
            number: of the frame; between it and the last one the motion model is applied once for
                every frame interval.
            mask: (h, w) bool, the silhouette, not empty.

        Returns:
            Index into the library.
        """
        library, weighting = self._library, self._weighting
        metre_px = STATURE_PX / library.model.sizes.stature_m
        window = look_at(self._camera, mask, self._distance_m, metre_px)
        if self._tree is None:
            weights = pixel_weights(window.mask, weighting, library.bounds_px)
            sigma = self._sigma * float(weights[window.mask].sum()) / window.mask.size
            settings = FilterSettings(
                sigma=sigma, coarse=1.0, most=len(library), moved=len(library), floor=0.0
            )
            self._tree = TreeFilter(library, self._transitions, settings)
        if self._last is None:
            prior = initial_prior(library)
        else:
            last, posterior = self._last
            prior = self._tree.predict(posterior, number - last)
        evidence = PaperEvidence((window,), weighting, bounds_px=library.bounds_px)
        posterior = self._tree.update(prior, evidence)
        self._last = number, posterior
        return int(posterior.samples[0])


def initial_prior(library: PoseLibrary) -> NDArray[np.float64]:
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
    prior = np.exp(-0.5 * (square - square.min()) / INITIAL_SIGMA_RAD**2)
    return prior / prior.sum()


def largest_component(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Largest connected component of a foreground image (h, w) bool; empty if it is."""
    components = label_components(mask)
    if len(components.sizes) < 2:
        return np.zeros_like(mask)
    return components.labels == 1 + int(components.sizes[1:].argmax())
