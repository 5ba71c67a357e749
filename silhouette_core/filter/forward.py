"""The forward pass: frame by frame from silhouette to posterior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calib.camera import Camera
from silhouette_core.filter.evidence import Evidence
from silhouette_core.filter.motion_cost import PoseCandidates, turned
from silhouette_core.filter.person import Person, upright_distance
from silhouette_core.filter.tree_filter import Posterior, TreeFilter
from silhouette_core.filter.window import Window, look_at
from silhouette_core.image.distance import Weighting
from silhouette_core.library.rendering import STATURE_PX
from silhouette_core.motion.kinematics import rotation_matrices

_FIRST_REACH, _FIRST_COUNT = (
    0.30,
    9,
)  # logarithm of the distance, either way: somebody may crouch, or hold the arms up
_STEP = 0.05
_DISTANCE_GAIN = 0.4
_PITCH_SIGMA_RAD = np.radians(8.0)
_LOST = 2.5  # times the usual distance of the best node
_LOST_BY = 0.05
_GAP_S = 1.0
_FPS = 30.0  # of the motion model's steps


@dataclass(frozen=True, eq=False)
class FilterFrame:
    """A frame and what the filter believes of it.

    Attributes:
        number: of the frame, time_s: its time.
        person: the silhouette.
        windows: through which the library was compared.
        posterior: over the library.
        distance_m: of the person, after this frame.
        lost: no node fits as nodes usually do.
    """

    number: int
    time_s: float
    person: Person
    windows: tuple[Window, ...]
    posterior: Posterior
    distance_m: float
    lost: bool


class ForwardFilter:
    """Filters one frame after the other.

    Args: tree: the filter. camera: without distortion. facing: upright and facing the camera is
        likelier in the first frame; else all poses are alike. weighting: of the silhouette
        distance. distance_m: where the person stands all the time, as in the paper; None: found,
        frame by frame.
    """

    def __init__(
        self,
        tree: TreeFilter,
        camera: Camera,
        facing: bool = True,
        weighting: Weighting = "balanced",
        distance_m: float | None = None,
    ):
        """Starts without belief."""
        self.tree, self.camera = tree, camera
        self.weighting: Weighting = weighting
        self._distance_m = distance_m
        self._facing = facing
        self._last: FilterFrame | None = None
        self._usual: list[float] = []

    def step(self, number: int, time_s: float, person: Person) -> FilterFrame:
        """Filters a frame."""
        last, library = self._last, self.tree.library
        fresh = last is None or last.lost or time_s - last.time_s > _GAP_S
        if self._distance_m is not None:
            middle, factors = self._distance_m, np.ones(1)
        elif last is None or fresh:
            middle = upright_distance(self.camera, person.mask, library.model.sizes.stature_m)
            factors = np.exp(np.linspace(-_FIRST_REACH, _FIRST_REACH, _FIRST_COUNT))
            if last is not None:
                middle = float(np.sqrt(middle * last.distance_m))
        else:
            middle, factors = last.distance_m, np.exp(np.array([0.0, -_STEP, _STEP]))
        metre_px = STATURE_PX / library.model.sizes.stature_m
        windows = tuple(
            look_at(self.camera, person.mask, middle * factor, metre_px) for factor in factors
        )
        prior = self._prior(windows[0], last, time_s, fresh)
        posterior = self.tree.update(prior, Evidence(windows, self.weighting))
        best = float(posterior.distance[0])
        usual = float(np.median(self._usual)) if self._usual else best
        lost = best > _LOST * usual + _LOST_BY
        if not lost:
            self._usual = [*self._usual[-60:], best]
        found = float(
            np.exp(
                posterior.probability
                @ np.log(np.array([w.distance_m for w in windows])[posterior.scale])
            )
        )
        gain = 1.0 if fresh else _DISTANCE_GAIN
        filter_frame = FilterFrame(
            number,
            time_s,
            person,
            windows,
            posterior,
            float(middle * (found / middle) ** gain),
            lost,
        )
        self._last = filter_frame
        return filter_frame

    def correct(self, distance_m: float) -> None:
        """Takes over the person's distance (m, along the virtual optical axis) from somebody who
        knows better: the refined poses.
        """
        if self._last is not None:
            self._last = replace(self._last, distance_m=distance_m)

    def _prior(
        self, window: Window, last: FilterFrame | None, time_s: float, fresh: bool
    ) -> NDArray[np.float64]:
        library = self.tree.library
        if last is None or (fresh and not last.lost):
            prior = self._initial()
        else:
            steps = int(np.clip(round(((time_s - last.time_s) * _FPS) ** 2), 1, 9))
            prior = self.tree.predict(last.posterior, steps)
            if last.lost:
                prior = 0.5 * prior + 0.5 / len(prior)
        # Only views from about this height count; they are a property of the camera, not of the
        # motion.
        pitch = library.views[library.sample_view, 1]
        prior = prior * np.exp(-0.5 * ((pitch - window.pitch_rad) / _PITCH_SIGMA_RAD) ** 2)
        return prior / prior.sum()

    def _initial(self) -> NDArray[np.float64]:
        library = self.tree.library
        if not self._facing:
            return np.full(len(library), 1.0 / len(library))
        yaw = library.views[library.sample_view, 0]
        tilt = Rotation.from_quat(library.base_quaternion, scalar_first=True).magnitude()[
            library.sample_base
        ]
        # A person who is about to be recorded mostly looks at the camera; how the limbs are held is
        # left open.
        prior = np.exp(2.0 * (np.cos(yaw) - 1) - 0.5 * (tilt / np.radians(20)) ** 2)
        return prior / prior.sum()


def candidates_of(
    tree: TreeFilter, filter_frame: FilterFrame, rows: Sequence[int] | NDArray[np.integer]
) -> PoseCandidates:
    """Returns some of a posterior's samples, by row, as poses in the world."""
    library, posterior = tree.library, filter_frame.posterior
    rows = np.asarray(rows)
    sample = posterior.samples[rows]
    base, view = library.sample_base[sample], library.sample_view[sample]
    window = filter_frame.windows[0]
    rotation = turned(window.heading_rad + library.views[view, 0]) @ rotation_matrices(
        library.base_quaternion[base]
    )
    places = np.empty((len(rows), 3))
    for scale in np.unique(posterior.scale[rows]):
        own = posterior.scale[rows] == scale
        one = filter_frame.windows[scale]
        places[own] = one.place(
            library.pelvis_px[sample[own]] + posterior.shift_px[rows[own]], one.distance_m
        )
    sigma = tree.settings.sigma
    occluded = library.occluded[sample][:, library.model.dof_part].astype(bool)
    return PoseCandidates(
        places,
        rotation,
        library.base_angles[base].astype(float),
        occluded,
        -0.5 * (posterior.distance[rows] / sigma) ** 2,
        filter_frame.time_s,
    )
