"""The body that is fitted: a first one from measurements, its proportions from the recording."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import SHAPE_AXES, BodySizes
from silhouette_core.estimator import Settings
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import Reporter
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.adaptation import Stature, adapt_shape
from silhouette_core.refinement.refine import RefineStart
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.backend import Backend, load_backend
from silhouette_core.scoring.silhouette_error import silhouette_error
from voxelpose.matching.girth import GIRTH_CAMERAS, chest_from_hull, hull_volume_m3
from voxelpose.matching.matcher import MatchSettings
from voxelpose.matching.observation_store import ObservationStore
from voxelpose.matching.observe import FrameObservation
from voxelpose.matching.pose_search import (
    SEARCHED,
    BodyGeometry,
    find_pose,
    refine_fits,
)
from voxelpose.matching.tracking import PoseTracker

_FEWEST_ANCHORS, _FRAMES_PER_ANCHOR, _MOST_ADAPTED = 5, 60, 12
_CLEAR = 1.4  # an anchor is used where its error is below this many times the smallest one
_GIVEN_SIGMA_M = 0.006  # standard deviation of a given stature
_HULL_SIGMA = 0.05  # the same of one estimated from the hull, as a fraction of it
_OTHER_GIRTH = 0.93  # a body of the hull's girth is taken where its error is so much smaller
_VARIES = 1.1  # the hull's largest height over its usual one from which both are looked at
# Tried on a stature estimated from the hull: arms overhead or a crouch falsify it.
_SCALES = (0.93, 1.0, 1.07)
# Of adults. Who hangs, sits or lies all the time is taken for one who does not, if by little.
_ADULT_M, _ADULT_SIGMA_M, _UNUSUAL = 1.70, 0.12, 0.01
_FAR = 1.15  # factor from that stature from which an adult is looked at, too


@dataclass(frozen=True, eq=False)
class Start:
    """What tracking starts from.

    Attributes:
        body: with adapted proportions.
        poses: frame -> pose, for the anchor frames that are clear.
        errors: frame -> its silhouette error.
        stature: given or estimated.
        expected_shape: (20,) the shape that the measurements alone suggest.
    """

    body: BodyGeometry
    poses: dict[int, Pose]
    errors: dict[int, float]
    stature: Stature
    expected_shape: np.ndarray

    @property
    def shape_names(self) -> tuple[str, ...]:
        """Names of the shape axes."""
        return tuple(axis.name for axis in SHAPE_AXES)


def choose_body(
    observations: ObservationStore, settings: Settings, matching: MatchSettings, reporter: Reporter
) -> Start:
    """Searches anchor frames without a prior, and adapts a body to them.

    Args:
        observations: of every frame.
        settings: for stature, chest girth and sex, as far as known.
        matching: settings of the full search.
        reporter: receives the progress.

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
    sex = "male" if settings.sex == "unknown" else settings.sex
    voxel_size_m, backend = observations.observer.voxel_size_m, load_backend(settings.backend)
    if settings.stature_m is not None:
        stature = Stature(settings.stature_m, _GIVEN_SIGMA_M)
    else:
        stature = _stature_from_hull(frames, settings, matching, voxel_size_m, backend)
        reporter.note(
            f"no stature given: about {stature.metres:.2f} m by the hull (--stature makes every"
            " joint more accurate)"
        )
    body = body_of(BodySizes(stature.metres, settings.chest_m, sex), voxel_size_m, backend)
    templates = ("male", "female") if settings.sex == "unknown" else (sex,)

    def starts(searched: BodyGeometry, chest_m: float | None) -> list[Start]:
        """With bodies of a girth, from poses that were searched with one body."""
        found = side_by_side(
            lambda frame: find_pose(searched, frame, matching)[:1], list(frames.values())
        )
        fits = {t: fit for t, best in zip(frames, found, strict=True) for fit in best}
        smallest = min(fit.error for fit in fits.values())
        clear = {t: fit.pose for t, fit in fits.items() if fit.error <= _CLEAR * smallest}
        return adapted(clear, chest_m)

    def adapted(poses: dict[int, Pose], chest_m: float | None) -> list[Start]:
        bodies = [
            body_of(BodySizes(stature.metres, chest_m, name), voxel_size_m, backend)
            for name in templates
        ]
        return side_by_side(
            lambda body: _adapted(body, frames, poses, stature, voxel_size_m), bodies
        )

    best = min(starts(body, settings.chest_m), key=_mean_error)
    reporter.advance(len(frames))
    if settings.chest_m is None and len(observations.observer.views.rig) >= GIRTH_CAMERAS:
        volumes = [hull_volume_m3(frame) for frame in frames.values()]
        chest_m = chest_from_hull(body.model, float(np.median(volumes)))
        stout = min(adapted(best.poses, chest_m), key=_mean_error)
        if _mean_error(stout) < _OTHER_GIRTH * _mean_error(best):
            # Poses of a body so different are to be searched with it.
            body = body_of(BodySizes(stature.metres, chest_m, sex), voxel_size_m, backend)
            best = min([stout, *starts(body, chest_m)], key=_mean_error)
    reporter.advance()
    return best


