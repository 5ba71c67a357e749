"""The body's poses in all frames of a recording: first poses, tracking, proportions, refinement."""

from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from calib.checks import IntArray
from calib.moments import even_moments
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import SHAPE_AXES
from silhouette_core.estimator import Settings
from silhouette_core.motion.body_source import names_result
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.refinement.adaptation import stature_of
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.person.body_choice import Start, adapted, choose_body, start_given
from voxelpose.multiview.person.posterior import is_improbable, is_unusual
from voxelpose.multiview.proposers.pose_search import BodyGeometry, PoseFit
from voxelpose.multiview.silhouettes.observation_store import ObservationStore, carved_observations
from voxelpose.multiview.silhouettes.prepared_silhouettes import PreparedSilhouettes
from voxelpose.multiview.silhouettes.static_objects import StaticObjects, find_static_objects
from voxelpose.multiview.tracking.tracking import PoseTracker

REFIT_FRAMES = 12
"""Frames of a recording to which the body is adapted again, and by which tracks are compared."""
_ROUNDS = 2  # of silhouettes given the bodies, and of bodies and poses given those
Facts = dict[str, object]


@dataclass(frozen=True, eq=False)
class Tracked:
    """Somebody who was followed."""

    tracker: PoseTracker
    start: Start  #: the body and the first poses.
    objects: StaticObjects | None = None  #: what was left out of the silhouettes.

    @property
    def cost(self) -> float:
        """Negative log-probability of the body by errors that are spread over the recording."""
        return self.start.cost_of(spread_errors(self.tracker))


class Alternation(Protocol):
    """Silhouettes given bodies and poses, and bodies and poses given silhouettes."""

    def first(self) -> list[Tracked]:
        """Everybody followed while nobody's body is known."""
        ...

    def again(self, tracked: list[Tracked]) -> list[Tracked] | None:
        """Everybody followed in the silhouettes that the bodies leave; None: no better."""
        ...


def alternated(alternation: Alternation) -> list[Tracked]:
    """Everybody followed, in silhouettes that the bodies have changed twice at most."""
    tracked = alternation.first()
    for _ in range(_ROUNDS):
        repeated = alternation.again(tracked)
        if repeated is None:
            break
        tracked = repeated
    return tracked


def refit(tracker: PoseTracker, start: Start) -> None:
    """Adapts the tracker's body again to its poses. A body that stays as it is, is left so."""
    frames = _clear_frames(tracker)
    poses = {t: pose for t in frames if (pose := tracker.poses[t]) is not None}
    choice = replace(start, body=tracker.body, poses=poses, unclear={}, errors={})
    tracker.body = adapted(choice, frames).body


def spread_errors(tracker: PoseTracker) -> list[float]:
    """Silhouette errors of frames that are spread over the time in which somebody is there."""
    errors = tracker.error[tracker.observations.there]
    return errors[even_moments(len(errors), REFIT_FRAMES)].tolist()


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
    numbers: IntArray | None = None  #: of the frames; None: none is left out.

    def of_person(self, number: int) -> "TrackWork":
        """The same of one of several people, of whom nothing is known but what `people` tells."""
        return replace(self, settings=self.settings.of_person(number), known=None)

    def finished(self, tracked: Tracked) -> Facts:
        """Adapts the body a last time and refines every pose; facts for the summary."""
        tracker, start = tracked.tracker, tracked.start
        self.reporter.stage("proportions")
        with self.clock("proportions"):
            refit(tracker, start)
        self._smooth(tracker)
        names = [axis.name for axis in SHAPE_AXES]
        facts: Facts = {
            "stature_m": stature_of(tracker.body.model),
            "stature_given": self.settings.stature_m is not None or self.known is not None,
            "sex_template": tracker.body.model.sizes.sex,
            "shape": dict(zip(names, tracker.body.model.shape.round(4).tolist(), strict=True)),
            "objects_share": {},
        }
        return facts | _found(tracker, start.poses)

    def tracked(
        self, observations: ObservationStore, objects: StaticObjects | None = None
    ) -> Tracked:
        """Tracks the most probable person, in silhouettes without some objects."""
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
                objects=objects is not None,
            )
        fits = {t: PoseFit(pose, start.errors[t]) for t, pose in start.poses.items()}
        return Tracked(self._followed(start.body, observations, fits), start, objects)

    def given(self, observations: ObservationStore, model: BodyModel) -> tuple[PoseTracker, Facts]:
        """Poses of all frames of a body that no person's measurements make, and facts."""
        with self.clock("first poses"):
            body, fits = start_given(
                observations, self.settings, self.matching, self.reporter, model
            )
        tracker = self._followed(body, observations, fits)
        self._smooth(tracker)
        return tracker, _found(tracker, fits)

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
            self.settings.targets,
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
        tracker.reach_targets()

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


@dataclass(frozen=True, eq=False)
class OnePerson:
    """Alternation of one person: what stands beside the body all the time is left out."""

    work: TrackWork
    prepared: PreparedSilhouettes
    resources: ExitStack  #: closes what the trackers need.

    def first(self) -> list[Tracked]:
        """See `Alternation.first`."""
        return [self.work.tracked(self.observations(self.prepared))]

    def again(self, tracked: list[Tracked]) -> list[Tracked] | None:
        """See `Alternation.again`; while improbable, or to find the rest of what stands there."""
        (last,) = tracked
        wrong = is_improbable(spread_errors(last.tracker))
        if last.objects is None and not wrong:
            return None
        prepared = self.prepared
        with self.work.clock("objects"):
            static = find_static_objects(
                last.tracker.body.model,
                last.tracker.poses,
                prepared.store,
                prepared.observer,
                behind=wrong,
            )
        if static is None:
            return None
        without = self.resources.enter_context(prepared.without(static.pixels))
        second = self.work.tracked(self.observations(without), static)
        return [second] if second.cost < last.cost else None

    def track(self) -> tuple[PoseTracker, Facts]:
        """Poses of all frames, and facts for the summary."""
        known = self.work.known
        if known is not None and known.person is None:
            return self.work.given(self.observations(self.prepared), known)
        (tracked,) = alternated(self)
        facts, objects = self.work.finished(tracked), tracked.objects
        if objects is not None:
            self.work.reporter.note(
                "something stands apart from the person all the time: it is left out"
                if objects.apart
                else "something stands beside the person all the time, as a chair does: it is left"
                " out, and what it hides; look at the contact sheet whether it is no part of the"
                " person"
            )
            pairs = zip(self.prepared.rig.names, objects.pixels, strict=True)
            shares = {name: round(float(pixels.mean()), 4) for name, pixels in pairs}
            facts |= {"objects_share": shares, "objects_apart": objects.apart}
        return tracked.tracker, facts

    def observations(self, prepared: PreparedSilhouettes) -> ObservationStore:
        """Hulls of all frames, carved."""
        carved = carved_observations(
            prepared.observer,
            prepared.store,
            self.work.clock,
            self.work.reporter,
            prepared.blind_cameras(),
            prepared.footage.joints,
        )
        return self.resources.enter_context(carved)
