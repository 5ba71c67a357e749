"""Times of every camera's frames (timestamps.csv), and the frames that match in time."""

from __future__ import annotations

import csv
from array import array
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from calib.storage.atomic import replacing
from calib.storage.documents import csv_rows

if TYPE_CHECKING:
    from voxelpose.recording.frame_reader import FrameReader

TIMESTAMPS = "timestamps.csv"
_LARGEST_BYTES = 500_000_000
_LATEST_S = 10**11  # of any clock that counts seconds
PER_SECOND = {unit: 1000**power for power, unit in enumerate("s ms us ns".split())}
"""By units of time, how many are a second."""
_COLUMNS = {f"frame_time_{unit}": unit for unit in PER_SECOND}
_SLOWEST, _FASTEST = 1, 1000  # frames per second
_LASTING = 30  # frames
_UNIT_REMEDY = "name the unit in the header (frame_time_ms, _us, _ns), or correct the times"
Times = NDArray[np.float64]
"""(frames,) float64, s."""


def read_timestamps(
    path: Path, readers: Mapping[str, FrameReader]
) -> tuple[dict[str, Times], tuple[str, ...]]:
    """Reads timestamps.csv: cam_id,frame_time, one row per frame in the order of the frames, into
    (frames,) float64, s, by camera name; and what is worth telling about it. InputError where the
    file is not such a table, or does not fit the videos.

    Args:
        path: the file; cam_id is the camera's name, or 1 for cam_1; frame_time is in seconds, or in
            the unit that the column's name states, as in frame_time_ms.
        readers: frame readers by name of the cameras whose times are read.
    """
    listed: dict[str, array[float]] = {}
    column = "frame_time"
    rows = csv_rows(path, ("cam_id",), _LARGEST_BYTES, ("frame_time", *_COLUMNS))
    for number, row in enumerate(rows, 2):
        column = next((name for name in ("frame_time", *_COLUMNS) if name in row), column)
        try:
            camera, time = row["cam_id"].strip(), float(row[column])
        except KeyError as error:
            raise InputError(
                f"{path} line {number}: no column {error.args[0]}: give cam_id,frame_time"
            ) from None
        except ValueError:
            raise InputError(
                f"{path} line {number} is not cam_id,frame_time (seconds, as 0.25): correct it, or"
                " remove the file"
            ) from None
        if camera in readers or f"cam_{camera}" in readers:
            listed.setdefault(camera, array("d")).append(time)
    times: dict[str, Times] = {}
    for name, reader in readers.items():
        columns = [taken for camera, taken in listed.items() if name in (camera, f"cam_{camera}")]
        times[name] = _checked_times(path, name, reader, np.concatenate([np.zeros(0), *columns]))
    unit, notes = _COLUMNS.get(column, ""), ()
    if not unit:
        unit, notes = _unit_by_rate(path, readers, times)
    times = {name: taken / PER_SECOND[unit] for name, taken in times.items()}
    for name, taken in times.items():
        if len(taken) and not np.abs(taken).max() < _LATEST_S:
            raise InputError(
                f"{path}: the times of camera {name} are not all numbers of seconds: correct or"
                " remove it"
            )
        if len(taken) > 1:
            checked_rate(1 / _period(taken), f"{path}, camera {name}", _UNIT_REMEDY)
    return times, notes


def _checked_times(path: Path, name: str, reader: FrameReader, times: Times) -> Times:
    """The times of a camera's frames, in the table's unit."""
    if len(times) == reader.promised:
        times = times[: reader.frame_count]  # it lacks the last ones
    if len(times) != reader.frame_count:
        raise InputError(
            f"{path} has {len(times)} times for camera {name}, its video"
            f" {reader.frame_count} frames: correct or remove it"
        )
    if (np.diff(times) <= 0).any():
        raise InputError(
            f"{path}: the times of camera {name} do not increase: correct or remove it"
        )
    return times


