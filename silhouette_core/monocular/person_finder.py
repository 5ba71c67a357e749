"""Whose silhouette is whose before one camera: one person's, or one of several people's.

People whose silhouettes stay apart are found each. Where two have one silhouette, it is theirs whom
the pose network sees in each part of it; without the network, neither is found.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from calib.camera import Camera
from calib.checks import BoolArray, FloatArray
from calib.components import MaskComponents, label_components
from silhouette_core.estimator import Frame
from silhouette_core.image.cleanup import bounding_box
from silhouette_core.image.head_colours import ColourCrop, coarse_histogram, unlikeness
from silhouette_core.image.silhouettes import UndistortedView
from silhouette_core.monocular.person import LEAST_PX, Person, find_person, slenderness
from silhouette_core.monocular.tuning import PERSON
from silhouette_core.ranking import rounded

LONG_SIDE_PX = 960
_MOST = 2  # what it costs that a silhouette is somebody's: 1 by its place, 1 by its colours
Mask = BoolArray
Averaged = TypeVar("Averaged", float, FloatArray)


class PersonFinder:
    """Finds the person in one frame after the other.

    Args:
        coloured: whether the person's colours are kept.
    """

    def __init__(self, camera: Camera, coloured: bool):
        self._lens, self._coloured = UndistortedView.from_camera(camera, LONG_SIDE_PX), coloured
        self._near_px: FloatArray | None = None
        self._usual_px: float | None = None

    def find(self, picture: Frame, silhouette: Mask, people: Sequence[Mask] = ()) -> Person | None:
        """Person in a frame (H, W, 3) with its silhouette (h, w), and where the pose network sees
        each person, (h, w), all as recorded.
        """
        apart = [self._lens.undistort(one) for one in people]
        return self.among(picture, self._lens.undistort(silhouette), apart)

    def among(self, picture: Frame, mask: Mask, people: Sequence[Mask]) -> Person | None:
        """Person in a frame (H, W, 3) as recorded, among what may be it, (h, w), undistorted, as
        are those whom the network sees: of several, the others are nobody.
        """
        for other in sorted(people, key=self._away)[1:]:
            mask = mask & ~other
        person = find_person(mask, self._near_px, self._usual_px)
        if person is None:
            return None
        if self._coloured:
            person = replace(person, colours=_colours(self._lens, picture, person.mask))
        moments = cv2.moments(person.mask.view(np.uint8), binaryImage=True)
        area, usual = moments["m00"], self._usual_px
        self._usual_px = area if usual is None else _mixed(usual, area)
        self._near_px = np.array([moments["m10"], moments["m01"]]) / area
        return person

    def _away(self, mask: Mask) -> float:
        """How far a mask (h, w) is from where the person was last; at first, how small it is."""
        moments = cv2.moments(mask.view(np.uint8), binaryImage=True)
        if self._near_px is None:
            return -moments["m00"]
        centre_px = np.array([moments["m10"], moments["m01"]]) / max(moments["m00"], 1)
        return float(np.linalg.norm(centre_px - self._near_px))


@dataclass(eq=False)
class FollowedPerson:
    """What is known of one of several people from the frames so far."""

    first: int  #: number of frames before the first.
    near_px: FloatArray  #: (2,) where the silhouette was, or may be.
    speed_px: FloatArray  #: (2,) by which it moves in a frame.
    usual_px: float  #: its area.
    looks: FloatArray | None  #: (n,) coarse histogram of the colours; None: they are not known.
    box_px: FloatArray  #: (2, 2) corners of the box about it.
    came_from: int | None  #: Number of a person in whose silhouette this one was before.
    seen: float = 0.0  #: frames in which the silhouette was apart, each by how slender it was.

    @classmethod
    def begun(cls, frame: int, piece: "_Piece", host: int | None) -> "FollowedPerson":
        """Somebody who is first seen apart in a frame, and where from."""
        return cls(frame, piece.centre_px, np.zeros(2), piece.area, piece.looks, piece.box_px, host)

    def merged(self, piece: "_Piece") -> None:
        """Goes on within a silhouette with others."""
        self.near_px = (self.near_px + self.speed_px).clip(*piece.box_px)
        self.box_px = piece.box_px

    def moved(self, piece: "_Piece") -> None:
        """Learns from a silhouette that is this person's."""
        self.speed_px = _mixed(self.speed_px, piece.centre_px - self.near_px)
        self.near_px, self.box_px = piece.centre_px, piece.box_px
        self.usual_px = _mixed(self.usual_px, piece.area)
        self.seen += piece.slender
        if self.looks is not None and piece.looks is not None:
            self.looks = _mixed(self.looks, piece.looks)


@dataclass(frozen=True, eq=False)
class _Piece:
    """A component of a foreground image that is large enough for a person: its number, area, px,
    slenderness, centre (2,), box (2, 2) and colours.
    """

    label: int
    area: float
    slender: float
    centre_px: FloatArray
    box_px: FloatArray
    looks: FloatArray | None


