"""A frame's silhouette, prepared once for all that compares poses with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silhouette_core.image.distance import Weighting
from silhouette_core.monocular.limb_silhouette import SignedWeights
from silhouette_core.monocular.tracking.bare_parts import SkinEvidence
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.monocular.tree.rendering import STATURE_PX
from silhouette_core.monocular.window import Window, look_at
from silhouette_core.refinement.observation import USUAL_SPACING_M, Observation, PinholeViews
from silhouette_core.scoring.backend import Backend


@dataclass(frozen=True, eq=False)
class ObservedFrame:
    """What a frame shows.

    Attributes:
        mask: (h, w) bool, the silhouette in the camera's image.
        weights: signed pixel weights of the silhouette's window.
        contour: points of the contour, and distances from the silhouette.
        distance_m: distance of the person from the camera, about.
        time_s: time of the frame.
        skin: where the person has the colours of the head, if these are known.
    """

    mask: NDArray[np.bool_]
    weights: SignedWeights
    contour: Observation
    distance_m: float
    time_s: float
    skin: SkinEvidence | None = None


class FrameObserver:
    """Prepares the frames of one camera.

    Args:
        views: the camera, a pinhole without distortion.
        library: whose window and weights are used.
        weighting: of the pixels.
        backend: scores the poses.
        spacing_m: distance between points of the contour, on the body.
    """

    def __init__(
        self,
        views: PinholeViews,
        library: PoseLibrary,
        weighting: Weighting,
        backend: Backend,
        spacing_m: float = USUAL_SPACING_M,
    ):
        """Keeps what it is given."""
        self.views, self._library = views, library
        self._weighting: Weighting = weighting
        self._backend, self._spacing_m = backend, spacing_m
        # The surface of a given body is known exactly: every pixel tells.
        self._reduction = 2 if library.model.person is not None else 1

    def observe(
        self,
        mask: NDArray[np.bool_],
        distance_m: float,
        time_s: float,
        window: Window | None = None,
    ) -> ObservedFrame:
        """Prepares one frame.

        Args:
            mask: (h, w) bool, the silhouette, not empty.
            distance_m: of the person from the camera.
            time_s: time of the frame.
            window: of the silhouette at about that distance; None: it is made here.
        """
        if window is None:
            camera, length = self.views.rig.cameras[0], self._library.model.length_m
            window = look_at(camera, mask, distance_m, STATURE_PX / length)
        weights = SignedWeights.from_window(
            window, self._weighting, self._reduction, self._backend, self._library.bounds_px
        )
        contour = Observation.from_masks(self.views, [mask], distance_m, self._spacing_m)
        return ObservedFrame(mask, weights, contour, distance_m, time_s)