def _unit_by_rate(
    path: Path, readers: Mapping[str, FrameReader], times: Mapping[str, Times]
) -> tuple[str, tuple[str, ...]]:
    """The unit of times that cannot be seconds: that with which all rates are the videos'; "s"
    where there is none. And what is to be told.
    """
    steps = {name: _period(taken) for name, taken in times.items() if len(taken) > 1}
    if all(possible_rate(1 / step) for step in steps.values()):
        return "s", ()
    known = [(step, rate) for name, step in steps.items() if (rate := readers[name].fps)]
    for unit, per_second in PER_SECOND.items():
        if known and all(not rates_differ([per_second / step, rate]) for step, rate in known):
            return unit, (
                f"{path} is taken to count in {unit}: only so do its rates agree with the videos'",
            )
    return "s", ()


def possible_rate(fps: float) -> bool:
    """Whether cameras film so many frames per second."""
    return _SLOWEST <= round(fps, 6) <= _FASTEST


def checked_rate(fps: float, source: str, remedy: str) -> float:
    """The rate, frames per second. InputError where no camera films so slowly, or so fast."""
    if possible_rate(fps):
        return fps
    raise InputError(
        f"{source}: {fps:g} frames per second are outside {_SLOWEST} to {_FASTEST:,}: {remedy}"
    )


def write_timestamps(path: Path, times: Mapping[str, Times]) -> None:
    """Writes timestamps.csv. InputError where the file cannot be written."""
    with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["cam_id", "frame_time"])
        table.writerows((name, f"{time:.6f}") for name in times for time in times[name])


def match_frames(
    times: Mapping[str, Times], path: Path
) -> tuple[Times, dict[str, NDArray[np.int64]]]:
    """Times (M,), s, and frame numbers (M,) int64 by camera name, of frames that match in time.
    InputError where there is no time at which all cameras have a frame.

    The camera with the lowest rate is the reference; among equally slow ones, the camera to which
    the others' frames are nearest. Every frame of the reference is matched with the frame of every
    other camera that is nearest in time. Times at which a camera has no frame are left out.

    Args:
        path: source of the times, for messages.
    """
    periods = {name: _period(taken) for name, taken in times.items()}
    slowest = max(periods.values())
    # A frame matches within half a period of its own camera, or a quarter of the longest period.
    tolerance = np.array([0.5 * max(period, 0.5 * slowest) for period in periods.values()]) + 1e-6
    best: tuple[float, Times, dict[str, NDArray[np.int64]]] | None = None
    for reference, instants in times.items():
        if periods[reference] < 0.99 * slowest:
            continue
        numbers = {name: _nearest(taken, instants) for name, taken in times.items()}
        offset = np.stack([np.abs(times[name][numbers[name]] - instants) for name in times])
        matched = (offset <= tolerance[:, None]).all(axis=0)
        if not matched.any():
            continue
        # Of equally near references, that with the most matches is taken.
        cost = float(offset[:, matched].mean()) - 1e-9 * matched.sum()
        if best is None or cost < best[0]:
            best = cost, instants[matched], {name: rows[matched] for name, rows in numbers.items()}
    if best is None:
        raise InputError(
            f"{path}: at no moment all cameras filmed ({spans_text(times)}): correct their times"
            f" ({TIMESTAMPS})"
        )
    return best[1:]


def times_by_rate(
    folder: Path, readers: Mapping[str, FrameReader], fps: float | None
) -> tuple[float, Times]:
    """Frames per second and the time of every frame since the first, s, of readers in step.
    InputError where the rate is not known, impossible, or not the same in all files.

    Args:
        fps: frames per second, before what the files state; None: as they state.
    """
    count = min(reader.frame_count for reader in readers.values())
    if fps is not None:
        return fps, np.arange(count) / fps
    rates = {name: reader.fps for name, reader in readers.items() if reader.fps is not None}
    if not rates:
        if count > 1:
            raise InputError(
                f"{folder}: folders of frames do not tell how fast they were taken: give --fps, or"
                " add timestamps.csv"
            )
        return 1.0, np.zeros(count)
    if rates_differ(rates.values()):
        listed = ", ".join(f"{name} {rate:g}" for name, rate in rates.items())
        raise InputError(
            f"videos differ in rate ({listed} frames per second): `voxelpose calibrate sync --out"
            f" {folder / TIMESTAMPS}` aligns them; or use the cameras of one rate with --cameras,"
            " or give --fps (and --frames A:B) if frame n was taken at the same moment in all"
        )
    rate = float(np.median(list(rates.values())))
    if count > 1:
        checked_rate(rate, ", ".join(rates), "say how fast they filmed with --fps")
    return rate, np.arange(count) / rate


