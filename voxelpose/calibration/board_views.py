"""Boards in stills and videos: which cameras there are, which of their pictures show the board, and
which of these to use.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board import Board, BoardView, Effort, Refusal
from calib.errors import InputError
from silhouette_core.progress import Reporter
from voxelpose.recording.folder import pictures_by_camera
from voxelpose.recording.frame_reader import STILLS, Frame, FrameReader, read_still, read_together

_EXAMINED = 400  # frames of a video in which the board is looked for, at most
_NEW_VIEW = 0.02  # of the picture's size: boards nearer to each other say the same
_HASTY = 2.0  # times the median speed
_PATIENCE = 20  # of so many frames one is looked at longer
_LOOKED_AT = 5  # refused pictures in which another board is looked for
NOT_NEW = "shows the board much as another frame does"

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class CameraPictures:
    """What one camera took: stills, or a video."""

    stills: tuple[Path, ...] = ()
    video: FrameReader | None = None

    def __len__(self) -> int:
        """Counts the pictures."""
        return self.video.frame_count if self.video else len(self.stills)

    def examined(self) -> Iterator[tuple[str, Frame]]:
        """Yields names and pictures: all stills, or every n-th frame of a video."""
        if self.video is None:
            for still in self.stills:
                yield still.name, read_still(still)
            return
        step = stride(self.video.frame_count)
        for number, frame in enumerate(self.video):
            if number % step == 0:
                yield f"frame {number}", frame


def stride(frame_count: int) -> int:
    """Returns n where every n-th frame of a video is examined."""
    return -(-frame_count // _EXAMINED)


def cameras_in(paths: Sequence[Path]) -> dict[str, CameraPictures]:
    """Finds the cameras among files and folders.

    A video is a camera named after its file; stills are a camera named after their folder; a folder
    of videos and of folders of stills holds a camera for each.

    Raises:
        InputError: A path is missing, there is no picture in it, or two cameras share a name.
    """
    found: dict[str, CameraPictures] = {}
    loose: dict[Path, list[Path]] = {}
    for path in paths:
        if not path.exists():
            raise InputError(
                f"{path} is missing: give a folder of pictures or a video for each camera"
            )
        stills = [path] if path.suffix.lower() in STILLS else []
        if path.is_dir():
            stills = [file for file in sorted(path.iterdir()) if file.suffix.lower() in STILLS]
        if stills:
            loose.setdefault(stills[0].resolve().parent, []).extend(stills)
            continue
        inside = pictures_by_camera(path) if path.is_dir() else {path.stem: path}
        if not inside:
            raise InputError(
                f"{path} holds no pictures: give a folder of stills or videos of the board, or a"
                " folder with one of these per camera"
            )
        for name, one in inside.items():
            _add(found, name, _pictures(one))
    for folder, stills in loose.items():
        _add(found, folder.name, CameraPictures(tuple(stills)))
    return found


def _pictures(path: Path) -> CameraPictures:
    readers = FrameReader.open(path)
    return CameraPictures(readers.stills) if readers.stills else CameraPictures(video=readers)


def _add(found: dict[str, CameraPictures], name: str, pictures: CameraPictures) -> None:
    if name in found:
        raise InputError(
            f"two sets of pictures are named {name}: name each folder or video after its camera"
        )
    found[name] = pictures


def find_views(
    board: Board, pictures: CameraPictures, wanted: int, reporter: Reporter
) -> dict[str, BoardView | Refusal]:
    """Looks for the board in one camera's pictures.

    Args:
        board: The board.
        pictures: The pictures.
        wanted: How many frames of a video to use, at most; stills are all used.
        reporter: Hears of every picture.

    Returns:
        A view or the reason why there is none, by the picture's name.

    Raises: InputError: A picture cannot be read, or none shows the board; if they show another
        board, it is told.
    """
    views: dict[str, BoardView | Refusal] = {}
    find = _Finder(board, stills=pictures.video is None)
    for name, picture in pictures.examined():
        views[name] = find(picture)
        reporter.advance()
    if not any(isinstance(view, BoardView) for view in views.values()):
        raise InputError(f"the board was found in none of {len(views)} pictures: {find.why()}")
    if pictures.video is None:
        return views
    seen = {name: view for name, view in views.items() if isinstance(view, BoardView)}
    kept = choose(board, seen, wanted)
    return {
        name: Refusal(NOT_NEW) if name in seen and name not in kept else view
        for name, view in views.items()
    }


class _Finder:
    """Looks for the board in one camera's pictures, in a video no longer than that camera needs."""

    def __init__(self, board: Board, stills: bool) -> None:
        self.board = board
        self.effort: Effort = "thorough" if stills else "quick"
        self.count = 0
        self.reasons: Counter[str] = Counter()
        self.refused: list[Frame] = []

    def __call__(self, picture: Frame, important: bool = False) -> BoardView | Refusal:
        """Returns the view or the refusal; spares nothing where it is important."""
        found = self.board.find(picture, self.effort)
        if isinstance(found, Refusal) and self.effort == "quick" and self.count % _PATIENCE == 0:
            found = self.board.find(picture, "patient")
            if isinstance(found, BoardView):
                self.effort = "patient"  # small boards, far away, are given up too early
        if isinstance(found, Refusal) and important:
            found = self.board.find(picture, "thorough")
        self.count += 1
        if isinstance(found, Refusal):
            self.reasons[found.reason] += 1
            if len(self.refused) < _LOOKED_AT:
                self.refused.append(picture)
        return found

    def why(self) -> str:
        """Says why the board was not found: what was amiss with what looked like one, else which
        other board there is.
        """
        for reason, _ in self.reasons.most_common():
            if not reason.startswith("no board"):
                return reason
        return next(
            (said for picture in self.refused if (said := self.board.instead(picture))),
            next(iter(self.reasons)),
        )


