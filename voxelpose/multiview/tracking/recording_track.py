"""The body's poses in all frames of a recording: first poses, tracking, proportions, refinement."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from silhouette_core.body.model import BodyModel
from silhouette_core.estimator import Settings
from silhouette_core.motion.body_source import names_result
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.refinement.adaptation import stature_of
from voxelpose.multiview.person.body_choice import Start, choose_body
from voxelpose.multiview.person.body_refit import refit
from voxelpose.multiview.person.given_body import start_given
from voxelpose.multiview.silhouettes.observation_store import ObservationStore, carved_observations
from voxelpose.multiview.silhouettes.prepared_silhouettes import PreparedSilhouettes
from voxelpose.multiview.silhouettes.static_objects import StaticObjects, find_static_objects
from voxelpose.multiview.tracking.tracking import PoseTracker, PoseTrackerSettings

_POOR = 0.15  # median error from which sitting postures are searched; right ones have 0.06 to 0.1
_BETTER = 0.97  # factor below which another track's error is the better one
_ROUNDS = 4
_Facts = dict[str, object]


@dataclass(frozen=True, eq=False)
class TrackWork:
    """Tracking of one recording.

    Attributes:
        settings: of the estimator.
        tracking: of the tracker.
        known: the body; None: it is estimated.
        clock: told the durations.
        reporter: told the progress, and what was found.
    """

    settings: Settings
    tracking: PoseTrackerSettings
    known: BodyModel | None
    clock: StageClock
    reporter: Reporter

    def track(
        self, prepared: PreparedSilhouettes, kept: ExitStack
    ) -> tuple[PoseTracker, dict[str, object]]:
        """Poses of all frames, and facts for the summary.

        Args:
            prepared: the silhouettes.
            kept: closes what the tracker needs.
        """
        if self.known is not None and self.known.person is None:
            return self._given(self._observations(prepared, kept), self.known)
        tracker, start, objects = self._person(prepared, kept)
        self.reporter.stage("proportions")
        with self.clock("proportions"):
            refit(tracker, start, self.known is None and self.settings.sex == "unknown")
        self._polish(tracker)
        facts: _Facts = {
            "stature_m": stature_of(tracker.body.model),
            "stature_given": self.settings.stature_m is not None or self.known is not None,
            "sex_template": tracker.body.model.sizes.sex,
            "shape": dict(
                zip(start.shape_names, tracker.body.model.shape.round(4).tolist(), strict=True)
            ),
            "objects_share": {},
        }
        if objects is not None:
            pairs = zip(prepared.rig.names, objects.pixels, strict=True)
            shares = {name: round(float(pixels.mean()), 4) for name, pixels in pairs}
            facts |= {"objects_share": shares, "objects_apart": objects.apart}
        return tracker, facts | _found(tracker, start.poses)

    def _person(
        self, prepared: PreparedSilhouettes, kept: ExitStack
    ) -> tuple[PoseTracker, Start, StaticObjects | None]:
        """Tracks a person; where something stands beside, again without it, while that helps."""
        tracker, start = self._best_start(self._observations(prepared, kept))
        objects: StaticObjects | None = None
        for _ in range(_ROUNDS):
            store, observer, model = prepared.store, prepared.observer, tracker.body.model
            with self.clock("objects"):
                at, poor = (model, tracker.poses, store, observer), _median_error(tracker) > _POOR
                found = find_static_objects(*at, behind=poor)
            if found is None:
                break
            objects, error = found, _median_error(tracker)
            without = kept.enter_context(prepared.without(found.pixels))
            tracker, start = self._best_start(self._observations(without, kept))
            if _median_error(tracker) > _BETTER * error:
                break
        if objects is not None:
            self.reporter.note(
                "something stands apart from the person all the time: it is left out"
                if objects.apart
                else "something stands beside the person all the time, as a chair does: it is left"
                " out, and what it hides; look at the contact sheet whether it is no part of the"
                " person"
            )
        return tracker, start, objects

    def _best_start(self, observations: ObservationStore) -> tuple[PoseTracker, Start]:
        """Tracks a person from the first poses; where these explain little, from sitting ones."""
        tracker, start = self._started(observations, sitting=False)
        if _median_error(tracker) > _POOR:
            self.reporter.stage("sitting postures")
            sitting, other = self._started(observations, sitting=True)
            if _median_error(sitting) < _BETTER * _median_error(tracker):
                return sitting, other
        return tracker, start

    def _started(
        self, observations: ObservationStore, *, sitting: bool
    ) -> tuple[PoseTracker, Start]:
        settings, known = self.settings, self.known
        self.reporter.stage("first poses")
        with self.clock("first poses"):
            keep = known is not None and names_result(str(settings.options["body"]))
            given = self.tracking.match, self.reporter, known, keep, sitting
            start = choose_body(observations, settings, *given)
        tracker = PoseTracker(
            start.body, observations, self.tracking, self.clock, self.reporter.advance
        )
        self._follow(tracker, start.poses, start.errors)
        return tracker, start

    def _given(
        self, observations: ObservationStore, model: BodyModel
    ) -> tuple[PoseTracker, dict[str, object]]:
        """As `track`, with a body that no person's measurements make."""
        with self.clock("first poses"):
            search = self.settings, self.tracking.match, self.reporter
            body, fits = start_given(observations, *search, model)
        tracker = PoseTracker(body, observations, self.tracking, self.clock, self.reporter.advance)
        poses = {t: fit.pose for t, fit in fits.items()}
        self._follow(tracker, poses, {t: fit.error for t, fit in fits.items()})
        self._polish(tracker)
        return tracker, _found(tracker, poses)

    def _observations(self, prepared: PreparedSilhouettes, kept: ExitStack) -> ObservationStore:
        work = self.clock, self.reporter
        return kept.enter_context(carved_observations(prepared.observer, prepared.store, *work))

    def _follow(
        self, tracker: PoseTracker, poses: dict[int, Pose], errors: dict[int, float]
    ) -> None:
        """Tracks from the anchor frames, and searches again what went wrong."""
        count = len(tracker.observations)
        self.reporter.stage("tracking", count)
        tracker.begin(poses, errors)
        self.reporter.stage("repair")
        with self.clock("repair"):
            tracker.begin_again()
            tracker.repair(3 + count // 100)
            tracker.mend_jumps()
        self.reporter.stage("limbs")
        tracker.recheck()

    def _polish(self, tracker: PoseTracker) -> None:
        self.reporter.stage("refinement", len(tracker.observations))
        tracker.polish()


def _median_error(tracker: PoseTracker) -> float:
    """Median error of the frames; a frame without a pose has none in common."""
    return float(np.median(np.minimum(tracker.error, 1.0)))


def _found(tracker: PoseTracker, anchors: dict[int, Pose]) -> dict[str, object]:
    """Facts of any body."""
    errors = tracker.error[np.isfinite(tracker.error)]
    return {
        "voxel_size_m": tracker.observations.observer.voxel_size_m,
        "anchor_frames": sorted(anchors),
        "silhouette_error": {"median": float(np.median(errors)) if len(errors) else None},
    }
