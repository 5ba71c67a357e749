"""When every camera took its frames: timestamps.csv, and which frames belong together."""

import csv
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from voxelpose.recording.frame_reader import FrameReader

NAME = "timestamps.csv"
Times = NDArray[np.float64]


def read_timestamps(path: Path, readers: Mapping[str, FrameReader]) -> dict[str, Times]:
    """Reads rows of cam_id (the camera's name, or 1 for cam_1) and frame_time (seconds), in the
    order of the frames.

    Args:
        path: the file.
        readers: the cameras that need times.

    Returns:
        (frames,) float64, s, by camera name.

    Raises:
        InputError: the file is no such table, or does not fit the videos.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [
                (row["cam_id"].strip(), float(row["frame_time"])) for row in csv.DictReader(file)
            ]
    except (KeyError, AttributeError, TypeError, ValueError, OSError) as error:
        raise InputError(
            f"{path} is not a table of cam_id,frame_time (seconds): {error}; correct or remove it"
        ) from None
    times: dict[str, Times] = {}
    for name, one in readers.items():
        of_camera = np.array([time for camera, time in rows if name in (camera, f"cam_{camera}")])
        if len(of_camera) != one.frame_count:
            raise InputError(
                f"{path} has {len(of_camera)} times for camera {name}, its video {one.frame_count}"
                " frames: correct or remove it"
            )
        if not np.isfinite(of_camera).all() or (np.diff(of_camera) <= 0).any():
            raise InputError(
                f"{path}: the times of camera {name} do not increase: correct or remove it"
            )
        times[name] = of_camera
    return times


def write_timestamps(path: Path, times: Mapping[str, Times]) -> None:
    """Writes when every camera took its frames, (frames,) s; the file appears whole or not at all.

    Raises:
        InputError: it cannot be written.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with beside.open("w", newline="", encoding="utf-8") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(["cam_id", "frame_time"])
            table.writerows(
                (name, f"{time:.6f}") for name, of_camera in times.items() for time in of_camera
            )
        beside.replace(path)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        beside.unlink(missing_ok=True)


def in_step(times: Mapping[str, Times], path: Path) -> tuple[Times, dict[str, NDArray[np.int64]]]:
    """Finds which frames were taken at the same moment.

    The slowest camera is the clock (of equally slow ones, that to which the others come nearest):
    at each of its frames, every other camera gives the frame that is nearest in time. Moments
    without a frame of every camera are left out.

    Args:
        times: (frames,) s, by camera name.
        path: where they come from, for messages.

    Returns:
        The moments (M,), s, and by camera (M,) the frame's number.

    Raises:
        InputError: at no moment all cameras filmed.
    """
    periods = {
        name: float(np.median(np.diff(one))) if len(one) > 1 else 0.0 for name, one in times.items()
    }
    slowest = max(periods.values())
    best: tuple[float, Times, dict[str, NDArray[np.int64]]] | None = None
    for clock, moments in times.items():
        if periods[clock] < 0.99 * slowest:
            continue
        numbers = {name: _nearest(one, moments) for name, one in times.items()}
        away = np.stack([np.abs(times[name][numbers[name]] - moments) for name in times])
        reach = np.array([0.5 * max(periods[name], 0.5 * slowest) for name in times]) + 1e-6
        kept = (away <= reach[:, None]).all(axis=0)
        if not kept.any():
            continue
        spread = (
            float(away[:, kept].mean()) - 1e-9 * kept.sum()
        )  # of equally near ones, that with the most moments
        if best is None or spread < best[0]:
            best = spread, moments[kept], {name: one[kept] for name, one in numbers.items()}
    if best is None:
        spans = ", ".join(
            f"{name} {one[0]:.3f} to {one[-1]:.3f} s" for name, one in times.items() if len(one)
        )
        raise InputError(f"{path}: at no moment all cameras filmed ({spans}): correct or remove it")
    return best[1], best[2]


def _nearest(times: Times, moments: Times) -> NDArray[np.int64]:
    """Returns the number of the frame nearest to each moment."""
    after = np.clip(np.searchsorted(times, moments), 1, max(1, len(times) - 1))
    before = after - 1
    after = np.minimum(after, len(times) - 1)
    return np.where(moments - times[before] <= times[after] - moments, before, after).astype(
        np.int64
    )
