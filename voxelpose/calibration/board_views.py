"""Boards in stills and videos: cameras in folders, detection of the board, selection of views, and
moments at which several cameras filmed it.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board import Board, BoardView, Effort, view_between
from calib.checks import FloatArray
from calib.errors import InputError
from calib.storage.documents import visible_entries
from silhouette_core.progress import Reporter
from voxelpose.recording.camera_files import not_read, pictures_by_camera, unread_stills
from voxelpose.recording.chapters import open_camera
from voxelpose.recording.frame_reader import (
    STILLS,
    Frame,
    FrameReader,
    read_still,
    turned_differently,
)
from voxelpose.recording.timestamps import Times
from voxelpose.tuning import BOARD_SEARCH

_MAX_EXAMINED = 400  # frames of a video in which the board is searched
_MOST_STILLS = 60  # pictures of a folder; more are frames of a film
_PATIENT_STEP = 20  # one frame in this many is searched with more effort
_KEPT_FAILURES = 5  # pictures without the board in which another board is searched
NOT_NEW = "shows the board much as another frame does"


def _examined_pictures(pictures: FrameReader) -> Iterator[tuple[str, Frame]]:
    """Yields names and pictures: all stills, of any sizes, or every n-th frame of a film."""
    step = stride(pictures.frame_count)
    if pictures.stills:
        for still in pictures.stills[::step]:
            yield still.name, read_still(still, sensor=pictures.sensor)
        return
    for number, frame in enumerate(pictures):
        if number % step == 0:
            yield f"frame {number}", frame


def is_film(pictures: FrameReader) -> bool:
    """Whether pictures are frames, of which some are enough, not stills taken one by one."""
    return not 0 < len(pictures.stills) <= _MOST_STILLS


def stride(frame_count: int) -> int:
    """Step between the examined frames of a video."""
    return -(-frame_count // _MAX_EXAMINED)


def cameras_in(paths: Sequence[Path]) -> dict[str, FrameReader]:
    """Finds the cameras among files and folders. InputError where a path is missing, there is no
    picture in it, or two cameras share a name.

    A video is a camera named after its file; stills are a camera named after their folder; a folder
    of videos and of folders of stills holds a camera for each.
    """
    cameras: dict[str, FrameReader] = {}
    loose: dict[Path, list[Path]] = {}
    for path in paths:
        if not path.exists():
            raise InputError(
                f"{path} is missing: give a folder of pictures or a video for each camera"
            )
        stills = [path] if path.suffix.lower() in STILLS else []
        if path.is_dir():
            stills = [file for file in visible_entries(path) if file.suffix.lower() in STILLS]
        if stills:
            loose.setdefault(stills[0].resolve().parent, []).extend(stills)
            continue
        inside = pictures_by_camera(path) if path.is_dir() else {path.stem: path}
        if not inside:
            raise InputError(
                f"{path} holds no pictures{unread_stills(path)}: give a folder of stills or videos"
                f" of the board, or a folder with one of these per camera{not_read(path)}"
            )
        for name, pictures in inside.items():
            _add(cameras, name, open_camera(pictures))
    for folder, stills in loose.items():
        # Their sizes may differ: none is stated.
        sensor = turned_differently(stills)
        reader = FrameReader(folder, tuple(stills), (0, 0), len(stills), None, sensor=sensor)
        _add(cameras, folder.name, reader)
    return cameras


def _add(cameras: dict[str, FrameReader], name: str, pictures: FrameReader) -> None:
    if name in cameras:
        raise InputError(
            f"two sets of pictures are named {name}: name each folder or video after its camera"
        )
    cameras[name] = pictures


def as_printed(board: Board, cameras: Mapping[str, FrameReader], reporter: Reporter) -> Board:
    """A board as the first picture shows it that tells, see `Board.as_printed`, and says what is
    otherwise than was given; as it was given where none tells. InputError where a picture cannot be
    read.
    """
    for pictures in cameras.values() if board.marker_m is not None else ():
        if is_film(pictures):
            step = _PATIENT_STEP * stride(pictures.frame_count)
            pictures = pictures.select(range(0, pictures.frame_count, step))
        for _, picture in _examined_pictures(pictures):
            printed = board.as_printed(picture)
            if printed is not None:
                if printed != board:
                    reporter.note(printed.print_words(board))
                return printed
    return board


def find_views(
    board: Board, pictures: FrameReader, max_views: int, reporter: Reporter
) -> dict[str, BoardView | str]:
    """Detects the board in one camera's pictures, of a film in at most `max_views` frames: by name
    a view, or the reason why there is none. InputError where a picture cannot be read, or none
    shows the board; another board that they show is described.
    """
    views: dict[str, BoardView | str] = {}
    if pictures.sensor:
        reporter.note(
            f"{pictures.path.name}: EXIF data turn some pictures otherwise than others: all were"
            " turned back to the sensor's pixels, to which a lens belongs"
        )
    find = BoardFinder(board, stills=not is_film(pictures))
    for name, picture in _examined_pictures(pictures):
        views[name] = find(picture)
        reporter.advance()
    if not any(isinstance(view, BoardView) for view in views.values()):
        raise InputError(f"the board was found in none of {len(views)} pictures: {find.failure()}")
    if not is_film(pictures):
        return views
    seen = {name: view for name, view in views.items() if isinstance(view, BoardView)}
    used = select_views(board, seen, max_views)
    return {
        name: NOT_NEW if name in seen and name not in used else view for name, view in views.items()
    }


class BoardFinder:
    """Detects the board in one camera's pictures, with as much effort as the camera needs."""

    def __init__(self, board: Board, stills: bool) -> None:
        """Begins quickly with a video, thoroughly with stills."""
        self.board = board
        self.effort: Effort = "thorough" if stills else "quick"
        self.count = 0
        self.reasons: Counter[str] = Counter()
        self.refused: list[Frame] = []

    def __call__(self, picture: Frame, important: bool = False) -> BoardView | str:
        """Detects the board, with all effort in an important picture."""
        detection = self.board.find(picture, self.effort)
        if (
            isinstance(detection, str)
            and self.effort == "quick"
            and self.count % _PATIENT_STEP == 0
        ):
            detection = self.board.find(picture, "patient")
            if isinstance(detection, BoardView):
                self.effort = "patient"  # the quick search misses small boards
        if isinstance(detection, str) and important:
            detection = self.board.find(picture, "thorough")
        self.count += 1
        if isinstance(detection, str):
            self.reasons[detection] += 1
            if len(self.refused) < _KEPT_FAILURES:
                self.refused.append(picture)
        return detection

    def failure(self) -> str:
        """Reason of failure: a defect of a detected board, else another board in the pictures."""
        for reason, _ in self.reasons.most_common():
            if not reason.startswith("no board"):
                return reason
        others = filter(None, map(self.board.other_board, self.refused))
        return next(others, next(iter(self.reasons), "there are no pictures of that time"))


