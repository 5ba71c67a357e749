"""Gait events, and spatio-temporal values of walking over the ground.

A foot's contact and its off are turning points of its distance ahead of the pelvis. They are
called walking only where people walk: contacts and offs of both feet follow one another as they do
in walking, each stride goes farther than its own footprint, the person faces where the pelvis goes,
the standing foot stands, steps are about as long in time, and nobody is as fast as people run. So
who stands, jumps, runs, turns on the spot, steps sideways or walks on a treadmill has no gait.

Source: Zeni, Richards and Higginson, "Two simple methods for determining gait events during
treadmill and overground walking using kinematic data" (Gait and Posture 2008), the method by
coordinates. Theirs are markers on heel, toe and sacrum; here they are the rearmost point of the
heel, the joint of the toes and the pelvis' joint of the body model.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.constants import g
from scipy.signal import find_peaks

from calib.checks import FloatArray
from silhouette_core.motion.gait_values import SIDES, Gait, Side, Step, Stride
from silhouette_core.motion.smoothing import runs_of

if TYPE_CHECKING:
    from silhouette_core.body.model import BodyModel
    from silhouette_core.motion.motion import Motion

# Contacts that make a bout of walking: a stride of either foot.
_LEAST_CONTACTS = 4


@dataclass(frozen=True, eq=False)
class WalkerPoints:
    """What gait is read from, in an upright frame (z up), metres, without gaps in time."""

    time_s: FloatArray  #: (T,) float64, increasing, seconds.
    pelvis_m: FloatArray  #: (T, 3) float64.
    ahead: FloatArray  #: (T, 2) float64, unit, where the pelvis faces, seen from above.
    heels_m: FloatArray  #: (T, 2, 3) float64, left and right.
    toes_m: FloatArray  #: (T, 2, 3) float64, left and right.


class _Event(NamedTuple):
    time_s: float
    side: int  # 0 left, 1 right
    contact: bool  # else off

    def is_followed_by(self, other: _Event) -> bool:
        """Whether walking goes on so: contact, other foot's off, its contact, this one's off."""
        return other.contact != self.contact and (other.side == self.side) != self.contact


class _Bout(NamedTuple):
    points: WalkerPoints
    events: list[_Event]
    placed: list[FloatArray]  # (2,) m, of the foot of each contact

    @property
    def contacts(self) -> list[_Event]:
        return [event for event in self.events if event.contact]


def find_gait(motion: Motion) -> Gait | None:
    """Gait of a person's motion; None where nobody walks over the ground for a stride of either
    foot. Gaps between frames interrupt it.
    """
    motion = motion.upright()
    bouts: list[_Bout] = []
    if len(motion):
        points = walker_points(motion)
        for run in runs_of(motion.frames):
            bouts += _bouts(WalkerPoints(*(array[run] for array in vars(points).values())))
    return _gait_of(bouts)


def walker_points(motion: Motion) -> WalkerPoints:
    """Points of an upright motion of a person, whose body gives heels and toes."""
    rotation, origin = motion.parts()
    part = {name: number for number, name in enumerate(motion.model.names)}
    feet, toes = ([part[f"{side}_{name}"] for side in SIDES] for name in ("foot", "toes"))
    local = np.array([_heel(motion.model, foot) - motion.model.joints_m[foot] for foot in feet])
    heels = origin[:, feet] + np.einsum("tsij,sj->tsi", rotation[:, feet], local)
    ahead = -rotation[:, part["pelvis"], :2, 1]  # bodies at rest face -y
    ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
    return WalkerPoints(motion.time_s, origin[:, part["pelvis"]], ahead, heels, origin[:, toes])


def _heel(model: BodyModel, foot: int) -> FloatArray:
    """The rearmost vertex (3,) of a foot's part at rest, below the ankle, m."""
    sole = np.unique(model.faces[model.face_part == foot])
    vertices = model.vertices_m[sole]
    below = vertices[vertices[:, 2] < model.joints_m[foot, 2]]
    return below[np.argmax(below[:, 1])]


