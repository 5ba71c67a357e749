"""The body that is fitted: a first one from measurements, its proportions from the recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import (
    CHESTS_M,
    IS_CLOTHING,
    SHAPE_AXES,
    SHAPE_SIGMA,
    STATURES_M,
    BodySizes,
)
from silhouette_core.estimator import Settings
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import Reporter
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.adaptation import Stature, adapt_shape, stature_of
from silhouette_core.scoring.backend import Backend, load_backend
from silhouette_core.scoring.silhouette_error import silhouette_error
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.matching.pose_search import (
    BodyGeometry,
    PoseFit,
    find_pose,
)
from voxelpose.multiview.person.girth import GIRTH_CAMERAS, chest_from_hull, hull_volume_m3
from voxelpose.multiview.person.sitting import find_sitting_pose
from voxelpose.multiview.person.stature_search import (
    ADULT_M,
    HULL_SIGMA,
    stature_candidates,
    unusual_by,
)
from voxelpose.multiview.silhouettes.observation_store import ObservationStore

PoseSearch = Callable[[BodyGeometry, FrameObservation], list[PoseFit]]
"""Searches the poses of a frame, best first."""
_FEWEST_ANCHORS, _FRAMES_PER_ANCHOR = 5, 60
_CLEAR = 1.4  # an anchor is used where its error is below this many times the smallest one
_GIVEN_SIGMA_M = 0.006  # standard deviation of a given stature
_KNOWN_SIGMA = 1e-4  # relative, of all of a known body but its clothes
_OTHER_GIRTH = 0.93  # a body of the hull's girth is taken where its error is so much smaller
_CLEARLY = 0.75  # the same for a body that is not of the hull's height
_UNUSUAL = 1.8  # standard deviations of a stature from which an adult's is tried as well
_REBASED, _SAME_STATURE, _OTHER_STATURE = 2, 0.02, 0.04  # relative differences


@dataclass(frozen=True, eq=False)
class Start:
    """What tracking starts from.

    Attributes:
        body: with adapted proportions.
        poses: frame -> pose, for the anchor frames that are clear.
        errors: frame -> its silhouette error.
        stature: given or estimated.
        expected_shape: (K,) the shape that the measurements alone suggest.
        covariance: (K, K) of that prior; None: the body stays as it is.
    """

    body: BodyGeometry
    poses: dict[int, Pose]
    errors: dict[int, float]
    stature: Stature
    expected_shape: np.ndarray
    covariance: np.ndarray | None

    @property
    def shape_names(self) -> tuple[str, ...]:
        """Names of the shape axes."""
        return tuple(axis.name for axis in SHAPE_AXES)


def choose_body(
    observations: ObservationStore,
    settings: Settings,
    matching: MatchSettings,
    reporter: Reporter,
    known: BodyModel | None = None,
    keep_clothes: bool = False,
    sitting: bool = False,
) -> Start:
    """Searches anchor frames without a prior, and adapts a body to them.

    Args:
        observations: of every frame.
        settings: for stature, chest girth and sex, as far as known.
        matching: settings of the full search.
        reporter: receives the progress.
        known: the person's body, of which only the clothes are then adapted; None: all of it is.
        keep_clothes: the known body's clothes are kept, too.
        sitting: whether sitting postures are searched, and an adult's stature is expected where
            it is not given: the hull's height is not the person's.

    Raises:
        InputError: no frame shows a body.
    """
    total = len(observations)
    count = min(total, max(_FEWEST_ANCHORS, total // _FRAMES_PER_ANCHOR))
    anchors = np.unique(np.round((np.arange(count) + 0.5) / count * (total - 1)).astype(int))
    frames = {t: frame for t in anchors.tolist() if (frame := observations.observe(t)) is not None}
    if not frames:
        raise InputError(
            "the silhouettes leave no hull of a person's size: look at it with `voxelpose carve"
            " RECORDING --frame 0 --out hull.ply`, and check the background pictures and the"
            " calibration"
        )
    reporter.stage("first poses", len(frames) + 1)
    voxel_size_m, backend = observations.observer.voxel_size_m, load_backend(settings.backend)
    search: PoseSearch = find_sitting_pose if sitting else partial(find_pose, settings=matching)
    if known is not None:
        reporter.advance(len(frames) + 1)
        body = BodyGeometry.from_model(known, voxel_size_m, backend)
        fits = _clear_fits(body, frames, search)
        return _known_start(body, frames, fits, voxel_size_m, keep_clothes)
    if settings.stature_m is not None:
        candidates = [Stature(settings.stature_m, _GIVEN_SIGMA_M)]
    elif sitting:
        candidates = [Stature(ADULT_M, HULL_SIGMA * ADULT_M)]
    else:
        candidates = stature_candidates(frames, settings, matching, voxel_size_m, backend)
    bodies = _BodySearch(frames, settings, search, voxel_size_m, backend)
    best, *others = map(bodies.start, candidates)
    for other in others:  # of the hull's height
        if _mean_error(best) > _CLEARLY * _mean_error(other):
            best = other
    if settings.stature_m is None:
        if unusual_by(best.stature.metres) > _UNUSUAL:
            # Who reaches up or bends over fills the hull of a giant, too.
            adult = bodies.start(Stature(ADULT_M, HULL_SIGMA * ADULT_M))
            best = min([best, adult], key=_mean_error)
        reporter.note(
            f"no stature given: about {best.stature.metres:.2f} m by the hull (--stature makes"
            " every joint more accurate)"
        )
    reporter.advance(len(frames) + 1)
    return best


@dataclass(frozen=True, eq=False)
class _BodySearch:
    """Search of poses and proportions in some frames; attributes as of `choose_body`."""

    frames: dict[int, FrameObservation]
    settings: Settings
    search: PoseSearch
    voxel_size_m: float
    backend: Backend

    def start(self, stature: Stature) -> Start:
        """The best start with a stature, by girth and template."""
        settings, frames, first = self.settings, list(self.frames.values()), stature
        best = self._searched(stature, settings.chest_m)
        if settings.chest_m is None and len(frames[0].masks) >= GIRTH_CAMERAS:
            volume_m3 = float(np.median([hull_volume_m3(frame) for frame in frames]))
            chest_m = chest_from_hull(self._body(stature, None).model, volume_m3)
            stout = self._adapted(best.poses, stature, chest_m)
            if _mean_error(stout) < _OTHER_GIRTH * _mean_error(best):
                # Poses of a body so different are to be searched with it.
                best = min([stout, self._searched(stature, chest_m)], key=_mean_error)
        for _ in range(_REBASED if settings.stature_m is None else 0):
            # What the first body was too tall by would stay in the proportions: its are the prior.
            found = float(np.clip(stature_of(best.body.model), *STATURES_M))
            if abs(found / stature.metres - 1) < _SAME_STATURE:
                break
            chest_m = best.body.model.sizes.chest_girth_m
            if chest_m is not None:
                chest_m = float(np.clip(chest_m * found / stature.metres, *CHESTS_M))
            stature = Stature(found, HULL_SIGMA * found)
            best = self._adapted(best.poses, stature, chest_m)
        if abs(stature.metres / first.metres - 1) > _OTHER_STATURE:
            chest_m = best.body.model.sizes.chest_girth_m
            best = min([best, self._searched(stature, chest_m)], key=_mean_error)
        return best

    def _body(self, stature: Stature, chest_m: float | None) -> BodyGeometry:
        sex = "male" if self.settings.sex == "unknown" else self.settings.sex
        return BodyGeometry.from_sizes(
            BodySizes(stature.metres, chest_m, sex), self.voxel_size_m, self.backend
        )

    def _searched(self, stature: Stature, chest_m: float | None) -> Start:
        """From poses that are searched with one body."""
        body = self._body(stature, chest_m)
        fits = _clear_fits(body, self.frames, self.search)
        return self._adapted({t: fit.pose for t, fit in fits.items()}, stature, chest_m)

    def _adapted(self, poses: dict[int, Pose], stature: Stature, chest_m: float | None) -> Start:
        """With the template that fits better, adapted to posed frames."""
        sex = self.settings.sex
        sizes = [
            BodySizes(stature.metres, chest_m, name)
            for name in (("male", "female") if sex == "unknown" else (sex,))
        ]

        def adapted(size: BodySizes) -> Start:
            body = BodyGeometry.from_sizes(size, self.voxel_size_m, self.backend)
            return _adapted(body, self.frames, poses, stature, self.voxel_size_m)

        return min(side_by_side(adapted, sizes), key=_mean_error)


def _known_start(
    body: BodyGeometry,
    frames: dict[int, FrameObservation],
    fits: dict[int, PoseFit],
    voxel_size_m: float,
    keep_clothes: bool,
) -> Start:
    """Start with a person's known body, whose clothes are adapted unless they are kept."""
    model = body.model
    poses = {t: fit.pose for t, fit in fits.items()}
    errors = {t: fit.error for t, fit in fits.items()}
    stature = Stature(stature_of(model), _GIVEN_SIGMA_M)
    if keep_clothes:
        return Start(body, poses, errors, stature, model.shape, None)
    sigma = np.where(IS_CLOTHING, SHAPE_SIGMA, _KNOWN_SIGMA)
    expected = np.where(IS_CLOTHING, 0.0, model.shape)
    prior = expected, np.diag(sigma**2)
    return _adapted(body, frames, poses, stature, voxel_size_m, prior)