def select_views(board: Board, views: Mapping[str, BoardView], max_views: int) -> set[str]:
    """Selects frames of a video with a still board at different positions, sizes and tilts.

    Args:
        views: Views by frame, in order of time.

    Returns:
        Names of the selected frames: each differs most from those selected before it.
    """
    names = list(views)
    if len(names) <= 1:
        return set(names)
    outlines = np.array([_outline(board, view) for view in views.values()])
    moved = np.linalg.norm(np.diff(outlines, axis=0), axis=1)
    speed = np.minimum(np.append(moved, np.inf), np.append(np.inf, moved))
    fastest = max(BOARD_SEARCH.fast * float(np.median(speed)), BOARD_SEARCH.new_view / 4)
    still = np.flatnonzero(speed <= fastest)
    chosen = [int(still[np.argmin(speed[still])])]
    distance = np.linalg.norm(outlines[still] - outlines[chosen[0]], axis=1)
    while len(chosen) < min(max_views, len(still)) and distance.max() > BOARD_SEARCH.new_view:
        best = int(np.argmax(distance))
        chosen.append(int(still[best]))
        distance = np.minimum(
            distance, np.linalg.norm(outlines[still] - outlines[chosen[-1]], axis=1)
        )
    return {names[index] for index in chosen}


def _outline(board: Board, view: BoardView) -> FloatArray:
    """Image coordinates (8,) of a board's four corners, in widths of the picture."""
    ends = board.points_m[[0, board.columns - 1, -1, -board.columns], :2]
    homography, _ = cv2.findHomography(board.points_m[view.ids, :2], view.pixels)
    if homography is None:
        return np.tile(view.pixels.mean(axis=0) / view.size[0], 4)
    return np.clip(cv2.perspectiveTransform(ends[None], homography).ravel() / view.size[0], -1, 2)