def foot_events(points: WalkerPoints, least_m: float) -> tuple[list[FloatArray], list[FloatArray]]:
    r"""Times, s, of contacts and of offs of the left and the right foot, walking or not.

    .. math::

        t_{\mathrm{contact}} = \arg\max_t\, (h(t) - p(t)) \cdot d(t), \qquad
        t_{\mathrm{off}} = \arg\min_t\, (f(t) - p(t)) \cdot d(t)

    with heel :math:`h`, toe :math:`f`, pelvis :math:`p`, and the direction :math:`d` in which the
    pelvis goes in the second around; each a local extremum, refined by a parabola.

    Args:
        least_m: how far the distance changes on either side of an extremum.

    Source: Zeni, Richards and Higginson, eq. (1) and (2), where d is an axis of the laboratory.
    """
    direction = _directions(points)[:, None]

    def turns(feet_m: FloatArray, sign: int) -> list[FloatArray]:
        distances = sign * ((feet_m - points.pelvis_m[:, None])[..., :2] * direction).sum(axis=2)
        return [_peak_times(curve, points.time_s, least_m) for curve in distances.T]

    return turns(points.heels_m, 1), turns(points.toes_m, -1)


def _directions(points: WalkerPoints) -> FloatArray:
    """Unit vectors (T, 2) in which the pelvis goes in the second around, about a stride."""
    time, path = points.time_s, points.pelvis_m[:, :2]
    ends = [
        np.column_stack([np.interp(time + half / 2, time, axis) for axis in path.T])
        for half in (-1, 1)
    ]
    way = ends[1] - ends[0]
    return way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)


def _peak_times(curve: FloatArray, time_s: FloatArray, least: float) -> FloatArray:
    peaks, _ = find_peaks(curve, prominence=least)
    before, middle, after = curve[peaks - 1], curve[peaks], curve[peaks + 1]
    bend = before - 2 * middle + after
    offset = np.where(bend < 0, (before - after) / np.where(bend < 0, 2 * bend, 1), 0)
    return np.interp(peaks + offset, np.arange(len(curve)), time_s)


def _bouts(points: WalkerPoints) -> list[_Bout]:
    """Walking within points without gaps."""
    if len(points.time_s) < 3:
        return []
    foot_m = float(np.median(np.linalg.norm(points.toes_m - points.heels_m, axis=2)))
    # A stride as long as the foot moves it by more than half of that against the pelvis.
    contacts, offs = foot_events(points, foot_m / 2)
    events = [
        _Event(time, side, contact)
        for contact, times in ((True, contacts), (False, offs))
        for side in (0, 1)
        for time in times[side].tolist()
    ]
    events.sort()
    bouts = []
    for group in _chains(events):
        bout = _Bout(points, group, _placements(points, group))
        for first, last in _walked(bout, foot_m):
            steps = [one for one in group if first.time_s <= one.time_s <= last.time_s]
            bouts.append(_Bout(points, steps, _placements(points, steps)))
    return bouts


def _chains(events: Sequence[_Event]) -> Iterator[list[_Event]]:
    """Parts of a sequence of events that are in the order of walking, from contact to contact."""
    chain: list[_Event] = []
    for event in events:
        if chain and not chain[-1].is_followed_by(event):
            yield chain
            chain = []
        chain.append(event)
    yield chain


def _placements(points: WalkerPoints, events: Sequence[_Event]) -> list[FloatArray]:
    """Where the heel of each contact stands, (2,) m: where it is slowest until the next contact."""
    placed, contacts = [], [event for event in events if event.contact]
    longest = max((b.time_s - a.time_s for a, b in pairwise(contacts)), default=0.0)
    for k, (time, side, _) in enumerate(contacts):
        until = contacts[k + 1].time_s if k + 1 < len(contacts) else time + longest
        first, last = np.searchsorted(points.time_s, (time, until), "right").tolist()
        first = min(first, len(points.time_s) - 2)
        heel = points.heels_m[first : max(last, first + 2), side, :2]
        speed = np.linalg.norm(np.gradient(heel, axis=0), axis=1)
        placed.append(heel[speed <= np.median(speed)].mean(axis=0))
    return placed


def _walked(bout: _Bout, foot_m: float) -> list[tuple[_Event, _Event]]:
    """First and last contact of pieces of a bout all of whose strides are walked."""
    contacts, pieces, first = bout.contacts, [], 0
    good = [_is_walked(bout, k, foot_m) for k in range(len(contacts) - 2)]
    for k in range(len(good) + 1):
        if k == len(good) or not good[k]:
            # Strides first to k - 1 end with contact k + 1.
            if k + 2 - first >= _LEAST_CONTACTS:
                pieces.append((contacts[first], contacts[k + 1]))
            first = k + 1
    return pieces


