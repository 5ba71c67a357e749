"""Where people are in the pictures of one camera, followed by the pose network.

Everybody is followed by their own mask and points, the others painted out: before two people who
overlap the network sees either. Who is not known yet is looked for where the picture changes, and
in squares of it, a few in each frame.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np

from calib.checks import ByteArray
from silhouette_core.estimator import Frame
from silhouette_core.image.cleanup import dilated
from silhouette_core.image.pose_network import Crop, PersonSeen, PoseNetwork

MOST = 6  #: People who are followed by a camera.
_TURNS = np.radians([0, 90, -90]).tolist()  # somebody stands, or lies on either side
_EVERY = 4  # frames in which others are looked for once, where somebody is known
_CHANGED = 12  # grey levels by which a place changes: more than noise and flicker do
_SMALL_PX = 160  # shorter side of the pictures by which changes are found
_BESIDE_PX = 9  # of those pictures: what is nearer changes together


@dataclass(eq=False)
class FollowedWindow:
    """Somebody who is followed."""

    number: int  #: of the person, as people were found.
    seen: PersonSeen  #: in the last frame.
    absent: int = 0  #: frames since then.


class PeopleWindows:
    """Follows the people before one camera from frame to frame.

    Args:
        network: of this thread alone.
        most: people to be followed at most.
    """

    def __init__(self, network: PoseNetwork, most: int = MOST) -> None:
        self._network, self._most = network, most
        self._people: list[FollowedWindow] = []
        self._gone: list[FollowedWindow] = []
        self._squares: Iterator[Crop] = iter(())
        self._small: ByteArray | None = None
        self._count = self._frame = self._turn = 0

    def see(self, picture: Frame, skipped: bool = False) -> dict[int, PersonSeen]:
        """People in the next frame (H, W, 3) uint8, BGR, by number; or in one that follows after
        others are skipped, where they may be anywhere.
        """
        first = self._small is None
        for person in self._people:
            seen = self._seen(picture, person)
            person.absent = 0 if seen is not None else person.absent + 1
            person.seen = seen or person.seen
        self._leave()
        changed = self._changed(picture)
        if len(self._people) < self._most:
            present = any(not person.absent for person in self._people)
            self._look_for_others(picture, changed, whole=first or (skipped and not present))
        return {person.number: person.seen for person in self._people if not person.absent}

    def _look(self, picture: Frame, crop: Crop, of: FollowedWindow | None = None) -> PersonSeen:
        """What is seen in a square, of somebody who is known or of anybody, beside the others."""
        others = np.zeros((256, 256), np.bool_)
        for person in self._people:
            if person is not of and not person.absent:
                odds = person.seen.odds_in(crop)
                others |= odds > (0 if of is None else np.maximum(of.seen.odds_in(crop), 0))
        return self._network.look(picture, crop, others)

    def _seen(self, picture: Frame, person: FollowedWindow) -> PersonSeen | None:
        """The person who was seen before, if still there: turned as before; but where that is not
        sure, as it is, else as it is likeliest.
        """
        crop = next_crop(person.seen)
        if crop is None:
            return None
        tried: list[PersonSeen] = []
        for turn in (crop.turn_rad, *_TURNS):
            tried.append(self._look(picture, replace(crop, turn_rad=turn), person))
            if tried[-1].is_sure:
                return tried[-1]
        likeliest = max(tried, key=lambda seen: seen.presence)
        return next((seen for seen in (tried[0], likeliest) if seen.is_there), None)

    def _leave(self) -> None:
        """Forgets who is away for long, and who has the mask of somebody else."""
        self._gone += [one for one in self._people if one.absent > _EVERY]
        self._people = [one for one in self._people if one.absent <= _EVERY]
        apart: list[FollowedWindow] = []
        for person in sorted(self._people, key=lambda one: (one.absent, one.number)):
            if not any(same_person(person.seen, other.seen) for other in apart):
                apart.append(person)
        self._people = sorted(apart, key=lambda one: one.number)

    def _look_for_others(self, picture: Frame, changed: list[Crop], whole: bool) -> None:
        """Looks for more people: they are sure to be some, or the picture changes there."""
        new: list[PersonSeen] = []
        for crop, moves in self._unseen(changed, picture.shape[1::-1], whole):
            seen = self._look(picture, crop)
            for _ in range(2):  # a thing is sure from one square, and not from the next
                near = next_crop(seen)
                if near is not None and seen.is_there:
                    seen = self._look(picture, near)
            known = [*(person.seen for person in self._people), *new]
            if seen.is_sure or (moves and seen.is_there):
                new += [] if any(same_person(seen, one) for one in known) else [seen]
        new.sort(key=lambda seen: -seen.presence * float(seen.visibility.mean()))
        for seen in new[: self._most - len(self._people)]:
            self._people.append(self._known_or_new(seen))

    def _known_or_new(self, seen: PersonSeen) -> FollowedWindow:
        """Somebody who was lost in this place, or somebody new."""
        for person in self._gone[::-1]:
            if same_place(person.seen, seen):
                self._gone.remove(person)
                return FollowedWindow(person.number, seen)
        self._count += 1
        return FollowedWindow(self._count - 1, seen)

    def _unseen(
        self, changed: list[Crop], size: tuple[int, int], whole: bool
    ) -> Iterator[tuple[Crop, bool]]:
        """Squares that are looked at for others in this frame, and whether it is there that the
        picture changes: all over the picture where `whole`, else one after the other where it
        changes, where somebody was lost, and anywhere.
        """
        if whole:
            yield from ((crop, False) for crop in squares(*size))
            return
        self._frame += 1
        if self._people and self._frame % _EVERY:
            return
        self._turn = (self._turn + 1) % len(_TURNS)
        lost = [one for person in self._gone[-1:] if (one := next_crop(person.seen)) is not None]
        for crop in [*lost, *changed[:1]]:
            yield replace(crop, turn_rad=crop.turn_rad + _TURNS[self._turn]), True
        crop = next(self._squares, None)
        if crop is None:
            self._squares = iter([*squares(*size)])
            crop = next(self._squares)
        yield crop, False

    def _changed(self, picture: Frame) -> list[Crop]:
        """Squares about what changed since the last frame beside who is known, largest first."""
        scale = _SMALL_PX / min(picture.shape[:2])
        small = cv2.cvtColor(
            cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA),
            cv2.COLOR_BGR2GRAY,
        )
        before, self._small = self._small, np.asarray(small, np.uint8)
        if before is None:
            return []
        changed = cv2.absdiff(small, before) > _CHANGED
        for person in self._people:
            if not person.absent:
                known = person.seen.odds(small.shape[1::-1], scale) > 0
                changed &= ~dilated(known, _BESIDE_PX)
        grown = cv2.dilate(changed.view(np.uint8), np.ones((_BESIDE_PX, _BESIDE_PX), np.uint8))
        _, _, boxes, _ = cv2.connectedComponentsWithStats(grown)
        large = [box for box in boxes[1:] if box[3] > _SMALL_PX / 8]
        large.sort(key=lambda box: -int(box[cv2.CC_STAT_AREA]))
        return [
            Crop.around(np.array([[x, y], [x + w, y + h]]) / scale)
            for x, y, w, h, _ in large[: self._most]
        ]


def next_crop(seen: PersonSeen) -> Crop | None:
    """The square about somebody who is seen, turned as they are; None where there is no mask."""
    outline = seen.outline_px
    if outline is None:
        return None
    up = seen.circle_px[1] - seen.circle_px[0]
    turn = float(np.arctan2(up[0], -up[1]))
    cos, sin = np.cos(turn), np.sin(turn)
    upright = np.array([[cos, -sin], [sin, cos]])  # picture from upright
    points = np.concatenate([outline, seen.points_px[seen.visibility > 0.5]]) @ upright
    low, high = points.min(axis=0), points.max(axis=0)
    x, y = (upright @ ((low + high) / 2)).tolist()
    return Crop.about(x, y, float((high - low).max()), turn)


def same_person(one: PersonSeen, other: PersonSeen) -> bool:
    """Whether two are the same person: by the overlap of their masks."""
    a, b = one.logits > 0, other.odds_in(one.crop) > 0
    return bool(2 * (a & b).sum() > min(a.sum(), b.sum()))


def same_place(one: PersonSeen, other: PersonSeen) -> bool:
    """Whether two are seen in the same place: by the overlap of their boxes."""
    a, b = one.box_px, other.box_px
    if a is None or b is None:
        return False
    common = np.prod(np.maximum(np.minimum(a[1], b[1]) - np.maximum(a[0], b[0]), 0))
    return bool(2 * common > min(np.prod(a[1] - a[0]), np.prod(b[1] - b[0])))


def squares(width: int, height: int) -> Iterator[Crop]:
    """Squares over a picture, the largest first, so close that a person is whole in one of them."""
    for share in (1.0, 2**-0.5, 0.5):  # of the picture's height; the first, of its longer side
        side = max(width, height) if share == 1 else share * height
        x, y = (
            np.linspace(
                min(side, length) / 2,
                max(length - side / 2, length / 2),
                max(int(np.ceil(2 * (length / side - 1))), 0) + 1,
            )
            for length in (width, height)
        )
        for turn in _TURNS if share == 1 else (0.0,):
            yield from (Crop(left, top, side, turn) for top in y.tolist() for left in x.tolist())
