"""Forward pass of the filter: from the silhouette of each frame to its posterior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.image.distance import Weighting
from silhouette_core.monocular.person import area_distance
from silhouette_core.monocular.tree.evidence import Evidence
from silhouette_core.monocular.tree.rendering import STATURE_PX, yaw_rotations
from silhouette_core.monocular.tree.tree_filter import Posterior, TreeFilter
from silhouette_core.monocular.tuning import DISTANCES
from silhouette_core.monocular.window import Window, look_at
from silhouette_core.motion.dynamics import FPS
from silhouette_core.motion.kinematics import rotation_matrices
from silhouette_core.motion.pose import PoseArrays

_FIRST_COUNT = 9  # distances tried in a first frame
_MOST_STEPS = 30  # that many frame intervals of missing frames are predicted one by one


@dataclass(frozen=True, eq=False)
class FilterFrame:
    """A frame and its posterior.

    Attributes:
        windows: virtual views of the silhouette, one for each assumed distance.
        lost: no node fits about as well as the best nodes of earlier frames.
    """

    time_s: float
    windows: tuple[Window, ...]
    posterior: Posterior
    distance_m: float
    lost: bool


class ForwardFilter:
    """Recursive filter over the frames of one camera.

    Args:
        camera: pinhole camera without distortion.
        distance_m: constant distance of the person, as in the paper; None: estimated frame by
            frame.
        interval_s: time between two frames, for which the tree filter's transitions were made.
    """

    def __init__(
        self,
        tree: TreeFilter,
        camera: Camera,
        weighting: Weighting = "balanced",
        distance_m: float | None = None,
        interval_s: float = 1 / FPS,
    ):
        self.tree, self.camera = tree, camera
        self.weighting: Weighting = weighting
        self._distance_m, self._interval_s = distance_m, interval_s
        self._last: FilterFrame | None = None
        self._recent_best: list[float] = []

    def step(self, time_s: float, mask: NDArray[np.bool_]) -> FilterFrame:
        """Posterior of the next frame, of which the mask (h, w) is the silhouette."""
        last, library = self._last, self.tree.library
        restarted = last is None or last.lost or time_s - last.time_s > DISTANCES.longest_gap_s
        if self._distance_m is not None:
            middle, factors = self._distance_m, np.ones(1)
        elif last is None or restarted:
            middle = self._first_distance(mask)
            factors = np.exp(
                np.linspace(-DISTANCES.first_range, DISTANCES.first_range, _FIRST_COUNT)
            )
            if last is not None:
                middle = float(np.sqrt(middle * last.distance_m))
        else:
            steps = [0.0, -DISTANCES.step, DISTANCES.step]
            middle, factors = last.distance_m, np.exp(np.array(steps))
        metre_px = STATURE_PX / library.model.length_m
        windows = tuple(look_at(self.camera, mask, middle * factor, metre_px) for factor in factors)
        prior = self._prior(windows[0], last, time_s, restarted)
        evidence = Evidence(windows, self.tree.backend, self.weighting, library.bounds_px)
        posterior = self.tree.update(prior, evidence)
        best = float(posterior.distance[0])
        usual = float(np.median(self._recent_best)) if self._recent_best else best
        lost = best > DISTANCES.lost_factor * usual + DISTANCES.lost_excess
        if not lost:
            self._recent_best = [*self._recent_best[-60:], best]
        distances = np.array([window.distance_m for window in windows])
        measured = float(np.exp(posterior.probability @ np.log(distances[posterior.scale])))
        gain = 1.0 if restarted else DISTANCES.gain
        distance_m = float(middle * (measured / middle) ** gain)
        self._last = FilterFrame(time_s, windows, posterior, distance_m, lost)
        return self._last

    def _first_distance(self, mask: NDArray[np.bool_]) -> float:
        """Distance by the silhouette's area alone."""
        library = self.tree.library
        usual_px = float(np.median(library.areas.sum(axis=1)))
        return area_distance(
            self.camera, mask, usual_px * (library.model.length_m / STATURE_PX) ** 2
        )

    def _prior(
        self, window: Window, last: FilterFrame | None, time_s: float, restarted: bool
    ) -> NDArray[np.float64]:
        library = self.tree.library
        if last is None or (restarted and not last.lost):
            prior = np.full(len(library), 1.0 / len(library))
        else:
            intervals = round((time_s - last.time_s) / self._interval_s)
            steps = int(np.clip(intervals, 1, _MOST_STEPS))
            prior = self.tree.predict(last.posterior, steps)
            if last.lost:
                prior = 0.5 * prior + 0.5 / len(prior)
        # The pitch of a view is a property of the camera and not of the motion.
        away = (library.views[:, 1] - window.pitch_rad) / np.radians(DISTANCES.pitch_sigma_deg)
        return self.tree.weigh_views(prior, np.exp(-0.5 * away**2))


def slim(filter_frame: FilterFrame, rows: int) -> FilterFrame:
    """A frame to be kept: without pictures, and with the `rows` likeliest samples of its posterior
    and as many that fit best.
    """
    posterior, empty = filter_frame.posterior, np.zeros((0, 0), bool)
    by_fit = np.argsort(posterior.distance, kind="stable")[:rows]
    kept = np.unique(np.concatenate([np.arange(min(len(posterior.samples), rows)), by_fit]))
    rowwise = "samples", "probability", "distance", "scale", "shift_px"
    return replace(
        filter_frame,
        windows=tuple(replace(window, mask=empty, seen=empty) for window in filter_frame.windows),
        posterior=replace(posterior, **{name: getattr(posterior, name)[kept] for name in rowwise}),
    )


def candidates_of(
    tree: TreeFilter, filter_frame: FilterFrame, rows: Sequence[int] | NDArray[np.integer]
) -> PoseArrays:
    """Samples of a posterior as poses in the world.

    Args:
        rows: (M,) rows of the posterior.
    """
    library, posterior = tree.library, filter_frame.posterior
    rows = np.asarray(rows)
    sample = posterior.samples[rows]
    base, view = library.sample_base[sample], library.sample_view[sample]
    window = filter_frame.windows[0]
    rotation = yaw_rotations(window.heading_rad + library.views[view, 0]) @ rotation_matrices(
        library.base_quaternion[base]
    )
    root = np.empty((len(rows), 3))
    for scale in np.unique(posterior.scale[rows]):
        selected = posterior.scale[rows] == scale
        own = filter_frame.windows[scale]
        root[selected] = own.unproject(
            library.pelvis_px[sample[selected]] + posterior.shift_px[rows[selected]], own.distance_m
        )
    return PoseArrays(root, rotation, library.base_angles[base].astype(float))
