"""A board at moments at which several cameras filmed it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.board import Board, BoardView, view_between
from calib.errors import InputError
from silhouette_core.progress import Reporter
from voxelpose.calibration.board_views import BoardFinder, stride
from voxelpose.recording.frame_reader import FrameReader
from voxelpose.recording.timestamps import Times
from voxelpose.tuning import BOARD_SEARCH


@dataclass(frozen=True, eq=False)
class Moments:
    """Detections of a board by synchronous cameras.

    Attributes:
        views: Moment ("frame 120") -> camera -> view.
        seen: Number of moments at which each camera saw the board.
    """

    views: dict[str, dict[str, BoardView]]
    seen: dict[str, int]


def board_moments(
    board: Board,
    readers: Mapping[str, FrameReader],
    times: Mapping[str, Times] | None,
    floor: int | None,
    max_moments: int,
    reporter: Reporter,
) -> Moments:
    """Detects the board in recordings of any rates, of which every frame's time is known.

    The moments are frames of the first camera. At these times, corners of the others are
    interpolated between the frames before and after.

    Args:
        readers: Pictures by camera name.
        times: (frames,) float64, s, increasing, of one clock, by camera name; None: all cameras
            film in step, from the first frame on.
        floor: A frame of the first camera that is always kept; None if there is none.
        max_moments: Maximum number of moments.

    Raises:
        InputError: Pictures cannot be read, or a camera never saw the board.
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
    finders = {name: BoardFinder(board, bool(reader.stills)) for name, reader in readers.items()}
    views: dict[str, dict[str, BoardView]] = {f"frame {number}": {} for number in numbers}
    for name, reader in readers.items():
        before, after, part = frames_around(times[name], times[first][numbers])
        needed = np.unique(np.concatenate([before, after]))
        needed = needed[needed >= 0]
        at_floor = numbers == (-1 if floor is None else floor)
        important = {*before[at_floor].tolist(), *after[at_floor].tolist()}
        reporter.stage(f"looking for the board in {name}", len(needed))
        found: dict[int, BoardView] = {}
        pictures = reader.select(needed.tolist())
        for number, picture in zip(needed.tolist(), pictures, strict=True):
            view = finders[name](picture, number in important)
            if isinstance(view, BoardView):
                found[number] = view
            reporter.advance()
        for moment, a, b, fraction in zip(views, before, after, part, strict=True):
            if a in found and b in found:
                view = view_between(board, found[a], found[b], float(fraction))
                if view is not None:
                    views[moment][name] = view
    return _moments(views, finders, max_moments, floor)


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


def _moments(
    views: dict[str, dict[str, BoardView]],
    finders: Mapping[str, BoardFinder],
    max_moments: int,
    floor: int | None,
) -> Moments:
    """The moments that are kept.

    Raises:
        InputError: A camera never saw the board.
    """
    seen = {name: sum(name in moment for moment in views.values()) for name in finders}
    if never := [name for name, times in seen.items() if not times]:
        reasons = "; ".join(f"{name}: {finders[name].failure()}" for name in never)
        raise InputError(
            f"{', '.join(never)} never saw the board in {len(views)} moments ({reasons}): carry it"
            " nearer, and slowly"
        )
    return Moments(_thinned(views, max_moments, f"frame {floor}"), seen)


def _thinned(
    views: dict[str, dict[str, BoardView]], max_moments: int, floor: str
) -> dict[str, dict[str, BoardView]]:
    """Moments with most views, evenly over time; boards seen by a single camera are useless."""
    alone = 1 if len({name for seen in views.values() for name in seen}) == 1 else 0
    useful = [moment for moment, seen in views.items() if len(seen) > 1 - alone or moment == floor]
    kept = {
        max(useful[part[0] : part[-1] + 1], key=lambda moment: len(views[moment]))
        for part in np.array_split(np.arange(len(useful)), min(max_moments, len(useful)) or 1)
        if len(part)
    }
    return {moment: views[moment] for moment in useful if moment in kept or moment == floor}