def _clear_fits(
    body: BodyGeometry,
    frames: dict[int, FrameObservation],
    search: PoseSearch,
) -> dict[int, PoseFit]:
    """Poses of the frames in which they explain the silhouettes nearly as well as in the best."""
    found = side_by_side(lambda frame: search(body, frame)[:1], list(frames.values()))
    fits = {t: fit for t, best in zip(frames, found, strict=True) for fit in best}
    smallest = min(fit.error for fit in fits.values())
    return {t: fit for t, fit in fits.items() if fit.error <= _CLEAR * smallest}


def _mean_error(start: Start) -> float:
    return float(np.mean(list(start.errors.values())))


def _adapted(
    body: BodyGeometry,
    frames: dict[int, FrameObservation],
    poses: dict[int, Pose],
    stature: Stature,
    voxel_size_m: float,
    prior: tuple[np.ndarray, np.ndarray] | None = None,
) -> Start:
    """Start with a body whose proportions are adapted to posed frames; their prior's mean and
    covariance are the body's shape and `SHAPE_SIGMA` where none is given.
    """
    backend = body.body_volume.backend
    expected, covariance = prior or (body.model.shape, np.diag(SHAPE_SIGMA**2))
    observations = [frames[t].observation for t in poses]
    surface, adapted = adapt_shape(
        body.surface, observations, list(poses.values()), stature, expected, covariance
    )
    errors = [
        silhouette_error(surface.model, pose, observation, backend)
        for pose, observation in zip(adapted, observations, strict=True)
    ]
    return Start(
        BodyGeometry.from_surface(surface, voxel_size_m, backend),
        dict(zip(poses, adapted, strict=True)),
        dict(zip(poses, errors, strict=True)),
        stature,
        expected,
        covariance,
    )
