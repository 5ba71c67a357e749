"""Samples of a library that explain one frame: of bodies of which nobody knows how they move."""

import numpy as np

from calib.camera import Camera
from calib.checks import BoolArray
from silhouette_core.monocular.person import area_distance
from silhouette_core.monocular.tracking.silhouette_weights import relative_weights
from silhouette_core.monocular.tree.descent import SHIFTS_PX, Alignments, Posterior, tree_posterior
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.monocular.tree.rendering import STATURE_PX
from silhouette_core.monocular.tuning import DISTANCES, FILTER
from silhouette_core.monocular.window import look_at
from silhouette_core.scoring.backend import Backend
from silhouette_core.scoring.target import Target

_COUNT = 9  # distances tried


def find_samples(
    library: PoseLibrary,
    camera: Camera,
    mask: BoolArray,
    backend: Backend,
    distance_m: float | None = None,
) -> Posterior:
    """Posterior of a frame if all samples are as likely before.

    Args:
        camera: pinhole camera without distortion.
        mask: (h, w) bool, the silhouette, not empty.
        distance_m: of the body; None: several are tried about that by the silhouette's area.
    """
    px_per_m = STATURE_PX / library.model.length_m
    if distance_m is None:
        usual_m2 = float(np.median(library.areas.sum(axis=1))) / px_per_m**2
        factors = np.exp(np.linspace(-DISTANCES.first_range, DISTANCES.first_range, _COUNT))
        distances_m = area_distance(camera, mask, usual_m2) * factors
    else:
        distances_m = np.array([distance_m])
    windows = tuple(look_at(camera, mask, float(one), px_per_m) for one in distances_m)

    def target_of(reduction: int) -> Target:
        masks, weights = zip(*(relative_weights(one, reduction) for one in windows), strict=True)
        return Target(masks, weights, SHIFTS_PX)  # pixels of the level

    # The pitch of a view is a property of the camera.
    off = (library.views[:, 1] - windows[0].pitch_rad) / np.radians(DISTANCES.pitch_sigma_deg)
    prior = np.exp(-0.5 * off[library.sample_view, None] ** 2)
    alignments = Alignments(windows, SHIFTS_PX, target_of)
    return tree_posterior(library, prior, alignments, FILTER.sigma, backend)