def board_moments(
    board: Board,
    readers: Mapping[str, FrameReader],
    times: Mapping[str, Times] | None,
    floor: int | None,
    max_moments: int,
    reporter: Reporter,
) -> tuple[dict[str, dict[str, BoardView]], dict[str, int]]:
    """Detects the board in recordings of any rates, of which every frame's time is known: views by
    moment ("frame 120") and camera, and the number of moments at which each saw the board.
    InputError where pictures cannot be read, or a camera never saw the board.

    The moments are frames of the first camera. At these times, corners of the others are
    interpolated between the frames before and after.

    Args:
        readers: Pictures by camera name.
        times: (frames,) float64, s, increasing, of one clock, by camera name; None: all cameras
            film in step, from the first frame on.
        floor: A frame of the first camera that is always kept; None if there is none.
    """
    first, *others = readers
    place = "the recording" if times is None else first
    if times is None:
        shortest = min(reader.frame_count for reader in readers.values())
        times = dict.fromkeys(readers, np.arange(shortest, dtype=float))
    count = len(times[first])
    if floor is not None and not 0 <= floor < count:
        raise InputError(f"--floor {floor} is not in {place}: it has frames 0 to {count - 1}")
    begin = min(float(times[name][0]) for name in others or readers)
    end = max(float(times[name][-1]) for name in others or readers)
    useful = np.flatnonzero((times[first] >= begin) & (times[first] <= end))
    numbers = useful[:: stride(max(len(useful), 1))]
    numbers = np.union1d(numbers, [] if floor is None else [floor]).astype(np.int64)
    finders = {name: BoardFinder(board, not is_film(reader)) for name, reader in readers.items()}
    views: dict[str, dict[str, BoardView]] = {f"frame {number}": {} for number in numbers}
    for name, reader in readers.items():
        before, after, part = frames_around(times[name], times[first][numbers])
        needed = np.unique(np.concatenate([before, after]))
        needed = needed[needed >= 0]
        at_floor = numbers == (-1 if floor is None else floor)
        important = {*before[at_floor].tolist(), *after[at_floor].tolist()}
        reporter.stage(f"looking for the board in {name}", len(needed))
        detected: dict[int, BoardView] = {}
        pictures = reader.select(needed.tolist())
        for number, picture in zip(needed.tolist(), pictures, strict=True):
            view = finders[name](picture, number in important)
            if isinstance(view, BoardView):
                detected[number] = view
            reporter.advance()
        for moment, a, b, fraction in zip(views, before, after, part, strict=True):
            if a in detected and b in detected:
                view = view_between(board, detected[a], detected[b], float(fraction))
                if view is not None:
                    views[moment][name] = view
    seen = {name: sum(name in moment for moment in views.values()) for name in readers}
    if never := [name for name, times in seen.items() if not times]:
        reasons = "; ".join(f"{name}: {finders[name].failure()}" for name in never)
        raise InputError(
            f"{', '.join(never)} never saw the board in {len(views)} moments ({reasons}): carry it"
            " nearer, and slowly"
        )
    return _select_moments(views, max_moments, f"frame {floor}"), seen


def frames_around(
    times: Times, instants: Times
) -> tuple[NDArray[np.int64], NDArray[np.int64], Times]:
    """Frames of one camera before and after given times.

    Args:
        times: (frames,) float64, s, increasing.
        instants: (M,) float64, s.

    Returns:
        Numbers (M,) of the frame before and of the frame after, twice the same where a frame was
        taken at that very time, -1 where there is none near; and the time (M,) passed between them,
        0 to 1.
    """
    before = np.clip(np.searchsorted(times, instants, side="right") - 1, 0, len(times) - 1)
    after = np.minimum(before + 1, len(times) - 1)
    passed, span = instants - times[before], times[after] - times[before]
    period = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    same = BOARD_SEARCH.same_frame * period + 1e-6
    at_before, at_after = np.abs(passed) <= same, np.abs(passed - span) <= same
    between = (passed > 0) & (passed < span) & (span <= BOARD_SEARCH.widest_s)
    known = at_before | at_after | between
    first, second = np.where(at_after, after, before), np.where(at_before, before, after)
    fraction = np.where(second > first, passed / np.maximum(span, 1e-9), 0.0)
    return np.where(known, first, -1), np.where(known, second, -1), fraction


def _select_moments(
    views: dict[str, dict[str, BoardView]], max_moments: int, floor: str
) -> dict[str, dict[str, BoardView]]:
    """Moments with most views, evenly over time; boards seen by a single camera are useless."""
    alone = 1 if len({name for seen in views.values() for name in seen}) == 1 else 0
    useful = [moment for moment, seen in views.items() if len(seen) > 1 - alone or moment == floor]
    chosen = {
        max(useful[part[0] : part[-1] + 1], key=lambda moment: len(views[moment]))
        for part in np.array_split(np.arange(len(useful)), min(max_moments, len(useful)) or 1)
        if len(part)
    }
    return {moment: views[moment] for moment in useful if moment in chosen or moment == floor}
