"""Several people followed beside each other: each alone first, then with the others drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.read_ahead import side_by_side
from silhouette_core.scoring.silhouette_error import body_masks
from voxelpose.multiview.people import MOST_PEOPLE
from voxelpose.multiview.people.own_silhouettes import Masks, hull_pieces, silhouettes_of
from voxelpose.multiview.people.presence import at_all_times, find_people
from voxelpose.multiview.silhouettes.mask_store import MaskStore
from voxelpose.multiview.silhouettes.observation_store import (
    ObservationStore,
    OtherPeople,
    carved_observations,
)
from voxelpose.multiview.silhouettes.prepared_silhouettes import PreparedSilhouettes
from voxelpose.multiview.tracking.recording_track import TrackWork
from voxelpose.multiview.tracking.tracking import PoseTracker

_ROUNDS = 2  # in which everybody is followed again beside the others as they were found
_TOGETHER = 16  # frames
_ASKED_HZ = 10  # how often it is asked who is where


def people_places(
    prepared: PreparedSilhouettes, people: int | None, clock: StageClock, reporter: Reporter
) -> NDArray[np.float64]:
    """About where everybody is, (N, T, 3) float64, m, in the upright frame; NaN: not there.

    Args:
        people: their number; None: as many as there are.

    Raises:
        InputError: fewer people than asked for are there.
    """
    observer, store, times_s = prepared.observer, prepared.store, prepared.times_s
    tenths = np.floor((times_s - times_s[0]) * _ASKED_HZ + 1e-6)
    asked = np.diff(tenths, prepend=-1) > 0
    asked[-1] = True
    steps = np.flatnonzero(asked)
    reporter.stage("people", len(steps))

    def frames() -> Iterator[Masks]:
        for t in steps.tolist():
            yield store[t]
            reporter.advance()

    most = MOST_PEOPLE if people is None else people
    with clock("people"):
        axes_m = find_people(observer, frames(), times_s[steps], most)
        axes_m = at_all_times(axes_m, times_s[steps], times_s)
    if people is not None and len(axes_m) < people:
        found = "nobody is" if not len(axes_m) else f"{len(axes_m)} at most are"
        raise InputError(
            f"{people} people were asked for, and {found} seen apart: give --people"
            f" {max(len(axes_m), 1)}, or look at the silhouettes with `voxelpose setup`"
        )
    if len(axes_m) > 1 and people is None:
        reporter.note(
            f"{len(axes_m)} people are seen, and each is followed (--people 1 follows only one)"
        )
    middle_m = observer.volume.origin_m[2] + 0.5 * observer.volume.size_m[2]
    return np.concatenate([axes_m, np.full((*axes_m.shape[:2], 1), middle_m)], axis=2)


@dataclass(frozen=True, eq=False)
class PeopleTrack:
    """Tracking of N people of one recording.

    Attributes:
        work: of each alone.
        prepared: silhouettes of everybody.
        places_m: (N, T, 3) float64, about where each is; NaN: not there.
    """

    work: TrackWork
    prepared: PreparedSilhouettes
    places_m: NDArray[np.float64]

    def track(self, kept: ExitStack) -> list[tuple[PoseTracker, dict[str, object]]]:
        """Poses of everybody in all frames, and facts; `kept` closes what the trackers need."""
        stack = kept.enter_context(ExitStack())
        pieces = self._hull_pieces()
        found = [
            self.work.tracked(beside) for beside in self._observations(pieces, stack, bodies=False)
        ]
        for _ in range(_ROUNDS):
            trackers = [tracker for tracker, _ in found]
            before, stack = stack, kept.enter_context(ExitStack())
            observations = self._observations(self._drawn_pieces(trackers), stack, bodies=True)
            for tracker, beside in zip(trackers, observations, strict=True):
                tracker.observations = beside
                self.work.again(tracker)
            before.close()
        return [(tracker, self.work.finished(tracker, start)) for tracker, start in found]

    def _observations(
        self, pieces: Iterator[Sequence[Masks | None]], kept: ExitStack, *, bodies: bool
    ) -> list[ObservationStore]:
        """Observations of each person among others that are seen where `pieces` says."""
        prepared, work = self.prepared, self.work
        views, count = prepared.observer.views, len(self.places_m)
        at = prepared.store, pieces, count, views
        pairs = kept.enter_context(silhouettes_of(*at, bodies=bodies))
        told = work.clock, work.reporter
        return [
            kept.enter_context(
                carved_observations(
                    prepared.observer, own, *told, OtherPeople(unknown, self.places_m[k])
                )
            )
            for k, (own, unknown) in enumerate(pairs)
        ]

    def _hull_pieces(self) -> Iterator[list[Masks | None]]:
        """Where each frame's people are seen, by the hull about them."""
        store = self.prepared.store
        axes_m = self.places_m[:, :, :2]

        def pieces(t: int) -> list[Masks | None]:
            return hull_pieces(store[t], axes_m[:, t], self.prepared.observer)

        return _in_turn(pieces, store)

    def _drawn_pieces(self, trackers: Sequence[PoseTracker]) -> Iterator[list[Masks | None]]:
        """Where each frame's people are seen, by their bodies."""
        store, views = self.prepared.store, self.prepared.observer.views

        def pieces(t: int) -> list[Masks | None]:
            poses = [(tracker.body.model, tracker.poses[t]) for tracker in trackers]
            return [pose and body_masks(model, pose, views) for model, pose in poses]

        return _in_turn(pieces, store)


def _in_turn(
    pieces: Callable[[int], list[Masks | None]], store: MaskStore
) -> Iterator[list[Masks | None]]:
    """Pieces of all frames, some of them made side by side."""
    for first in range(0, len(store), _TOGETHER):
        yield from side_by_side(pieces, range(first, min(first + _TOGETHER, len(store))))