def _mean_error(start: Start) -> float:
    return float(np.mean(list(start.errors.values())))


def refit(tracker: PoseTracker, start: Start) -> None:
    """Adapts the tracker's body again, to clear frames of the whole recording."""
    posed = np.flatnonzero(np.isfinite(tracker.error))
    clear = posed[tracker.error[posed] <= np.median(tracker.error[posed]) * 1.1]
    spaced = np.linspace(0, len(clear) - 1, min(len(clear), _MOST_ADAPTED)).astype(int)
    frames = {
        int(t): frame
        for t in clear[np.unique(spaced)]
        if (frame := tracker.observe(int(t))) is not None
    }
    surface, _ = adapt_shape(
        tracker.body.surface,
        [frame.observation for frame in frames.values()],
        [pose for t in frames if (pose := tracker.poses[t]) is not None],
        start.stature,
        start.expected_shape,
    )
    voxel_size_m = tracker.observations.observer.voxel_size_m
    backend = tracker.body.body_volume.backend
    tracker.body = BodyGeometry.from_surface(surface, voxel_size_m, backend)


def _stature_from_hull(
    frames: dict[int, FrameObservation],
    settings: Settings,
    matching: MatchSettings,
    voxel_size_m: float,
    backend: Backend,
) -> Stature:
    """Height of the hull, corrected by which of several bodies fits best.

    Compared are bodies about the hull's usual height, in a frame of that height; where it varies,
    as in somebody who crouches or jumps, about its largest, in the tallest frame as well; and where
    all of these are unusual statures, about an adult's.
    """
    heights = {
        t: float(np.ptp(np.flatnonzero(frame.occupancy.any((0, 1)))) + 1) * frame.grid.voxel_size_m
        for t, frame in frames.items()
    }
    middle, tallest = float(np.median(list(heights.values()))), max(heights.values())
    varies = tallest > _VARIES * middle
    looked_at = [
        frames[min(heights, key=lambda t, height=height: abs(heights[t] - height))]
        for height in ([middle, tallest] if varies else [middle])
    ]

    def of(metres: float) -> BodyGeometry:
        sizes = BodySizes(float(np.clip(metres, 0.6, 2.4)), settings.chest_m, "male")
        return body_of(sizes, voxel_size_m, backend)

    # The postures are searched with few bodies; the others start from them.
    usual = [middle, tallest] if varies else [middle]
    if all(abs(np.log(height / _ADULT_M)) > np.log(_FAR) for height in usual):
        usual.append(_ADULT_M)
    searched = [of(height) for height in usual]
    pairs = [(body, frame) for frame in looked_at for body in searched]
    found = side_by_side(lambda pair: find_pose(*pair, matching, count=5)[:3], pairs)
    starts = [
        [
            RefineStart(fit.pose, SEARCHED)
            for (_, frame), fits in zip(pairs, found, strict=True)
            if frame is looked
            for fit in fits
        ]
        for looked in looked_at
    ]
    bodies = [
        of(body.model.sizes.stature_m * scale) if scale != 1 else body
        for body in searched
        for scale in _SCALES
    ]

    def error(body: BodyGeometry) -> float:
        unusual = (body.model.sizes.stature_m - _ADULT_M) / _ADULT_SIGMA_M
        return (1 + _UNUSUAL * unusual**2) * sum(
            min((fit.error for fit in refine_fits(body, frame.observation, begun)), default=np.inf)
            for frame, begun in zip(looked_at, starts, strict=True)
        )

    errors = side_by_side(error, bodies)
    metres = bodies[int(np.argmin(errors))].model.sizes.stature_m
    return Stature(metres, _HULL_SIGMA * metres)


def _adapted(
    body: BodyGeometry,
    frames: dict[int, FrameObservation],
    poses: dict[int, Pose],
    stature: Stature,
    voxel_size_m: float,
) -> Start:
    """Start with a body whose proportions are adapted to posed frames."""
    backend, expected = body.body_volume.backend, body.model.shape
    observations = [frames[t].observation for t in poses]
    surface, adapted = adapt_shape(
        body.surface, observations, list(poses.values()), stature, expected
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
    )


def body_of(sizes: BodySizes, voxel_size_m: float, backend: Backend) -> BodyGeometry:
    """A body of these measurements, prepared for fitting with voxels of that size."""
    surface = Surface(BodyModel.from_sizes(sizes), taken=_sampled(sizes.sex))
    return BodyGeometry.from_surface(surface, voxel_size_m, backend)


@cache
def _sampled(sex: str) -> np.ndarray:
    """The same vertices of all bodies of a template: choosing them takes longer than the rest."""
    return Surface(BodyModel.from_sizes(BodySizes(1.7, None, sex))).taken
