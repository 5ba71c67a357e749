"""Whose body is it? A first body from measurements, and its proportions from the recording itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import SHAPE_AXES, BodySizes
from silhouette_core.estimator import Settings
from silhouette_core.progress import Reporter
from silhouette_core.refinement.pose import Pose
from silhouette_core.refinement.silhouette_error import silhouette_error
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.cpu import CpuBackend
from voxelpose.matching.adaptation import Stature, adapt_shape
from voxelpose.matching.body_volume import BodyVolume
from voxelpose.matching.mask_store import MaskStore
from voxelpose.matching.matcher import MatchSettings
from voxelpose.matching.observe import FrameObservation, HullObserver
from voxelpose.matching.pose_search import FittingBody, PoseFit, find_pose
from voxelpose.matching.tracking import PoseTracker

_FEWEST_ANCHORS, _FRAMES_PER_ANCHOR, _MOST_ADAPTED = 5, 60, 12
_CLEAR = 1.4  # an anchor is used where its error is below this many times the best one's
_GIVEN_M, _GUESSED = 0.006, 0.05  # how sure a stature is: given (m), read off the hull (share)
_SCALES = (
    0.93,
    1.0,
    1.07,
)  # tried on a stature that the hull suggests: arms overhead or a crouch mislead it


@dataclass(frozen=True, eq=False)
class Start:
    """Where tracking starts.

    Attributes:
        body: with adapted proportions.
        poses: frame -> pose, where a frame was clear by itself.
        errors: frame -> its silhouette error.
        stature: as given or guessed.
        expected_shape: (20,) the shape that the measurements alone suggest.
    """

    body: FittingBody
    poses: dict[int, Pose]
    errors: dict[int, float]
    stature: Stature
    expected_shape: np.ndarray

    @property
    def shape_names(self) -> tuple[str, ...]:
        """Names of the shape axes."""
        return tuple(axis.name for axis in SHAPE_AXES)


def choose_body(
    observer: HullObserver,
    store: MaskStore,
    settings: Settings,
    matching: MatchSettings,
    reporter: Reporter,
) -> Start:
    """Searches some frames from nothing, and makes the body that fits them.

    Args:
        observer: looks at frames.
        store: the raw silhouettes.
        settings: for stature, chest girth and sex, as far as known.
        matching: settings of the full search.
        reporter: told of the frames.

    Raises:
        InputError: no frame shows a body.
    """
    count = min(len(store), max(_FEWEST_ANCHORS, len(store) // _FRAMES_PER_ANCHOR))
    frames = np.unique(
        np.round((np.arange(count) + 0.5) / count * (len(store) - 1)).astype(int)
    ).tolist()
    observed_frames = {
        t: observed for t in frames if (observed := observer.look(store[t])) is not None
    }
    if not observed_frames:
        raise InputError(
            "the silhouettes leave no hull of a person's size: look at it with `voxelpose carve"
            " RECORDING --frame 0 --out hull.ply`, and check the background pictures and the"
            " calibration"
        )
    reporter.stage("first poses", len(observed_frames) + 1)
    sex = "male" if settings.sex == "unknown" else settings.sex
    if settings.stature_m is not None:
        stature = Stature(settings.stature_m, _GIVEN_M)
    else:
        stature = _guess_stature(observer, observed_frames, settings, matching)
        reporter.note(
            f"no stature given: about {stature.metres:.2f} m by the hull (--stature makes every"
            " joint more accurate)"
        )
    body = _body(BodyModel.from_sizes(BodySizes(stature.metres, settings.chest_m, sex)), observer)
    found: dict[int, PoseFit] = {}
    for t, observed in observed_frames.items():
        answers = find_pose(body, observed.observation, observed.grid, observed.occupancy, matching)
        if answers:
            found[t] = answers[0]
        reporter.advance()
    best = min(answer.error for answer in found.values())
    clear = {t: answer for t, answer in found.items() if answer.error <= _CLEAR * best}
    templates = ("male", "female") if settings.sex == "unknown" else (sex,)
    starts = [
        _adapted(
            BodySizes(stature.metres, settings.chest_m, name),
            observer,
            observed_frames,
            clear,
            stature,
        )
        for name in templates
    ]
    reporter.advance()
    return min(starts, key=lambda start: float(np.mean(list(start.errors.values()))))


def refit(track: PoseTracker, start: Start) -> None:
    """Adapts the proportions once more, to frames from the whole take, and gives the track that
    body.
    """
    posed = np.flatnonzero(np.isfinite(track.error))
    clear = posed[track.error[posed] <= np.median(track.error[posed]) * 1.1]
    frames = clear[
        np.unique(np.linspace(0, len(clear) - 1, min(len(clear), _MOST_ADAPTED)).astype(int))
    ]
    observed_frames = {
        int(t): observed for t in frames if (observed := track.observed(int(t))) is not None
    }
    poses = [pose for t in observed_frames if (pose := track.poses[t]) is not None]
    surface, _ = adapt_shape(
        track.body.surface,
        [observed.observation for observed in observed_frames.values()],
        poses,
        start.stature,
        start.expected_shape,
    )
    track.body = _with_surface(surface, track.observer)


def _guess_stature(
    observer: HullObserver,
    observed_frames: dict[int, FrameObservation],
    settings: Settings,
    matching: MatchSettings,
) -> Stature:
    """Reads the stature off the hull: its height, corrected by which body of three fits a clear
    frame best.
    """
    heights = {
        t: float(np.ptp(np.flatnonzero(s.occupancy.any((0, 1)))) + 1) * s.grid.voxel_size_m
        for t, s in observed_frames.items()
    }
    middle = float(np.median(list(heights.values())))
    t = min(heights, key=lambda k: abs(heights[k] - middle))
    observed = observed_frames[t]
    errors = {}
    for scale in _SCALES:
        metres = float(np.clip(middle * scale, 0.6, 2.4))
        body = _body(BodyModel.from_sizes(BodySizes(metres, settings.chest_m, "male")), observer)
        found = find_pose(
            body, observed.observation, observed.grid, observed.occupancy, matching, count=5
        )
        errors[metres] = found[0].error if found else np.inf
    metres = min(errors, key=lambda key: errors[key])
    return Stature(metres, _GUESSED * metres)


def _adapted(
    sizes: BodySizes,
    observer: HullObserver,
    observed_frames: dict[int, FrameObservation],
    clear: dict[int, PoseFit],
    stature: Stature,
) -> Start:
    model = BodyModel.from_sizes(sizes)
    observations = [observed_frames[t].observation for t in clear]
    surface, poses = adapt_shape(
        Surface(model),
        observations,
        [answer.pose for answer in clear.values()],
        stature,
        model.shape,
    )
    errors = [
        silhouette_error(surface.model, pose, observation)
        for pose, observation in zip(poses, observations, strict=True)
    ]
    return Start(
        _with_surface(surface, observer),
        dict(zip(clear, poses, strict=True)),
        dict(zip(clear, errors, strict=True)),
        stature,
        model.shape,
    )


def _body(model: BodyModel, observer: HullObserver) -> FittingBody:
    return _with_surface(Surface(model), observer)


def _with_surface(surface: Surface, observer: HullObserver) -> FittingBody:
    return FittingBody(
        surface.model, BodyVolume.of(surface.model, observer.voxel_size_m, CpuBackend()), surface
    )
