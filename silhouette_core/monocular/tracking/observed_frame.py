"""A frame's silhouette, prepared once for all that compares poses with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silhouette_core.monocular.silhouette_weights import SignedWeights
from silhouette_core.monocular.tracking.bare_parts import SkinEvidence
from silhouette_core.monocular.window import STATURE_PX, Window, look_at
from silhouette_core.refinement.observation import USUAL_SPACING_M, Observation, PinholeViews
from silhouette_core.scoring.backend import Backend
from silhouette_core.scoring.cpu import CPU


@dataclass(frozen=True, eq=False)
class ObservedFrame:
    """What a frame shows.

    Attributes:
        mask: (h, w) bool, the silhouette in the camera's image.
        weights: signed pixel weights of the silhouette's window.
        contour: points of the contour, and distances from the silhouette.
        distance_m: distance of the body from the camera, about.
        skin: where the person has the colours of the head, if these are known.
    """

    mask: NDArray[np.bool_]
    weights: SignedWeights
    contour: Observation
    distance_m: float
    time_s: float
    skin: SkinEvidence | None = None


@dataclass(frozen=True, eq=False)
class FrameObserver:
    """Prepares the frames of one camera.

    Attributes:
        views: the camera, a pinhole without distortion.
        reduction: how many times smaller than the window poses are drawn.
        spacing_m: distance between points of the contour, on the body.
    """

    views: PinholeViews
    length_m: float
    reduction: int = 2
    spacing_m: float = USUAL_SPACING_M
    backend: Backend = CPU

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
            window: of the silhouette at about that distance; None: it is made here.
        """
        if window is None:
            camera = self.views.rig.cameras[0]
            window = look_at(camera, mask, distance_m, STATURE_PX / self.length_m)
        weights = SignedWeights.from_window(window, self.reduction, self.backend)
        contour = Observation.from_masks(self.views, [mask], distance_m, self.spacing_m)
        return ObservedFrame(mask, weights, contour, distance_m, time_s)
