"""The body's poses in all frames of a recording: first poses, tracking, proportions, refinement."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.moments import even_moments
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import SHAPE_AXES
from silhouette_core.estimator import Settings
from silhouette_core.motion.body_source import names_result
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.refinement.adaptation import stature_of
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.matching.pose_search import BodyGeometry, PoseFit
from voxelpose.multiview.person.body_choice import Start, adapted, choose_body, start_given
from voxelpose.multiview.person.posterior import is_improbable, is_unusual
from voxelpose.multiview.silhouettes.observation_store import ObservationStore, carved_observations
from voxelpose.multiview.silhouettes.prepared_silhouettes import PreparedSilhouettes
from voxelpose.multiview.silhouettes.static_objects import StaticObjects, find_static_objects
from voxelpose.multiview.tracking.tracking import PoseTracker

REFIT_FRAMES = 12
"""Frames of a recording to which the body is adapted again, and by which tracks are compared."""
_ROUNDS = 2  # in which something that stands beside the person is left out
_Facts = dict[str, object]
Tracked = tuple[PoseTracker, Start]
"""Somebody who was followed, and from which start."""


def refit(tracker: PoseTracker, start: Start) -> None:
    """Adapts the tracker's body again to its poses. A body that stays as it is, is left so."""
    frames = _clear_frames(tracker)
    poses = {t: pose for t in frames if (pose := tracker.poses[t]) is not None}
    again = replace(start, body=tracker.body, poses=poses, unclear={}, errors={})
    tracker.body = adapted(again, frames).body


def spread_errors(tracker: PoseTracker) -> list[float]:
    """Silhouette errors of frames that are spread over the time in which somebody is there."""
    there = tracker.error[tracker.observations.there]
    return there[even_moments(len(there), REFIT_FRAMES)].tolist()


def _clear_frames(tracker: PoseTracker) -> dict[int, FrameObservation]:
    """Frames whose poses explain the silhouettes as well as usual, spread over the recording."""
    posed = np.flatnonzero(np.isfinite(tracker.error))
    usual = float(np.median(tracker.error[posed]))
    clear = np.array([t for t in posed.tolist() if not is_unusual(tracker.error[t], usual)])
    chosen = clear[even_moments(len(clear), REFIT_FRAMES)].tolist()
    return {t: frame for t in chosen if (frame := tracker.observe(t)) is not None}