class PeopleFollower:
    """Follows people whose silhouettes stay apart, frame by frame.

    Args:
        camera: which filmed.
        people: whom; None: everybody who appears, added to `people`.
        coloured: whether frames have colours, which tell people apart where they part again.

    Attributes:
        merged: numbers of those who have one silhouette with others in the last frame.
    """

    def __init__(self, camera: Camera, people: list[FollowedPerson] | None, coloured: bool):
        self.merged: frozenset[int] = frozenset()
        self.lens, self._coloured = UndistortedView.from_camera(camera, LONG_SIDE_PX), coloured
        self.people = [] if people is None else people
        self._is_open = people is None
        self._frame = -1

    def find(self, picture: Frame, mask: Mask, people: Sequence[Mask] = ()) -> list[Mask | None]:
        """Where each person may be in the next frame, (h, w) bool; None: not there, or not apart.

        Args:
            picture: (H, W, 3) as recorded.
            mask: (h, w) bool, all foreground, undistorted.
            people: (h, w) bool, where the pose network sees each person, undistorted.
        """
        self._frame += 1
        components, first_part = _parted(label_components(mask), people)
        followed = [k for k, person in enumerate(self.people) if person.first <= self._frame]
        pieces = self._pieces(components, picture, [self.people[k] for k in followed])
        taken = _assigned([self.people[k] for k in followed], pieces)
        owners = {followed[k]: j for k, j in taken.items()}
        merged = self._merged(owners, pieces, followed)
        for k in merged:
            self.people[k].merged(pieces[merged[k]])
        for j in sorted({*range(len(pieces))} - {*owners.values()} - {*merged.values()}):
            missing = [k for k in followed if k not in owners and k not in merged]
            if missing:  # comes back; by the colours, if there are any
                back = min(missing, key=lambda k: _unlike(self.people[k], pieces[j]))
                self.people[back].near_px, owners[back] = pieces[j].centre_px, j
            elif self._is_open:
                owners[len(self.people)] = j
                hosts = [k for k in followed if _holds(self.people[k].box_px, pieces[j].centre_px)]
                host = hosts[0] if hosts else None
                self.people.append(FollowedPerson.begun(self._frame, pieces[j], host))
        parts = [k for k, j in owners.items() if pieces[j].label >= first_part]
        self.merged = frozenset([*merged, *parts])
        for k, j in owners.items():
            if k not in merged:
                self.people[k].moved(pieces[j])
        claimed = sorted({*owners.values(), *merged.values()})
        nearest = _nearest(components, [pieces[j].label for j in claimed])
        apart = {k: claimed.index(j) for k, j in owners.items() if k not in merged}
        numbers = range(len(self.people))
        return [mask & (nearest == apart[k]) if k in apart else None for k in numbers]

    def _pieces(
        self, components: MaskComponents, picture: Frame, people: Sequence[FollowedPerson]
    ) -> list[_Piece]:
        """Components that are large enough for one of some people, or for anybody."""
        area = components.sizes[1:].astype(float)
        if not len(area):
            return []
        (y, x), (bottom, right) = components.bounds.transpose(1, 2, 0).astype(float)
        slender = slenderness(right - x, bottom - y)
        smallest = min((person.usual_px for person in people), default=np.inf)
        least = PERSON.least_of_usual * min(smallest, float((area * slender).max()))
        pieces = []
        for k in np.flatnonzero(area * slender >= max(LEAST_PX, least)).tolist():
            box = np.array([[x[k], y[k]], [right[k], bottom[k]]])
            looks = None
            if self._coloured:
                crop = _colours(self.lens, picture, components.labels == k + 1)
                inside = crop.part(components.labels == k + 1)
                looks = coarse_histogram(crop.bins[inside])
            centre = components.centroids[k, ::-1]
            pieces.append(_Piece(k + 1, area[k], float(slender[k]), centre, box, looks))
        return pieces

    def _merged(
        self, owners: dict[int, int], pieces: list[_Piece], followed: list[int]
    ) -> dict[int, int]:
        """By number, people who have one silhouette with others, and which piece that is.

        Who has no silhouette is in that which holds the place, if it is larger than its owner.
        """
        merged: dict[int, int] = {}
        for k in followed:
            person = self.people[k]
            if k in owners:
                continue
            place_px = person.near_px + person.speed_px
            for owner, j in owners.items():
                alone = self.people[owner].usual_px + PERSON.least_of_usual * person.usual_px
                if _holds(pieces[j].box_px, place_px) and pieces[j].area >= alone:
                    merged |= {k: j, owner: j}
        return merged


