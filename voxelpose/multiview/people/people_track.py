"""Several people followed beside each other: beside pieces of hull first, then beside bodies."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from calib.checks import BoolArray, FloatArray, IntArray
from calib.errors import InputError
from calib.moments import even_moments
from silhouette_core.image.cleanup import dilated
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.scoring.silhouette_error import body_masks
from voxelpose.multiview.people import MOST_PEOPLE
from voxelpose.multiview.people.own_silhouettes import (
    Masks,
    hull_pieces,
    seen_pieces,
    silhouettes_of,
)
from voxelpose.multiview.people.presence import (
    ASKED_HZ,
    HIDDEN_S,
    at_all_times,
    blind_to_people,
    find_people,
    metre_px,
)
from voxelpose.multiview.people.recognition import looks_of, never_at_once, rejoined
from voxelpose.multiview.silhouettes.mask_store import MaskStore
from voxelpose.multiview.silhouettes.observation_store import ObservationStore, carved_observations
from voxelpose.multiview.silhouettes.prepared_silhouettes import PreparedSilhouettes
from voxelpose.multiview.tracking.recording_track import (
    REFIT_FRAMES,
    Facts,
    Tracked,
    TrackWork,
    alternated,
)
from voxelpose.multiview.tracking.tracking import PoseTracker
from voxelpose.multiview.tuning import CARVING, PEOPLE

_TOGETHER = 16  # frames


def people_places(
    prepared: PreparedSilhouettes, people: int | None, clock: StageClock, reporter: Reporter
) -> tuple[FloatArray, FloatArray]:
    """About where everybody is, (N, T, 3) float64, m, in the upright frame; NaN: not there. Then
    the same of things, such as a chair that is carried in. Raises InputError where fewer people
    than asked for are there.

    Args:
        people: their number; None: as many as there are.
    """
    observer, store, times_s = prepared.observer, prepared.store, prepared.times_s
    tenths = np.floor((times_s - times_s[0]) * ASKED_HZ + 1e-6)
    asked = np.diff(tenths, prepend=-1) > 0
    asked[-1] = True
    steps = np.flatnonzero(asked)
    reporter.stage("people", len(steps))

    def frames() -> Iterator[Masks]:
        for t in steps.tolist():
            yield store[t]
            reporter.advance()

    most = [people or _most_at(prepared, steps, float(time_s)) for time_s in times_s[steps]]
    with clock("people"):
        tracks_m, things_m = (
            at_all_times(found_m, times_s[steps], times_s)
            for found_m in find_people(observer, frames(), times_s[steps], most)
        )
        axes_m = _each_person(prepared, tracks_m, people, reporter)[: people or MOST_PEOPLE]
    if people is not None and len(axes_m) < people:
        counted = "nobody is" if not len(axes_m) else f"{len(axes_m)} at most are"
        raise InputError(
            f"{people} people were asked for, and {counted} seen apart: give --people"
            f" {max(len(axes_m), 1)}, or look at the silhouettes with `voxelpose setup`"
        )
    if len(axes_m) > 1 and people is None:
        reporter.note(
            f"{len(axes_m)} people are seen, and each is followed (--people 1 follows only one)"
        )
    middle_m = observer.volume.origin_m[2] + 0.5 * observer.volume.size_m[2]
    places_m, things_m = (
        np.concatenate([found_m, np.full((*found_m.shape[:2], 1), middle_m)], axis=2)
        for found_m in (axes_m, things_m)
    )
    return places_m, things_m


def _most_at(prepared: PreparedSilhouettes, steps: IntArray, time_s: float) -> int:
    """How many people there are at most at a time: as many as the pose network sees together within
    the time for which somebody may be hidden.

    Args:
        steps: frames that are asked for.
    """
    near = steps[np.abs(prepared.times_s[steps] - time_s) <= HIDDEN_S]
    counts = [prepared.footage.people_counted(t) for t in near.tolist()]
    known = [int(count.max()) for count in counts if count is not None]
    return min(MOST_PEOPLE, max(known, default=MOST_PEOPLE)) or 1


def _each_person(
    prepared: PreparedSilhouettes, tracks_m: FloatArray, people: int | None, reporter: Reporter
) -> FloatArray:
    """Where N people stand, (N, T, 2) float64, of K tracks (K, T, 2), since who comes back is the
    same person; those who are longest there first.
    """
    if not len(tracks_m):
        return tracks_m
    looks = None
    if never_at_once(tracks_m).any() and not prepared.footage.source.silhouettes_given:
        looks = looks_of(prepared, tracks_m)
    joined = rejoined(tracks_m, looks, people)
    axes_m = np.stack([np.nansum(tracks_m[members], axis=0) for members in joined])
    axes_m[np.stack([np.isnan(tracks_m[members]).all(axis=0) for members in joined])] = np.nan
    order = np.argsort(np.isnan(axes_m[:, :, 0]).sum(axis=1), kind="stable")
    for number, axis_m in enumerate(axes_m[order], 1):
        for left, back in absences(axis_m):
            reporter.note(
                f"person {number} is away from frame {prepared.numbers[left]} to"
                f" {prepared.numbers[back]}: that who comes back is who left is a guess"
                + ("" if looks is None else " by the colours")
            )
    if never_at_once(axes_m[order]).any():
        reporter.note(
            "people are seen who are never there at once: if they are one who came back, tell how"
            " many there are by --people"
        )
    return axes_m[order]


def absences(places_m: FloatArray) -> list[tuple[int, int]]:
    """The last frame before and the first after each time in which somebody, places (T, D), NaN:
    not there, was away and came back.
    """
    present = np.flatnonzero(np.isfinite(places_m[:, 0]))
    return [(a, b) for a, b in pairwise(present.tolist()) if b > a + 1]


@dataclass(frozen=True, eq=False)
class PeopleTrack:
    """Alternation of N people: where others' bodies are, nothing is known of a person.

    Attributes:
        works: of each alone.
        prepared: silhouettes of everybody.
        places_m: (N, T, 3) float64, about where each is; NaN: not there.
        things_m: (M, T, 3) float64, the same of things.
        resources: closes what the trackers need.
    """

    works: Sequence[TrackWork]
    prepared: PreparedSilhouettes
    places_m: FloatArray
    things_m: FloatArray
    resources: ExitStack

    def track(self) -> list[tuple[PoseTracker, Facts]]:
        """Poses of everybody in all frames, and facts."""
        people = alternated(self)
        facts = [work.finished(one) for work, one in zip(self.works, people, strict=True)]
        trackers = [tracked.tracker for tracked in people]
        unexplained: Facts = {"unexplained_frames": self._unexplained(trackers)}
        return [(one, known | unexplained) for one, known in zip(trackers, facts, strict=True)]

    def first(self) -> list[Tracked]:
        """See `Alternation.first`; beside the others' pieces of hull, which hide more of a person
        than bodies do.
        """
        observed = self._observations(_in_turn(self._hull_pieces_at, self.prepared.store))
        return [work.tracked(seen) for work, seen in zip(self.works, observed, strict=True)]

    def again(self, tracked: list[Tracked]) -> list[Tracked]:
        """See `Alternation.again`; beside the others' bodies, with the bodies as they are."""
        trackers = [one.tracker for one in tracked]
        observed = self._observations(self._drawn_pieces(trackers))
        for work, one, seen in zip(self.works, tracked, observed, strict=True):
            one.tracker.observations = seen
            # Limbs that pieces of hull hid are searched where bodies hide less.
            work.again(one.tracker, [*one.start.errors])
        return tracked

    def _unexplained(self, trackers: Sequence[PoseTracker]) -> float:
        """Share of the frames in which a person, or a thing of that size, is seen beside all."""
        store, observer = self.prepared.store, self.prepared.observer
        scale_px = metre_px(observer)
        window_px = 2 * np.ceil(CARVING.coarse_m * scale_px).astype(int) + 1
        moments = even_moments(len(store), REFIT_FRAMES, margin=0).tolist()
        lefts = []
        for t in moments:
            drawn = [one for tracker in trackers if (one := _drawn(tracker, t, observer.views))]
            left = []
            for c, mask in enumerate(store[t]):
                bodies = np.logical_or.reduce([one[c] for one in drawn] or [np.zeros_like(mask)])
                beside = mask & ~dilated(bodies, int(window_px[c]))
                left.append(np.count_nonzero(beside) / scale_px[c] ** 2 / PEOPLE.seen_m2)
            lefts.append(np.mean(left))
        return float(np.mean(np.array(lefts) > PEOPLE.needed))

    def _observations(self, pieces: Iterator[Sequence[Masks | None]]) -> list[ObservationStore]:
        """Observations of each person among others that are seen where `pieces` says."""
        observer, work, resources = self.prepared.observer, self.works[0], self.resources
        each = silhouettes_of(self.prepared.store, pieces, self.places_m, observer.views)
        each_person = zip(resources.enter_context(each), self._blind, strict=True)
        return [
            resources.enter_context(
                carved_observations(
                    observer, masks, work.clock, work.reporter, blind, other_people=others
                )
            )
            for (masks, others), blind in each_person
        ]

    @cached_property
    def _blind(self) -> BoolArray:
        return blind_to_people(self.prepared, self.places_m)

    def _hull_pieces_at(self, t: int) -> list[Masks | None]:
        """Where a frame's people and things are seen, by the hull about them."""
        axes_m = np.concatenate([self.places_m, self.things_m])[:, t, :2]
        pieces = hull_pieces(self.prepared.store[t], axes_m, self.prepared.observer)
        return seen_pieces(pieces, self.prepared.footage.people_masks(t))

    def _drawn_pieces(self, trackers: Sequence[PoseTracker]) -> Iterator[list[Masks | None]]:
        """Where each frame's people are seen, by their bodies, and things, by the hull."""
        views = self.prepared.observer.views

        def pieces(t: int) -> list[Masks | None]:
            has_objects = np.isfinite(self.things_m[:, t]).any()
            object_pieces = self._hull_pieces_at(t)[len(self.places_m) :] if has_objects else []
            return [_drawn(tracker, t, views) for tracker in trackers] + object_pieces

        return _in_turn(pieces, self.prepared.store)


def _drawn(tracker: PoseTracker, t: int, views: PinholeViews) -> Masks | None:
    """The tracker's body in a frame, (h, w) bool in every camera; None where it is not there."""
    pose, body = tracker.poses[t], tracker.body
    return None if pose is None else body_masks(body.model, pose, views, body.body_volume.backend)


def _in_turn(
    pieces: Callable[[int], list[Masks | None]], store: MaskStore
) -> Iterator[list[Masks | None]]:
    """Pieces of all frames, some of them made side by side."""
    for first in range(0, len(store), _TOGETHER):
        yield from side_by_side(pieces, range(first, min(first + _TOGETHER, len(store))))