def rates_differ(rates: Iterable[float]) -> bool:
    """Whether rates differ by over a percent: those of triggered cameras differ a little."""
    rates = list(rates)
    return bool(rates) and max(rates) > 1.01 * min(rates)


def matched_by_time(
    path: Path, readers: Mapping[str, FrameReader], times: Mapping[str, Times], earliest: bool
) -> tuple[dict[str, FrameReader], NDArray[np.int64], float, Times]:
    """Readers of the frames that match in time, their numbers on an even grid (M,) int64, frames
    per second, and times since the first, s. InputError as of `match_frames`.

    Args:
        path: source of the times, for messages.
        earliest: whether the first is that of the camera that began first, not the first match.
    """
    times_s, rows = match_frames(times, path)
    matched = {name: reader.select(rows[name].tolist()) for name, reader in readers.items()}
    numbers, period = even_numbers(times_s)
    begin_s = min(float(taken[0]) for taken in times.values()) if earliest else float(times_s[0])
    numbers = numbers + round((times_s[0] - begin_s) / period)
    return matched, numbers, round(1 / period, 6), times_s - begin_s


def even_numbers(times: Times) -> tuple[NDArray[np.int64], float]:
    """Numbers (frames,) int64, from 0, of the moments of an even grid at which frames were taken,
    and the time between two of those; a lost frame is a number that is left out.

    Args:
        times: (frames,), increasing.
    """
    order = np.arange(len(times), dtype=np.int64)
    if len(times) < 2:
        return order, 1.0
    passed = times - times[0]
    numbers = np.concatenate([[0], np.cumsum(1 + lost_between(times))])
    period = float(passed[-1] / numbers[-1])
    if (np.abs(passed - numbers * period) < 0.5 * period).all():
        return numbers, period
    # The rate drifts: numbers follow the clock, at the highest rate that lasts.
    some = max(min(len(times) // 4, _LASTING), 1)
    period = float(np.quantile(times[some:] - times[:-some], 0.1)) / some
    numbers = np.rint(passed / period).astype(np.int64)
    return np.maximum.accumulate(numbers - order) + order, period


def lost_between(times: Times) -> NDArray[np.int64]:
    """How many frames (frames - 1,) int64 were lost between each two, by their usual distance.

    Args:
        times: (frames,), increasing.
    """
    steps = np.diff(times)
    return np.maximum(np.rint(steps / np.median(steps)).astype(np.int64) - 1, 0)


def spans_text(times: Mapping[str, Times]) -> str:
    """From when to when cameras filmed, for messages."""
    return ", ".join(
        f"{name} {taken[0]:.3f} to {taken[-1]:.3f} s" for name, taken in times.items() if len(taken)
    )


def _period(times: Times) -> float:
    """Usual time between two frames; 0 of a single one."""
    return float(np.median(np.diff(times))) if len(times) > 1 else 0.0


def _nearest(times: Times, instants: Times) -> NDArray[np.int64]:
    """Returns the number of the frame nearest to each instant."""
    after = np.clip(np.searchsorted(times, instants), 1, max(1, len(times) - 1))
    before = after - 1
    after = np.minimum(after, len(times) - 1)
    earlier = instants - times[before] <= times[after] - instants
    return np.where(earlier, before, after).astype(np.int64)
