"""Times of every camera's frames (timestamps.csv), and the frames that match in time."""

import csv
from array import array
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.atomic import replacing
from calib.documents import csv_rows
from calib.errors import InputError
from voxelpose.recording.frame_reader import FrameReader

TIMESTAMPS = "timestamps.csv"
_LARGEST_BYTES = 500_000_000
_LATEST_S = 10**11  # of any clock that counts seconds
Times = NDArray[np.float64]
"""(frames,) float64, s."""


def read_timestamps(path: Path, readers: Mapping[str, FrameReader]) -> dict[str, Times]:
    """Reads timestamps.csv: cam_id,frame_time, one row per frame in the order of the frames, into
    (frames,) float64, s, by camera name.

    Args:
        path: the file; cam_id is the camera's name, or 1 for cam_1; frame_time is in seconds.
        readers: frame readers by name of the cameras whose times are read.

    Raises:
        InputError: the file is not such a table, or does not fit the videos.
    """
    listed: dict[str, array[float]] = {}
    for number, row in enumerate(csv_rows(path, ("cam_id", "frame_time"), _LARGEST_BYTES), 2):
        try:
            camera, time = row["cam_id"].strip(), float(row["frame_time"])
        except (KeyError, ValueError):
            raise InputError(
                f"{path} line {number} is not cam_id,frame_time (seconds, as 0.25): correct it, or"
                " remove the file"
            ) from None
        if camera in readers or f"cam_{camera}" in readers:
            listed.setdefault(camera, array("d")).append(time)
    times: dict[str, Times] = {}
    for name, reader in readers.items():
        own = [taken for camera, taken in listed.items() if name in (camera, f"cam_{camera}")]
        times[name] = np.concatenate([np.zeros(0), *own])
        if len(times[name]) == reader.promised:
            times[name] = times[name][: reader.frame_count]  # it lacks the last ones
        if len(times[name]) != reader.frame_count:
            raise InputError(
                f"{path} has {len(times[name])} times for camera {name}, its video"
                f" {reader.frame_count} frames: correct or remove it"
            )
        if len(times[name]) and not np.abs(times[name]).max() < _LATEST_S:
            raise InputError(
                f"{path}: the times of camera {name} are not all numbers of seconds: correct or"
                " remove it"
            )
        if (np.diff(times[name]) <= 0).any():
            raise InputError(
                f"{path}: the times of camera {name} do not increase: correct or remove it"
            )
    return times


def write_timestamps(path: Path, times: Mapping[str, Times]) -> None:
    """Writes timestamps.csv.

    Args:
        times: (frames,) s, by camera name.

    Raises:
        InputError: the file cannot be written.
    """
    with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["cam_id", "frame_time"])
        table.writerows((name, f"{time:.6f}") for name in times for time in times[name])


def match_frames(
    times: Mapping[str, Times], path: Path
) -> tuple[Times, dict[str, NDArray[np.int64]]]:
    """Times (M,), s, and frame numbers (M,) int64 by camera name, of frames that match in time.

    The camera with the lowest rate is the reference; among equally slow ones, the camera to which
    the others' frames are nearest. Every frame of the reference is matched with the frame of every
    other camera that is nearest in time. Times at which a camera has no frame are left out.

    Args:
        times: (frames,) s, by camera name.
        path: source of the times, for messages.

    Raises:
        InputError: there is no time at which all cameras have a frame.
    """
    periods = {
        name: float(np.median(np.diff(taken))) if len(taken) > 1 else 0.0
        for name, taken in times.items()
    }
    slowest = max(periods.values())
    # A frame matches within half a period of its own camera, or a quarter of the longest period.
    tolerance = np.array([0.5 * max(period, 0.5 * slowest) for period in periods.values()]) + 1e-6
    best: tuple[float, Times, dict[str, NDArray[np.int64]]] | None = None
    for reference, instants in times.items():
        if periods[reference] < 0.99 * slowest:
            continue
        numbers = {name: _nearest(taken, instants) for name, taken in times.items()}
        offset = np.stack([np.abs(times[name][numbers[name]] - instants) for name in times])
        kept = (offset <= tolerance[:, None]).all(axis=0)
        if not kept.any():
            continue
        # Of equally near references, that with the most matches is taken.
        cost = float(offset[:, kept].mean()) - 1e-9 * kept.sum()
        if best is None or cost < best[0]:
            best = cost, instants[kept], {name: rows[kept] for name, rows in numbers.items()}
    if best is None:
        spans = ", ".join(
            f"{name} {taken[0]:.3f} to {taken[-1]:.3f} s"
            for name, taken in times.items()
            if len(taken)
        )
        raise InputError(f"{path}: at no moment all cameras filmed ({spans}): correct or remove it")
    return best[1:]


def times_by_rate(
    folder: Path, readers: Mapping[str, FrameReader], fps: float | None
) -> tuple[float, Times]:
    """Frames per second and the time of every frame since the first, s, of readers in step.

    Args:
        folder: the recording folder, for messages.
        readers: frame readers by camera name.
        fps: frames per second, before what the files state; None: as they state.

    Raises:
        InputError: the rate is not known, impossible, or not the same in all files.
    """
    count = min(reader.frame_count for reader in readers.values())
    if fps is not None:
        if not (np.isfinite(fps) and fps > 0):
            raise InputError(
                f"{fps} frames per second are impossible: give --fps as a positive number"
            )
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
    return rate, np.arange(count) / rate


def rates_differ(rates: Iterable[float]) -> bool:
    """Whether rates differ by over a percent: those of triggered cameras differ a little."""
    rates = list(rates)
    return bool(rates) and max(rates) > 1.01 * min(rates)


def matched_by_time(
    path: Path, readers: Mapping[str, FrameReader]
) -> tuple[dict[str, FrameReader], float, Times]:
    """Readers of the frames that match in time, frames per second, and times since the first, s.

    Raises:
        InputError: as of `read_timestamps` and `match_frames`.
    """
    times_s, numbers = match_frames(read_timestamps(path, readers), path)
    matched = {name: reader.select(numbers[name].tolist()) for name, reader in readers.items()}
    rate = 1 / float(np.median(np.diff(times_s))) if len(times_s) > 1 else 1.0
    return matched, rate, times_s - times_s[0]


def _nearest(times: Times, instants: Times) -> NDArray[np.int64]:
    """Returns the number of the frame nearest to each instant."""
    after = np.clip(np.searchsorted(times, instants), 1, max(1, len(times) - 1))
    before = after - 1
    after = np.minimum(after, len(times) - 1)
    earlier = instants - times[before] <= times[after] - instants
    return np.where(earlier, before, after).astype(np.int64)
