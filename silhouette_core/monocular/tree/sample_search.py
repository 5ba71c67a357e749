"""Samples of a library that explain one frame: of bodies of which nobody knows how they move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.monocular.person import area_distance
from silhouette_core.monocular.tracking.silhouette_weights import relative_weights
from silhouette_core.monocular.tree.descent import SHIFTS_PX, sample_poses, tree_posterior
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.monocular.tree.rendering import STATURE_PX
from silhouette_core.monocular.tuning import DISTANCES, FILTER
from silhouette_core.monocular.window import Window, look_at
from silhouette_core.motion.pose import PoseArrays
from silhouette_core.scoring.backend import Backend
from silhouette_core.scoring.target import Target

_COUNT = 9  # distances tried


@dataclass(frozen=True, eq=False)
class FoundSamples:
    """Samples of a library that explain a silhouette.

    Attributes:
        library: the library.
        samples: (M,) int64, likeliest first.
        windows: the silhouette at the distances that were tried.
        number: (M,) int64, in which of them each sample fits best.
        shift_px: (M, 2) int64, by which it is moved (right, down) there.
        distance_m: of the body, in the mean over the posterior.
    """

    library: PoseLibrary
    samples: NDArray[np.int64]
    windows: tuple[Window, ...]
    number: NDArray[np.int64]
    shift_px: NDArray[np.int64]
    distance_m: float

    def poses(self, rows: Sequence[int] | NDArray[np.integer] | slice) -> PoseArrays:
        """Some of the samples as poses in the world."""
        samples, number, shift_px = self.samples[rows], self.number[rows], self.shift_px[rows]
        return sample_poses(self.library, samples, self.windows, number, shift_px)


def find_samples(
    library: PoseLibrary,
    camera: Camera,
    mask: NDArray[np.bool_],
    backend: Backend,
    distance_m: float | None = None,
) -> FoundSamples:
    """Samples that explain a frame, by their posterior if all of them are as likely before.

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
    away = (library.views[:, 1] - windows[0].pitch_rad) / np.radians(DISTANCES.pitch_sigma_deg)
    prior = np.exp(-0.5 * away[library.sample_view, None] ** 2)
    found = tree_posterior(library, prior, target_of, FILTER.sigma, backend)
    number, shift = np.divmod(found.probability.argmax(axis=1), len(SHIFTS_PX))
    by_distance = found.probability.sum(axis=0).reshape(len(windows), -1).sum(axis=1)
    mean_m = float(np.exp(by_distance @ np.log(distances_m)))
    return FoundSamples(library, found.samples, windows, number, SHIFTS_PX[shift], mean_m)