def choose(board: Board, views: Mapping[str, BoardView], wanted: int) -> set[str]:
    """Chooses frames of a video in which the board is still and in different places, sizes and
    tilts.

    Args:
        board: The board.
        views: Views by frame, in order of time.
        wanted: How many, at most.

    Returns:
        Names of the chosen frames: each is the one that differs most from those chosen before it.
    """
    names = list(views)
    if len(names) <= 1:
        return set(names)
    places = np.array([_outline(board, view) for view in views.values()])
    moved = np.linalg.norm(np.diff(places, axis=0), axis=1)
    speed = np.minimum(np.append(moved, np.inf), np.append(np.inf, moved))
    calm = np.flatnonzero(speed <= max(_HASTY * float(np.median(speed)), _NEW_VIEW / 4))
    chosen = [int(calm[np.argmin(speed[calm])])]
    distance = np.linalg.norm(places[calm] - places[chosen[0]], axis=1)
    while len(chosen) < min(wanted, len(calm)) and distance.max() > _NEW_VIEW:
        farthest = int(np.argmax(distance))
        chosen.append(int(calm[farthest]))
        distance = np.minimum(distance, np.linalg.norm(places[calm] - places[chosen[-1]], axis=1))
    return {names[index] for index in chosen}


def _outline(board: Board, view: BoardView) -> FloatArray:
    """Returns where a board's four ends are, (8,), in widths of the picture."""
    ends = board.points_m[[0, board.columns - 1, -1, -board.columns], :2]
    homography, _ = cv2.findHomography(board.points_m[view.ids, :2], view.pixels)
    if homography is None:
        return np.tile(view.pixels.mean(axis=0) / view.size[0], 4)
    return np.clip(cv2.perspectiveTransform(ends[None], homography).ravel() / view.size[0], -1, 2)


@dataclass(frozen=True, eq=False)
class Moments:
    """What synchronous cameras saw of a board.

    Attributes:
        views: Moment ("frame 120") -> camera -> view.
        examined: How many moments were looked at.
        seen: In how many of them each camera saw the board.
    """

    views: dict[str, dict[str, BoardView]]
    examined: int
    seen: dict[str, int]


def board_moments(
    board: Board,
    readers: Mapping[str, FrameReader],
    floor: int | None,
    wanted: int,
    reporter: Reporter,
) -> Moments:
    """Looks for the board in synchronous footage.

    Args:
        board: The board.
        readers: Synchronous pictures by camera name.
        floor: A frame that is kept in any case.
        wanted: How many moments to keep, at most.
        reporter: Hears of every moment.

    Raises:
        InputError: Pictures cannot be read, or a camera never saw the board.
    """
    count = min(one.frame_count for one in readers.values())
    if floor is not None and not 0 <= floor < count:
        raise InputError(f"--floor {floor} is not in the recording: it has frames 0 to {count - 1}")
    step = stride(count)
    finders = {name: _Finder(board, bool(one.stills)) for name, one in readers.items()}
    views: dict[str, dict[str, BoardView]] = {}
    reporter.stage("looking for the board", -(-count // step))
    for number, frames in enumerate(read_together(readers, 0, count)):
        if number % step and number != floor:
            continue
        found = {name: finders[name](frame, number == floor) for name, frame in frames.items()}
        views[f"frame {number}"] = {
            name: view for name, view in found.items() if isinstance(view, BoardView)
        }
        reporter.advance()
    seen = {name: sum(name in moment for moment in views.values()) for name in readers}
    if never := [name for name, times in seen.items() if not times]:
        reasons = "; ".join(f"{name}: {finders[name].why()}" for name in never)
        raise InputError(
            f"{', '.join(never)} never saw the board in {len(views)} moments ({reasons}): carry it"
            " nearer, and slowly"
        )
    return Moments(_thinned(views, wanted, f"frame {floor}"), len(views), seen)


def _thinned(
    views: dict[str, dict[str, BoardView]], wanted: int, floor: str
) -> dict[str, dict[str, BoardView]]:
    """Keeps from each stretch of time the moment that most cameras saw; boards seen by one camera
    alone say nothing.
    """
    alone = 1 if len({name for seen in views.values() for name in seen}) == 1 else 0
    useful = [moment for moment, seen in views.items() if len(seen) > 1 - alone or moment == floor]
    kept = {
        max(useful[part[0] : part[-1] + 1], key=lambda moment: len(views[moment]))
        for part in np.array_split(np.arange(len(useful)), min(wanted, len(useful)) or 1)
        if len(part)
    }
    return {moment: views[moment] for moment in useful if moment in kept or moment == floor}
