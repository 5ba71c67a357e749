"""Whose body is it? A first body from measurements, and its proportions from the recording itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import SHAPE_AXES, BodySizes
from silhouette_core.estimator import Reporter, Settings
from silhouette_core.fitting.agreement import silhouette_error
from silhouette_core.fitting.pose import Pose
from silhouette_core.fitting.solid import Solid
from silhouette_core.fitting.surface import Surface
from silhouette_core.image.mask_store import MaskStore
from silhouette_core.scoring.cpu import CpuBackend
from voxelpose.matching.adaptation import Stature, adapt_shape
from voxelpose.matching.matcher import MatchSettings
from voxelpose.matching.search import Body, Found, find_pose
from voxelpose.matching.sequence import Sight, Watcher
from voxelpose.matching.tracking import Track

_FEWEST_ANCHORS, _FRAMES_PER_ANCHOR, _MOST_ADAPTED = 5, 60, 12
_CLEAR = 1.4  # an anchor is used where its error is below this many times the best one's
_GIVEN_M, _GUESSED = 0.006, 0.05  # how sure a stature is: given (m), read off the hull (share)
_SCALES = (0.93, 1.0, 1.07)  # tried on a stature that the hull suggests: arms overhead or a crouch mislead it


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

    body: Body
    poses: dict[int, Pose]
    errors: dict[int, float]
    stature: Stature
    expected_shape: np.ndarray

    @property
    def shape_names(self) -> tuple[str, ...]:
        """Names of the shape axes."""
        return tuple(axis.name for axis in SHAPE_AXES)


def choose_body(watcher: Watcher, store: MaskStore, settings: Settings, matching: MatchSettings, reporter: Reporter) -> Start:
    """Searches some frames from nothing, and makes the body that fits them.

    Args:
        watcher: looks at frames.
        store: the raw silhouettes.
        settings: for stature, chest girth and sex, as far as known.
        matching: settings of the full search.
        reporter: told of the frames.

    Raises:
        InputError: no frame shows a body.
    """
    count = min(len(store), max(_FEWEST_ANCHORS, len(store) // _FRAMES_PER_ANCHOR))
    frames = np.unique(np.round((np.arange(count) + 0.5) / count * (len(store) - 1)).astype(int)).tolist()
    sights = {t: sight for t in frames if (sight := watcher.look(store[t])) is not None}
    if not sights:
        raise InputError(
            "the silhouettes leave no hull of a person's size: look at it with `voxelpose carve RECORDING --frame 0 --out hull.ply`, "
            "and check the background pictures and the calibration"
        )
    reporter.stage("first poses", len(sights) + 1)
    sex = "male" if settings.sex == "unknown" else settings.sex
    if settings.stature_m is not None:
        stature = Stature(settings.stature_m, _GIVEN_M)
    else:
        stature = _guess_stature(watcher, sights, settings, matching)
        reporter.note(f"no stature given: about {stature.metres:.2f} m by the hull (--stature makes every joint more accurate)")
    body = _body(BodyModel.from_sizes(BodySizes(stature.metres, settings.chest_m, sex)), watcher)
    found: dict[int, Found] = {}
    for t, sight in sights.items():
        answers = find_pose(body, sight.observation, sight.grid, sight.occupancy, matching)
        if answers:
            found[t] = answers[0]
        reporter.advance()
    best = min(answer.error for answer in found.values())
    clear = {t: answer for t, answer in found.items() if answer.error <= _CLEAR * best}
    templates = ("male", "female") if settings.sex == "unknown" else (sex,)
    starts = [_adapted(BodySizes(stature.metres, settings.chest_m, name), watcher, sights, clear, stature) for name in templates]
    reporter.advance()
    return min(starts, key=lambda start: float(np.mean(list(start.errors.values()))))


def refit(track: Track, start: Start) -> None:
    """Adapts the proportions once more, to frames from the whole take, and gives the track that body."""
    posed = np.flatnonzero(np.isfinite(track.error))
    clear = posed[track.error[posed] <= np.median(track.error[posed]) * 1.1]
    frames = clear[np.unique(np.linspace(0, len(clear) - 1, min(len(clear), _MOST_ADAPTED)).astype(int))]
    sights = {int(t): sight for t in frames if (sight := track.sight(int(t))) is not None}
    poses = [pose for t in sights if (pose := track.poses[t]) is not None]
    surface, _ = adapt_shape(
        track.body.surface, [sight.observation for sight in sights.values()], poses, start.stature, start.expected_shape
    )
    track.body = _with_surface(surface, track.watcher)


def _guess_stature(watcher: Watcher, sights: dict[int, Sight], settings: Settings, matching: MatchSettings) -> Stature:
    """Reads the stature off the hull: its height, corrected by which body of three fits a clear frame best."""
    heights = {t: float(np.ptp(np.flatnonzero(s.occupancy.any((0, 1)))) + 1) * s.grid.voxel_size_m for t, s in sights.items()}
    middle = float(np.median(list(heights.values())))
    t = min(heights, key=lambda k: abs(heights[k] - middle))
    sight = sights[t]
    errors = {}
    for scale in _SCALES:
        metres = float(np.clip(middle * scale, 0.6, 2.4))
        body = _body(BodyModel.from_sizes(BodySizes(metres, settings.chest_m, "male")), watcher)
        found = find_pose(body, sight.observation, sight.grid, sight.occupancy, matching, count=5)
        errors[metres] = found[0].error if found else np.inf
    metres = min(errors, key=lambda key: errors[key])
    return Stature(metres, _GUESSED * metres)


def _adapted(sizes: BodySizes, watcher: Watcher, sights: dict[int, Sight], clear: dict[int, Found], stature: Stature) -> Start:
    model = BodyModel.from_sizes(sizes)
    observations = [sights[t].observation for t in clear]
    surface, poses = adapt_shape(Surface(model), observations, [answer.pose for answer in clear.values()], stature, model.shape)
    errors = [silhouette_error(surface.model, pose, observation) for pose, observation in zip(poses, observations, strict=True)]
    return Start(
        _with_surface(surface, watcher),
        dict(zip(clear, poses, strict=True)),
        dict(zip(clear, errors, strict=True)),
        stature,
        model.shape,
    )


def _body(model: BodyModel, watcher: Watcher) -> Body:
    return _with_surface(Surface(model), watcher)


def _with_surface(surface: Surface, watcher: Watcher) -> Body:
    return Body(surface.model, Solid.of(surface.model, watcher.voxel_size_m, CpuBackend()), surface)
