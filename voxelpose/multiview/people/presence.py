"""How many people there are, and where each is over time, by their hull alone.

Wherever two people stand before few cameras, their silhouettes leave pieces of hull that are
nobody's: phantoms. A set of people is right where it is the smallest that explains all silhouettes,
over the whole time and not frame by frame.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from scipy.ndimage import maximum_filter
from scipy.optimize import linear_sum_assignment

from calib.checks import BoolArray, ByteArray, FloatArray, IntArray
from silhouette_core.ranking import rounded
from voxelpose.multiview.carving.footprint import footprint
from voxelpose.multiview.carving.observe import HullObserver
from voxelpose.multiview.silhouettes.prepared_silhouettes import PreparedSilhouettes
from voxelpose.multiview.tuning import CARVING, PEOPLE, PERSON_COST

ASKED_HZ = 10
"""How often it is asked who is where."""
HIDDEN_S = 2
"""So long somebody may be hidden and is still known by the place."""
_REDUCED = 4  # of the images in which it is asked who explains what
_MOST_AXES = 9  # places in a frame that are asked for
_MOST_SETS = 40  # of people in a frame, which are compared over time


@dataclass(frozen=True, eq=False)
class PeopleSets:
    """Sets of people that may be in one frame, the most likely ones."""

    axes_m: FloatArray
    """(n, 2) float64, places where somebody may be, in the world's xy plane, m."""
    upright: BoolArray
    """(n,) bool, whether the hull is as high there as of somebody who sits or stands."""
    members: list[IntArray]  #: K arrays of indices into `axes_m`.
    cost: FloatArray
    """(K,) float64, what each set costs: of the silhouettes, the share of a person in the mean
    camera that it leaves unexplained, and `PEOPLE.needed` for each of its people."""


