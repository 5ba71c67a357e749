"""One person's body from several recordings."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from calib.errors import InputError
from silhouette_core.body.body_file import unclothed
from silhouette_core.body.mesh_measurements import measure_body
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import IS_CLOTHING, SHAPE_AXES, SHAPE_SIGMA
from silhouette_core.estimator import FrameSource, Settings
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.refinement.adaptation import Stature, shape_covariance
from silhouette_core.refinement.observation import Observation
from silhouette_core.scoring.backend import load_backend
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.person.body_choice import Start, choose_body
from voxelpose.multiview.person.body_refit import (
    adapted_to,
    clear_frames,
    shaped_template,
    with_joints_of,
)
from voxelpose.multiview.silhouettes.observation_store import ObservationStore
from voxelpose.multiview.silhouettes.prepared_silhouettes import (
    PreparationSettings,
    prepare_silhouettes,
)
from voxelpose.multiview.tracking.tracking import PoseTracker, PoseTrackerSettings

_VOXEL_M = 0.025
FRAMES = 24
"""Frames of each recording that a body is estimated from."""
# Relative: what bodies differ by in ways that no axis of the shape has. On random recordings whose
# statures were not given these were wrong by 0.3 per cent, and bones by 4.
_RELATIVE_SIGMA = {"stature_m": 0.005, "mass_kg": 0.10}
_OTHER_SIGMA = 0.04
# The residuals of neighbouring frames, and of all frames of one motion, err alike.
_FORMAL = 3.0


@dataclass(frozen=True, eq=False)
class PosedFrames:
    """Frames of one recording that show a person well.

    Attributes:
        start: body and stature by this recording alone.
        observations: F frames.
        poses: their F poses.
    """

    start: Start
    observations: list[Observation]
    poses: list[Pose]


@dataclass(frozen=True, eq=False)
class BodyEstimate:
    """A person's body.

    Attributes:
        model: the body, with its clothes.
        covariance: (K, K) of its shape's deviations, of the residuals alone.
        frames: number of frames that it was estimated from.
        error: mean silhouette error in these.
    """

    model: BodyModel
    covariance: np.ndarray
    frames: int
    error: float

    def standard_errors(self) -> np.ndarray:
        """Standard errors (N,) float64 of the measurements that `measure_body` takes, in its order
        and units: by the residuals, and by what the shape has no axis for.
        """
        value, step = _measured(self.model, self.model.shape), 1e-3
        rows = [
            (_measured(self.model, self.model.shape + step * one) - value) / step
            for one in np.eye(len(self.model.shape))
        ]
        variance = np.einsum("kn,kl,ln->n", rows, self.covariance, rows)
        relative = np.array([_RELATIVE_SIGMA.get(name, _OTHER_SIGMA) for name in self.names])
        return np.sqrt(_FORMAL**2 * variance + (relative * value) ** 2)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the measurements."""
        return tuple(measure_body(unclothed(self.model)).known())

    def clothes_m(self) -> dict[str, float]:
        """Thickness of each piece of clothing, m."""
        return {
            axis.name: float(deviation * self.model.sizes.stature_m)
            for axis, deviation in zip(SHAPE_AXES, self.model.shape, strict=True)
            if axis.is_clothing
        }


def _measured(model: BodyModel, shape: np.ndarray) -> np.ndarray:
    """Measurements (N,) of a body with other deviations, without clothes."""
    bare = model.reshaped(np.where(IS_CLOTHING, 0.0, shape))
    return np.array(list(measure_body(bare).known().values()))


def posed_frames(source: FrameSource, settings: Settings, reporter: Reporter) -> PosedFrames:
    """Poses of a recording's clearest frames.

    Args:
        source: the frames, of two cameras or more.
        settings: what is known of the person, and of the background.
        reporter: told the progress.

    Raises:
        InputError: there are too few cameras, a background cannot be used, or nobody is seen.
    """
    if len(source.rig) < 2:
        raise InputError(
            f"{len(source.rig)} camera is too few for a body: give recordings of at least two"
            " calibrated cameras"
        )
    clock, matching = StageClock(), MatchSettings()
    preparation = PreparationSettings(_VOXEL_M, 0, "auto", matching)
    tracking = PoseTrackerSettings(source.fps, matching)
    with (
        prepare_silhouettes(source, settings, preparation, clock, reporter) as prepared,
        closing(ObservationStore(prepared.observer, prepared.store)) as observations,
    ):
        start = choose_body(observations, settings, tracking.match, reporter)
        tracker = PoseTracker(start.body, observations, tracking, clock, reporter.advance)
        reporter.stage("tracking", len(observations))
        tracker.begin(start.poses, start.errors)
        tracker.begin_again()
        frames = clear_frames(tracker, FRAMES)
        seen = [frame.observation for frame in frames.values()]
        poses = [pose for t in frames if (pose := tracker.poses[t]) is not None]
    return PosedFrames(start, seen, poses)


def estimate_body(
    recordings: Sequence[PosedFrames], settings: Settings, reporter: Reporter
) -> BodyEstimate:
    """Body of a person who was seen in one or several recordings.

    Every recording's own body is where an adaptation to the frames of all begins; the one that
    explains them best is taken.

    Args:
        recordings: their clear frames.
        settings: what is known of the person.
        reporter: told the progress.

    Raises:
        InputError: there is no recording.
    """
    if not recordings:
        raise InputError("no recording of the person: give one or more")
    starts = [recording.start for recording in recordings]
    precision = np.array([1 / start.stature.sigma_m**2 for start in starts])
    metres = float(np.average([start.stature.metres for start in starts], weights=precision))
    stature = Stature(metres, float(max(precision) ** -0.5))
    observations = [one for recording in recordings for one in recording.observations]
    owned = [(recording.start.body.model, p) for recording in recordings for p in recording.poses]
    sexes = ("male", "female") if settings.sex == "unknown" else (settings.sex,)
    backend = load_backend(settings.backend)
    reporter.stage("body", len(starts) * len(sexes))
    found = []
    for start in starts:
        first = start.body.model
        for sex in sexes:
            sizes = replace(first.sizes, stature_m=metres, sex=sex)
            surface, expected = shaped_template(sizes, first.shape)
            poses = [with_joints_of(surface.model, model, pose) for model, pose in owned]
            prior = expected, np.diag(SHAPE_SIGMA**2)
            found.append(adapted_to(surface, prior, observations, poses, stature, backend))
            reporter.advance()
    best = min(found, key=lambda one: one.cost)
    covariance = shape_covariance(best.surface, observations, best.poses, stature)
    return BodyEstimate(best.surface.model, covariance, len(observations), best.error)