def people_apart(
    frames: Iterator[tuple[Frame, Mask, Sequence[Mask]]], camera: Camera, count: int, coloured: bool
) -> list[FollowedPerson]:
    """The people who are longest seen apart, as they begin, in the order of their places.

    Args:
        frames: as of `PersonFinder.find`.
        camera: which filmed them.
        count: number of people, at most.
        coloured: see `PeopleFollower`.
    """
    follower = PeopleFollower(camera, None, coloured)
    begun: list[FollowedPerson] = []
    for picture, silhouette, seen in frames:
        apart = [follower.lens.undistort(one) for one in seen]
        follower.find(picture, follower.lens.undistort(silhouette), apart)
        begun += [replace(person) for person in follower.people[len(begun) :]]
    people = []
    for last, person in zip(follower.people, begun, strict=True):
        host = person if person.came_from is None else people[person.came_from]
        # Who came out of another's silhouette was in it from its beginning.
        place = {name: getattr(host, name) for name in ("first", "near_px", "box_px")}
        people.append(replace(person, **place, usual_px=last.usual_px, looks=last.looks))
    longest = np.argsort([-person.seen for person in follower.people], kind="stable")[:count]
    chosen = [people[k] for k in longest.tolist()]
    return sorted(chosen, key=lambda person: (person.first, person.near_px[0]))


class OneOfPeople(PersonFinder):
    """Finds one of several people in one frame after the other.

    Args:
        people: everybody, from `people_apart`.
        number: whom, from 0.

    Attributes:
        merged: in how many frames so far somebody else has the same silhouette.
    """

    def __init__(
        self, camera: Camera, coloured: bool, people: Sequence[FollowedPerson], number: int
    ):
        super().__init__(camera, coloured)
        copies = [replace(person) for person in people]
        known = any(person.looks is not None for person in people)
        self._follower = PeopleFollower(camera, copies, known)
        self._number, self.merged = number, 0

    def among(self, picture: Frame, mask: Mask, people: Sequence[Mask]) -> Person | None:
        """See `PersonFinder.among`."""
        person = self._follower.find(picture, mask, people)[self._number]
        self.merged += self._number in self._follower.merged
        return None if person is None else super().among(picture, person, ())


def _parted(components: MaskComponents, people: Sequence[Mask]) -> tuple[MaskComponents, int]:
    """Components of which each that holds most of several people is theirs, where each is seen; the
    rest of it is nobody's. Then the number of the first such part.
    """
    labels = components.labels.copy()
    counts = np.array(
        [np.bincount(labels[one], minlength=len(components.sizes)) for one in people], np.int64
    ).reshape(len(people), len(components.sizes))
    counts[:, 0] = 0  # what is no foreground
    held = [k for k in range(len(people)) if counts[k].any()]
    holders = counts.argmax(axis=1)
    for label in {int(holders[k]) for k in held}:
        members = [k for k in held if holders[k] == label]
        if len(members) < 2:
            continue
        inside = components.labels == label
        labels[inside] = 0
        for k in members:
            labels[inside & people[k]] = max(int(labels.max()) + 1, len(components.sizes))
    numbers, numbered = np.unique(np.append(labels, 0), return_inverse=True)
    labels = numbered[:-1].reshape(labels.shape).astype(np.int32)
    sizes = np.bincount(labels[labels > 0], minlength=1)
    first_part = int(np.count_nonzero(numbers < len(components.sizes)))
    return MaskComponents(labels, sizes), first_part


def _assigned(people: Sequence[FollowedPerson], pieces: Sequence[_Piece]) -> dict[int, int]:
    """Which piece is whose: indices of pieces by people's. Nobody moves within a frame by half
    their height, which is the root of the area.
    """
    costs = np.full((len(people), len(pieces)), float(_MOST))
    for k, person in enumerate(people):
        for j, piece in enumerate(pieces):
            distance = np.linalg.norm(piece.centre_px - person.near_px - person.speed_px)
            distance /= np.sqrt(person.usual_px)
            if distance < 1 and piece.area >= PERSON.least_of_usual * person.usual_px:
                costs[k, j] = distance + _unlike(person, piece)
    rows, columns = linear_sum_assignment(rounded(costs))
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return {k: j for k, j in pairs if costs[k, j] < _MOST}


def _unlike(person: FollowedPerson, piece: _Piece) -> float:
    """How different the colours of a person and a piece are, 0 to 1."""
    if person.looks is None or piece.looks is None:
        return 0.0
    return float(rounded(unlikeness(person.looks, piece.looks)))


def _holds(box_px: FloatArray, place_px: FloatArray) -> bool:
    """Whether a place is in a box."""
    return bool((box_px[0] <= place_px).all() and (place_px <= box_px[1]).all())


def _nearest(components: MaskComponents, labels: Sequence[int]) -> NDArray[np.intp]:
    """Which of some components is nearest to each pixel, (h, w); 0 where there is but one."""
    if len(labels) < 2:
        return np.zeros(components.labels.shape, np.intp)
    distances = [
        cv2.distanceTransform(
            (components.labels != label).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_3
        )
        for label in labels
    ]
    return np.argmin(distances, axis=0)


def _mixed(old: Averaged, new: Averaged) -> Averaged:
    """An average over the last ten frames or so."""
    return 0.9 * old + 0.1 * new


def _colours(lens: UndistortedView, picture: Frame, mask: BoolArray) -> ColourCrop:
    """Colours in the rectangle that holds a silhouette."""
    rows, columns = bounding_box(mask)
    corner = columns.start, rows.start
    size = columns.stop - columns.start, rows.stop - rows.start
    return ColourCrop.of(lens.undistort_part(picture, corner, size), corner)
