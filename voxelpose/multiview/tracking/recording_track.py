"""The body's poses in all frames of a recording: first poses, tracking, proportions, refinement."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from calib.moments import even_moments
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import SHAPE_AXES
from silhouette_core.estimator import Settings
from silhouette_core.motion.body_source import names_result
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.refinement.adaptation import stature_of
from voxelpose.multiview.person.body_choice import Start, choose_body
from voxelpose.multiview.person.given_body import start_given
from voxelpose.multiview.person.posterior import is_improbable
from voxelpose.multiview.silhouettes.body_evidence import cut_by_body
from voxelpose.multiview.silhouettes.observation_store import ObservationStore, carved_observations
from voxelpose.multiview.silhouettes.prepared_silhouettes import PreparedSilhouettes
from voxelpose.multiview.silhouettes.static_objects import StaticObjects, find_static_objects
from voxelpose.multiview.tracking.body_refit import REFIT_FRAMES, refit, spread_errors
from voxelpose.multiview.tracking.tracking import PoseTracker, PoseTrackerSettings
from voxelpose.multiview.tuning import OFF_LINE

_ROUNDS = 4  # in which something that stands beside the person is left out
_CUTS = 2  # of the silhouettes by the body
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
        tracker, start, objects, shown = self._person(prepared, kept)
        (tracker, start), changed = self._cut_by_body((tracker, start), shown, kept)
        self.reporter.stage("proportions")
        with self.clock("proportions"):
            refit(tracker, start, self.known is None and self.settings.sex == "unknown")
        self._polish(tracker)
        names = [axis.name for axis in SHAPE_AXES]
        facts: _Facts = {
            "stature_m": stature_of(tracker.body.model),
            "stature_given": self.settings.stature_m is not None or self.known is not None,
            "sex_template": tracker.body.model.sizes.sex,
            "shape": dict(zip(names, tracker.body.model.shape.round(4).tolist(), strict=True)),
            "objects_share": {},
            "cut_by_body": changed,
        }
        if objects is not None:
            pairs = zip(prepared.rig.names, objects.pixels, strict=True)
            shares = {name: round(float(pixels.mean()), 4) for name, pixels in pairs}
            facts |= {"objects_share": shares, "objects_apart": objects.apart}
        return tracker, facts | _found(tracker, start.poses)

    def _person(
        self, prepared: PreparedSilhouettes, kept: ExitStack
    ) -> tuple[PoseTracker, Start, StaticObjects | None, PreparedSilhouettes]:
        """Tracks a person; while that is improbable, again without what stands beside, and the more
        probable is taken, with its silhouettes.
        """
        tracker, start = self._tracked(self._observations(prepared, kept))
        objects, shown = None, prepared
        for _ in range(_ROUNDS):
            wrong = is_improbable(spread_errors(tracker))
            if objects is None and not wrong:
                break
            at = tracker.body.model, tracker.poses, prepared.store, prepared.observer
            with self.clock("objects"):
                found = find_static_objects(*at, behind=wrong)
            if found is None:
                break
            without = kept.enter_context(prepared.without(found.pixels))
            again = self._tracked(self._observations(without, kept), objects=True)
            if _cost(*again) >= _cost(tracker, start):
                break
            objects, shown, (tracker, start) = found, without, again
        if objects is not None:
            self.reporter.note(
                "something stands apart from the person all the time: it is left out"
                if objects.apart
                else "something stands beside the person all the time, as a chair does: it is left"
                " out, and what it hides; look at the contact sheet whether it is no part of the"
                " person"
            )
        return tracker, start, objects, shown

    def _cut_by_body(
        self, found: tuple[PoseTracker, Start], prepared: PreparedSilhouettes, kept: ExitStack
    ) -> tuple[tuple[PoseTracker, Start], dict[str, float]]:
        """While a person is improbable, tracks it again in silhouettes cut anew where it was found;
        the more probable is taken. Also what share of them changed, by camera name.
        """
        changed: dict[str, float] = {}
        given = prepared.footage.source.silhouettes_given
        for _ in range(_CUTS if self.settings.background == "refined" and not given else 0):
            tracker, start = found
            if not is_improbable(spread_errors(tracker)):
                break
            at = tracker.body.model, tracker.poses, self.clock, self.reporter
            cut = kept.enter_context(cut_by_body(prepared, *at))
            again = self._tracked(self._observations(cut, kept), objects=start.candidate.objects)
            if _cost(*again) >= _cost(*found):
                break
            found, changed = again, _changed(prepared, cut)
        if changed:
            self.reporter.note(
                "the body explained the silhouettes poorly: they were cut anew where it was found"
            )
        return found, changed

    def _tracked(
        self, observations: ObservationStore, *, objects: bool = False
    ) -> tuple[PoseTracker, Start]:
        """Tracks the most probable person."""
        settings, known = self.settings, self.known
        with self.clock("first poses"):
            keep = known is not None and names_result(str(settings.options["body"]))
            given = self.tracking.match, self.reporter, known, keep, objects
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
            begin_again(tracker)
            tracker.repair(3 + count // 100)
            tracker.mend_jumps()
        self.reporter.stage("limbs")
        tracker.recheck()

    def _polish(self, tracker: PoseTracker) -> None:
        self.reporter.stage("refinement", len(tracker.observations))
        tracker.polish()


def _changed(old: PreparedSilhouettes, new: PreparedSilhouettes) -> dict[str, float]:
    """Share of silhouettes that others do not have in common with them, by camera name."""
    moments = even_moments(len(old.store), REFIT_FRAMES).tolist()
    pairs = (zip(old.store[t], new.store[t], strict=True) for t in moments)
    shares = np.mean(
        [[(a ^ b).sum() / max((a | b).sum(), 1) for a, b in pair] for pair in pairs], axis=0
    )
    return dict(zip(old.rig.names, shares.round(4).tolist(), strict=True))


def _cost(tracker: PoseTracker, start: Start) -> float:
    """Cost of the person that was tracked."""
    return start.cost_of(spread_errors(tracker))


def begin_again(tracker: PoseTracker) -> None:
    """Searches other frames without a prior while the track is improbable, and tracks from those
    that improve.

    What the first poses have in common, like a head in the place of an arm, is carried through the
    whole recording and shows as no rise of the error.
    """
    for t in even_moments(len(tracker.observations), REFIT_FRAMES).tolist():
        improbable = is_improbable(spread_errors(tracker))
        if improbable and tracker.anchor(t, OFF_LINE.again_placements):
            tracker.carry(t)


def _found(tracker: PoseTracker, anchors: dict[int, Pose]) -> dict[str, object]:
    """Facts of any body."""
    errors = tracker.error[np.isfinite(tracker.error)]
    return {
        "voxel_size_m": tracker.observations.observer.voxel_size_m,
        "anchor_frames": sorted(anchors),
        "silhouette_error": {"median": float(np.median(errors)) if len(errors) else None},
    }