def _is_walked(bout: _Bout, number: int, foot_m: float) -> bool:
    """Whether the stride from a contact to the foot's next one is a walker's."""
    points, contacts = bout.points, bout.contacts[number : number + 3]
    stride = bout.placed[number + 2] - bout.placed[number]
    length = float(np.linalg.norm(stride))
    if length < foot_m:
        return False
    along, across = stride / length, np.array([-stride[1], stride[0]]) / length
    first, middle, last = np.searchsorted(points.time_s, [one.time_s for one in contacts]).tolist()
    last = min(last, len(points.time_s) - 1)
    ahead = points.ahead[first : last + 1].mean(axis=0)
    halfway, way = (points.pelvis_m[[middle, last], :2] - points.pelvis_m[first, :2]) @ along
    stood = points.toes_m[[first, middle], contacts[0].side, :2]
    times = np.diff([one.time_s for one in contacts])
    # People run from half of the speed at which, squared, an inverted pendulum takes off: at a
    # Froude number of 1/2 (Alexander, Physiological Reviews 1989).
    leg_m = float(np.median(points.pelvis_m[:, 2] - points.heels_m[..., 2].min(axis=1)))
    return bool(
        way > foot_m
        and ahead @ along > abs(ahead @ across)
        and np.linalg.norm(stood[1] - stood[0]) < halfway
        and 2 * (length / times.sum()) ** 2 < g * leg_m
        and times.max() < 2 * times.min()
    )


def _gait_of(bouts: Sequence[_Bout]) -> Gait | None:
    if not bouts:
        return None
    events = [event for bout in bouts for event in bout.events]

    def times(contact: bool) -> dict[Side, tuple[float, ...]]:
        chosen = [event for event in events if event.contact == contact]
        return {
            side: tuple(event.time_s for event in chosen if event.side == number)
            for number, side in enumerate(SIDES)
        }

    seconds = sum(bout.events[-1].time_s - bout.events[0].time_s for bout in bouts)
    steps = [step for bout in bouts for step in _steps(bout)]
    return Gait(
        times(True),
        times(False),
        tuple(stride for bout in bouts for stride in _strides(bout)),
        tuple(steps),
        60 * len(steps) / seconds,
        sum(map(_way_m, bouts)) / seconds,
    )


def _way_m(bout: _Bout) -> float:
    """How far the pelvis goes from the first contact to the last one, along its way."""
    times = np.array([event.time_s for event in bout.contacts])
    path = bout.points.pelvis_m[:, :2]
    points = np.column_stack([np.interp(times, bout.points.time_s, axis) for axis in path.T])
    # Chords of strides, since the pelvis sways from step to step.
    chords = np.linalg.norm(points[2:] - points[:-2], axis=1) / 2
    ends = np.linalg.norm(points[[1, -1]] - points[[0, -2]], axis=1) / 2
    return float(chords.sum() + ends.sum())


def _strides(bout: _Bout) -> Iterator[Stride]:
    # Contact, the other foot's off, its contact, the foot's off, its next contact: as `_chains`.
    for k in range(0, len(bout.events) - 4, 2):
        start, other_off, other, off, end = (one.time_s for one in bout.events[k : k + 5])
        length = float(np.linalg.norm(bout.placed[k // 2 + 2] - bout.placed[k // 2]))
        both = other_off - start + off - other
        yield Stride(SIDES[bout.events[k].side], start, off, end, length, both)


def _steps(bout: _Bout) -> Iterator[Step]:
    placed = bout.placed
    for k, contact in enumerate(bout.contacts[1:], start=1):
        whole = k + 1 < len(placed)  # whether the other foot's next contact is known
        chord = placed[k + 1] - placed[k - 1] if whole else placed[k] - placed[k - 2]
        along = chord / np.linalg.norm(chord)
        x, y = placed[k] - placed[k - 1]
        # The left of `along` is a left foot's own side.
        aside = (along[0] * y - along[1] * x) * (1 if contact.side == 0 else -1)
        yield Step(SIDES[contact.side], float(along @ (x, y)), float(aside) if whole else None)