@dataclass(frozen=True, eq=False)
class TrackWork:
    """Tracking of one recording, of a known body or one that is estimated."""

    settings: Settings
    fps: float
    matching: MatchSettings
    known: BodyModel | None
    clock: StageClock
    reporter: Reporter
    numbers: NDArray[np.int64] | None = None  #: of the frames; None: none is left out.

    def track(
        self, prepared: PreparedSilhouettes, kept: ExitStack
    ) -> tuple[PoseTracker, dict[str, object]]:
        """Poses of all frames, and facts for the summary; `kept` closes what the tracker needs."""
        if self.known is not None and self.known.person is None:
            return self._given(self._observations(prepared, kept), self.known)
        tracker, start, objects = self._person(prepared, kept)
        facts = self.finished(tracker, start)
        if objects is not None:
            pairs = zip(prepared.rig.names, objects.pixels, strict=True)
            shares = {name: round(float(pixels.mean()), 4) for name, pixels in pairs}
            facts |= {"objects_share": shares, "objects_apart": objects.apart}
        return tracker, facts

    def of_anybody(self) -> TrackWork:
        """The same of somebody of whom nothing was told: what was, is one person's of several."""
        return replace(self, settings=self.settings.of_anybody, known=None)

    def finished(self, tracker: PoseTracker, start: Start) -> dict[str, object]:
        """Adapts the body a last time and refines every pose; facts for the summary."""
        self.reporter.stage("proportions")
        with self.clock("proportions"):
            refit(tracker, start)
        self._smooth(tracker)
        names = [axis.name for axis in SHAPE_AXES]
        facts: _Facts = {
            "stature_m": stature_of(tracker.body.model),
            "stature_given": self.settings.stature_m is not None or self.known is not None,
            "sex_template": tracker.body.model.sizes.sex,
            "shape": dict(zip(names, tracker.body.model.shape.round(4).tolist(), strict=True)),
            "objects_share": {},
        }
        return facts | _found(tracker, start.poses)

    def _person(
        self, prepared: PreparedSilhouettes, kept: ExitStack
    ) -> tuple[PoseTracker, Start, StaticObjects | None]:
        """Tracks a person; while improbable, again without what stands beside; keeps the best."""
        tracker, start = self.tracked(self._observations(prepared, kept))
        objects = None
        for _ in range(_ROUNDS):
            wrong = is_improbable(spread_errors(tracker))
            if objects is None and not wrong:
                break
            with self.clock("objects"):
                static = find_static_objects(
                    tracker.body.model,
                    tracker.poses,
                    prepared.store,
                    prepared.observer,
                    behind=wrong,
                )
            if static is None:
                break
            without = kept.enter_context(prepared.without(static.pixels))
            second, other = self.tracked(self._observations(without, kept), objects=True)
            if other.cost_of(spread_errors(second)) >= start.cost_of(spread_errors(tracker)):
                break
            objects, tracker, start = static, second, other
        if objects is not None:
            self.reporter.note(
                "something stands apart from the person all the time: it is left out"
                if objects.apart
                else "something stands beside the person all the time, as a chair does: it is left"
                " out, and what it hides; look at the contact sheet whether it is no part of the"
                " person"
            )
        return tracker, start, objects

    def tracked(
        self, observations: ObservationStore, *, objects: bool = False
    ) -> tuple[PoseTracker, Start]:
        """Tracks the most probable person."""
        settings, known = self.settings, self.known
        with self.clock("first poses"):
            start = choose_body(
                observations,
                settings,
                self.matching,
                self.reporter,
                self.fps,
                known,
                keep_clothes=known is not None and names_result(str(settings.options["body"])),
                objects=objects,
            )
        fits = {t: PoseFit(pose, start.errors[t]) for t, pose in start.poses.items()}
        return self._followed(start.body, observations, fits), start

    def _given(
        self, observations: ObservationStore, model: BodyModel
    ) -> tuple[PoseTracker, dict[str, object]]:
        """As `track`, with a body that no person's measurements make."""
        with self.clock("first poses"):
            body, fits = start_given(
                observations, self.settings, self.matching, self.reporter, model
            )
        tracker = self._followed(body, observations, fits)
        self._smooth(tracker)
        return tracker, _found(tracker, fits)

    def _observations(self, prepared: PreparedSilhouettes, kept: ExitStack) -> ObservationStore:
        observations = carved_observations(
            prepared.observer,
            prepared.store,
            self.clock,
            self.reporter,
            seen=prepared.footage.joints,
        )
        return kept.enter_context(observations)

    def _followed(
        self, body: BodyGeometry, observations: ObservationStore, fits: dict[int, PoseFit]
    ) -> PoseTracker:
        """Tracker that has followed the poses of the anchor frames, and searched more."""
        tracker = PoseTracker(
            body,
            observations,
            self.fps,
            self.matching,
            self.clock,
            self.reporter.advance,
            self.numbers,
        )
        self.reporter.stage("tracking", len(observations))
        tracker.follow(fits.items())
        self._improve(tracker)
        return tracker

    def again(self, tracker: PoseTracker, anchors: Sequence[int]) -> None:
        """Follows somebody again whose silhouettes have changed, also from frames that are searched
        without a prior.
        """
        self._smooth(tracker)
        with self.clock("first poses"):
            tracker.search(anchors)
        self._improve(tracker)

    def _improve(self, tracker: PoseTracker) -> None:
        """Adds candidates where the trajectory is worst, and of arms and legs."""
        self.reporter.stage("repair")
        with self.clock("repair"):
            tracker.search_worst(max(REFIT_FRAMES, len(tracker.observations) // 100))
        self.reporter.stage("limbs")
        tracker.search_limbs()

    def _smooth(self, tracker: PoseTracker) -> None:
        self.reporter.stage("refinement", len(tracker.observations))
        tracker.smooth()


def _found(tracker: PoseTracker, anchors: Iterable[int]) -> dict[str, object]:
    """Facts of any body."""
    errors = tracker.error[np.isfinite(tracker.error)]
    return {
        "voxel_size_m": tracker.observations.observer.voxel_size_m,
        "anchor_frames": sorted(anchors),
        "silhouette_error": {"median": float(np.median(errors)) if len(errors) else None},
    }