class PresenceSearch:
    """Asks frame by frame who may be where.

    Args:
        observer: carves the hull of everybody.
    """

    def __init__(self, observer: HullObserver):
        """Prepares reduced cameras."""
        self._observer = observer
        self._cameras = [camera.pinhole(1 / _REDUCED) for camera in observer.views.rig]
        self._person_px = PEOPLE.seen_m2 * (metre_px(observer) / _REDUCED) ** 2

    def sets(
        self, masks: list[BoolArray], most: int, before_m: FloatArray | None = None
    ) -> PeopleSets:
        """Sets of people that silhouettes (h, w) bool of all cameras allow, best first.

        Args:
            most: number of people, at most.
            before_m: (n, 2) float64, axes of the frame before, which are asked for as well: the
                hull of people who stand near to each other is thickest between them.
        """
        hull = self._observer.coarse_hull(masks)
        axes, upright = self._axes(hull, np.empty((0, 2)) if before_m is None else before_m)
        pairs = zip(masks, self._cameras, strict=True)
        seen = [_reduced(mask, camera.size) for mask, camera in pairs]
        explained = [self._explained(hull, axis, seen) for axis in axes]
        members, cost = self._ranked(explained, seen, most)
        return PeopleSets(axes, upright, members, cost)

    def _axes(self, hull: BoolArray, before_m: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Places (n, 2) where the hull is thickest, or where somebody was before, and somebody may
        stand, crouch or sit, and whether (n,) upright.
        """
        grid = self._observer.coarse
        disc = _disc(PERSON_COST.middle_m / grid.voxel_size_m)  # a trunk's
        columns = grid.voxel_size_m**3 * hull.sum(axis=2).astype(np.float32)
        volume_m3 = np.asarray(cv2.filter2D(columns, -1, disc.astype(np.float32), borderType=0))
        highest = volume_m3 >= maximum_filter(volume_m3, footprint=disc)
        x, y, z = grid.axes()
        # Of what is seen of people's feet; where the volume begins is lower.
        floor_m = float(np.quantile(z[hull.nonzero()[2]], 0.01)) if hull.any() else 0.0

        def reaches(height_m: float) -> BoolArray:
            above = hull[:, :, z >= floor_m + height_m].any(axis=2)
            return np.asarray(maximum_filter(above, footprint=disc), np.bool_)

        crouching = reaches(0.5 * PEOPLE.upright_m)
        possible = crouching & (volume_m3 >= CARVING.smallest_m3)
        highest &= possible
        before = np.rint((before_m - grid.origin_m[:2]) / grid.voxel_size_m - 0.5).astype(int)
        apart = ~np.asarray(maximum_filter(highest, footprint=disc), np.bool_)
        highest[*before.T] |= (apart & possible)[*before.T]
        cells = np.argwhere(highest)
        thick = volume_m3[*cells.T]
        cells = cells[np.argsort(rounded(-thick), kind="stable")[:_MOST_AXES]]
        axes = np.stack([x[cells[:, 0]], y[cells[:, 1]]], axis=1)
        return axes, reaches(PEOPLE.upright_m)[*cells.T]

    def _explained(
        self, hull: BoolArray, axis_m: FloatArray, seen: list[BoolArray]
    ) -> list[BoolArray]:
        """Pixels of each reduced silhouette that the hull near an axis (2,) covers."""
        grid = self._observer.coarse
        x, y, _ = grid.axes()
        near = np.hypot(x[:, None] - axis_m[0], y - axis_m[1]) <= PEOPLE.reach_m
        column, pairs = hull & near[:, :, None], zip(self._cameras, seen, strict=True)
        return [footprint(column, grid, camera, mask) for camera, mask in pairs]

    def _ranked(
        self, explained: list[list[BoolArray]], seen: list[BoolArray], most: int
    ) -> tuple[list[IntArray], FloatArray]:
        """The cheapest sets of people at some axes, and their costs."""
        packed = [[np.packbits(mask) for mask in masks] for masks in explained]
        whole = [np.packbits(mask) for mask in seen]
        empty = [np.zeros_like(bits) for bits in whole]
        grown: list[tuple[tuple[int, ...], list[ByteArray]]] = [((), empty)]
        sets = list(grown)
        for _ in range(min(most, len(explained))):
            grown = [
                ((*members, k), [a | b for a, b in zip(union, packed[k], strict=True)])
                for members, union in grown
                for k in range(members[-1] + 1 if members else 0, len(explained))
            ]
            sets += grown
        cost = rounded([self._cost(len(members), union, whole) for members, union in sets])
        order = np.argsort(cost, kind="stable")[:_MOST_SETS]
        return [np.array(sets[k][0], np.int64) for k in order], cost[order]

    def _cost(self, count: int, union: list[ByteArray], whole: list[ByteArray]) -> float:
        left = [
            int(np.bitwise_count(all_ & ~explained).sum()) / area
            for all_, explained, area in zip(whole, union, self._person_px, strict=True)
        ]
        return float(np.mean(left)) + PEOPLE.needed * count


def metre_px(observer: HullObserver) -> FloatArray:
    """Pixels of a metre in the middle of the volume, (C,) float64 of all cameras."""
    middle = observer.volume.origin_m + 0.5 * observer.volume.size_m
    away_m = np.linalg.norm(observer.views.center_m - middle, axis=1)
    focal_px = np.array([camera.matrix[0, 0] for camera in observer.views.rig])
    return np.asarray(focal_px / away_m, float)


def frames_of_nobody(prepared: PreparedSilhouettes) -> frozenset[int]:
    """Frames of the recording in which nobody is seen, neither by the pose network nor, where it
    was not asked, before a background that was estimated from the recording: who stands still is
    part of that.

    In none of the cameras as much of a person is seen as makes somebody, see `PEOPLE.needed`.
    """
    footage, least_px = prepared.footage, PEOPLE.needed * PEOPLE.seen_m2
    if footage.people is None and prepared.estimated.any():
        return frozenset()
    person_px = least_px * metre_px(prepared.observer) ** 2
    empty = (
        number
        for t, number in enumerate(prepared.numbers.tolist())
        if not np.any(footage.people_counted(t))
        and all(
            np.count_nonzero(mask) < area
            for mask, area in zip(prepared.store[t], person_px, strict=True)
        )
    )
    return frozenset(empty)


def blind_to_people(prepared: PreparedSilhouettes, places_m: FloatArray) -> BoolArray:
    """(N, T, C) bool: cameras that tell nothing of each of N people in a frame: as
    `PreparedSilhouettes.blind_cameras`, or the pose network sees nobody at the person's place.

    Args:
        places_m: (N, T, 3) float64, about where each is; NaN: not there.
    """
    blind = np.repeat(prepared.blind_cameras()[None], len(places_m), axis=0)
    cameras = prepared.observer.views.rig.cameras
    _, _, heights_m = prepared.observer.coarse.axes()
    for t in range(blind.shape[1] if prepared.footage.people is not None else 0):
        masks = prepared.footage.people_masks(t)
        for person, place_m in enumerate(places_m[:, t]):
            axis_m = np.column_stack([np.tile(place_m[:2], (len(heights_m), 1)), heights_m])
            for c in np.flatnonzero(prepared.estimated).tolist():
                shows = any(_covers(mask, cameras[c].project(axis_m)[0]) for mask in masks[c])
                blind[person, t, c] |= not shows
    return blind


def _covers(mask: BoolArray, pixels: FloatArray) -> bool:
    """Whether a mask (h, w) has one of some pixels (n, 2), which may be NaN."""
    with np.errstate(invalid="ignore"):
        inside = ((pixels >= 0) & (pixels <= np.array(mask.shape[::-1]) - 1)).all(axis=1)
    column, row = np.rint(pixels[inside]).astype(int).T
    return bool(mask[row, column].any())


def _reduced(mask: BoolArray, size: tuple[int, int]) -> BoolArray:
    """A silhouette in a smaller image, by its nearest pixels."""
    small = cv2.resize(mask.view(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    return np.asarray(small, np.uint8).view(np.bool_)


def _disc(radius_px: float) -> ByteArray:
    """A filled disc, as a structuring element."""
    side = 2 * int(radius_px) + 1
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)), np.uint8)


def likeliest_sets(frames: Sequence[PeopleSets], elapsed_s: FloatArray) -> list[int]:
    """Which set is taken in every frame: the cheapest sequence, by dynamic programming.

    Args:
        frames: T frames' sets.
        elapsed_s: (T - 1,) float64, time between them.
    """
    total, came = frames[0].cost, []
    for before, after, seconds in zip(frames[:-1], frames[1:], elapsed_s, strict=True):
        steps = _step_costs(before, after, float(seconds))
        whole = rounded(total[:, None] + steps)
        came.append(whole.argmin(axis=0))
        total = whole.min(axis=0) + after.cost
    taken = [int(total.argmin())]
    for from_ in reversed(came):
        taken.append(int(from_[taken[-1]]))
    return taken[::-1]


def _step_costs(before: PeopleSets, after: PeopleSets, seconds: float) -> FloatArray:
    """(K, K') float64: what it costs that each set follows upon each."""
    moved = moving_costs(before.axes_m, after.axes_m, seconds)
    costs = np.empty((len(before.members), len(after.members)))
    for i, old in enumerate(before.members):
        for j, new in enumerate(after.members):
            pairs = moved[np.ix_(old, new)]
            rows, columns = linear_sum_assignment(pairs)
            changed = len(old) + len(new) - 2 * len(rows)
            costs[i, j] = pairs[rows, columns].sum() + PEOPLE.appearing * changed
    return costs


def moving_costs(before_m: FloatArray, after_m: FloatArray, seconds: float) -> FloatArray:
    """(n, m) float64: what it costs that somebody goes from each place to each; at most, vanishing
    there and appearing here.
    """
    apart = np.linalg.norm(before_m[:, None] - after_m[None], axis=2)
    sigma = PEOPLE.speed_m_s * seconds + 2 * CARVING.coarse_m
    return np.minimum(0.5 * (apart / sigma) ** 2, 2 * PEOPLE.appearing)


def link_sets(
    frames: Sequence[PeopleSets], taken: Sequence[int], elapsed_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Places (N, T, 2) float64 of N people over time, NaN where one is not there; and of things,
    which are upright at no time: one moment alone is a phantom's.
    """
    tracks: list[FloatArray] = []
    upright: list[list[bool]] = []
    current: dict[int, int] = {}  # person by index of the axis
    for t, (frame, k) in enumerate(zip(frames, taken, strict=True)):
        members = frame.members[k]
        followed: dict[int, int] = {}
        if t and len(members) and current:
            old = [*current]
            moved = moving_costs(
                frames[t - 1].axes_m[old], frame.axes_m[members], float(elapsed_s[t - 1])
            )
            for i, j in zip(*linear_sum_assignment(moved), strict=True):
                if moved[i, j] < 2 * PEOPLE.appearing:
                    followed[int(members[j])] = current[old[i]]
        for axis in members.tolist():
            if axis not in followed:
                followed[axis] = len(tracks)
                tracks.append(np.full((len(frames), 2), np.nan))
                upright.append([])
            tracks[followed[axis]][t] = frame.axes_m[axis]
            upright[followed[axis]].append(bool(frame.upright[axis]))
        current = followed
    axes_m = np.array(tracks).reshape(-1, len(frames), 2)
    long = [flags == [True] or any(map(all, pairwise(flags))) for flags in upright]
    stood = np.array(long, np.bool_)
    return axes_m[stood], axes_m[~stood]


def find_people(
    observer: HullObserver,
    frames: Iterable[list[BoolArray]],
    times_s: FloatArray,
    most: Sequence[int],
) -> tuple[FloatArray, FloatArray]:
    """Where people are in some frames of a recording, and what is as large and nobody.

    Args:
        observer: as of `PresenceSearch`.
        frames: T frames' silhouettes (h, w) bool of all cameras, made when they are asked for.
        times_s: (T,) float64, of these frames.
        most: number of people who are there in each frame, at most.

    Returns:
        Axes (N, T, 2) float64 in the world's xy plane, m, of N people; NaN where one is not there.
        Who comes back after more than `HIDDEN_S` is another one. Then the same of things.
    """
    search, elapsed_s = PresenceSearch(observer), np.diff(times_s)
    sets: list[PeopleSets] = []
    for masks, count in zip(frames, most, strict=True):
        sets.append(search.sets(masks, count, sets[-1].axes_m if sets else None))
    people, objects = link_sets(sets, likeliest_sets(sets, elapsed_s), elapsed_s)
    return join_tracks(people, times_s), join_tracks(objects, times_s)


def join_tracks(tracks: FloatArray, times_s: FloatArray) -> FloatArray:
    """Tracks (N, T, 2) in which somebody who was hidden for a while is one and not two: one that
    begins is the one that ended before where it can have come from there; between, on the way.
    """
    people: list[FloatArray] = []
    for track in sorted(tracks, key=lambda one: int(np.isfinite(one[:, 0]).argmax())):
        first = int(np.isfinite(track[:, 0]).argmax())
        costs = []
        for person in people:
            last = int(np.flatnonzero(np.isfinite(person[:, 0]))[-1])
            away_s = float(times_s[first] - times_s[last])
            cost = moving_costs(person[last : last + 1], track[first : first + 1], away_s)[0, 0]
            costs.append(cost if 0 < away_s <= HIDDEN_S else np.inf)
        best = int(np.argmin(rounded(costs))) if costs else 0
        if not costs or costs[best] >= PEOPLE.appearing:
            people.append(track.copy())
            continue
        person = people[best]
        person[first:] = track[first:]
        present = np.flatnonzero(np.isfinite(person[:, 0]))
        gap = np.arange(present[present < first][-1], first + 1)
        for axis in range(2):
            person[gap, axis] = np.interp(gap, present, person[present, axis])
    return np.stack(people) if people else tracks


def at_all_times(axes_m: FloatArray, asked_s: FloatArray, times_s: FloatArray) -> FloatArray:
    """Axes (N, T, 2) of N people at T times, between those (N, K, 2) at K times; NaN where somebody
    is not there at the times asked before and after.
    """
    interpolated = np.full((len(axes_m), len(times_s), 2), np.nan)
    for track, axes in zip(interpolated, axes_m, strict=True):
        for k in range(2):
            track[:, k] = np.interp(times_s, asked_s, axes[:, k])
    return interpolated
