"""When frames were taken as their files tell: presentation times of videos, names of images."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from voxelpose.recording.frame_reader import FrameReader
from voxelpose.recording.image_names import NameReading, names_by_camera
from voxelpose.recording.timestamps import (
    TIMESTAMPS,
    Times,
    checked_rate,
    even_numbers,
    lost_between,
    match_frames,
    rates_differ,
    read_timestamps,
    spans_text,
)

_LISTED = 3  # ranges of missing images


def recorded_times(
    folder: Path,
    readers: Mapping[str, FrameReader],
    fps: float | None = None,
    together: bool = False,
) -> tuple[dict[str, Times] | None, tuple[str, ...]]:
    """Times of the frames, (frames,) float64, s, by camera, as timestamps.csv tells, or the files;
    None where frame n was taken at one moment by all. And what is to be told. InputError where the
    rate is impossible, the times are damaged, or cameras did not stop together.

    Args:
        readers: frame readers by camera name, none of them selected.
        fps: frames per second, before timestamps.csv and what videos tell.
        together: whether cameras that did not stop together are refused.
    """
    if fps is not None:
        checked_rate(fps, "--fps", "correct it")
    elif (folder / TIMESTAMPS).exists():
        return read_timestamps(folder / TIMESTAMPS, readers)
    file_times, notes = times_in_files(readers, fps)
    if file_times is not None:
        if together:
            _check_ends(folder, file_times.times)
        return file_times.times, (*notes, file_times.note)
    videos = {name: reader for name, reader in readers.items() if not reader.stills}
    aside = None if fps is None else times_in_files(videos)[0]
    return None, notes if aside is None else (*notes, f"{aside.faults}: --fps sets them aside")


@dataclass(frozen=True, eq=False)
class FileTimes:
    """Times of the frames of cameras whose frames of one number were not all taken at once."""

    times: dict[str, Times]  #: (frames,) float64, s, by camera name.
    faults: str  #: what the cameras lost, or how they differ, and what tells so, in words.

    @property
    def note(self) -> str:
        """What is to be told."""
        used = "frames are paired by them" if len(self.times) > 1 else "frames keep their times"
        return f"{self.faults}: {used}"


def times_in_files(
    readers: Mapping[str, FrameReader], fps: float | None = None
) -> tuple[FileTimes | None, tuple[str, ...]]:
    """Times that the files tell, by which cameras lost frames, began late or film at a varying
    rate; None where they tell no such thing, so that frame n is the same moment in all. And what
    else is to be told. InputError where the names of images may be understood in several ways.

    Args:
        readers: frame readers by camera name, none of them selected.
        fps: frames per second, before what files tell.
    """
    images = {name: reader.stills for name, reader in readers.items() if reader.stills}
    named, notes = _comparable(images)
    rate = fps or next((reader.fps for reader in readers.values() if reader.fps), None)
    clock_fps = 0.0
    if any(reading.kind == "time" for reading in named.values()):
        clock_fps = 1 / min(even_numbers(reading.values)[1] for reading in named.values())
        words = f"by the times in the names of the images {clock_fps:.4g} were taken per second"
        if fps is None:
            rate = clock_fps
        elif rates_differ([clock_fps, fps]):
            notes += (f"{words}: --fps {fps:g} is used",)
    if rate is None:
        return None, notes
    counted, begins = _common_numbers(named)
    times = dict[str, Times]()
    for name, reader in readers.items():
        times[name] = np.arange(reader.frame_count) / (fps or reader.fps or rate)
        if name in counted:
            times[name] = counted[name] / rate
        elif fps is None and reader.shown_s is not None:
            times[name] = reader.shown_s
    numbers = {
        name: reading.values.astype(np.int64)
        for name, reading in named.items()
        if reading.kind == "number"
    }
    faults = [
        (_fault(taken, numbers.get(name), "image" if name in images else "frame"), name)
        for name, taken in times.items()
    ]
    faults += _late_starts(times, numbers)
    labelled = {words: [name for fault, name in faults if fault == words] for words, _ in faults}
    listed = [f"{', '.join(names)} {words}" for words, names in labelled.items() if words]
    listed += _rates_apart(times)
    if clock_fps and fps is None:
        listed = listed or [f"{clock_fps:.4g} were taken per second"]
    source = "numbers" if len(numbers) == len(named) else "times in the names"
    source = f"{source} of the images" if named else "times in the files"
    notes += begins
    return FileTimes(times, f"by the {source}, {'; '.join(listed)}") if listed else None, notes


def _comparable(
    images: Mapping[str, Sequence[Path]],
) -> tuple[dict[str, NameReading], tuple[str, ...]]:
    """What the names of images tell, by camera, where those of all tell alike; else nothing, and
    that the order counts. InputError where a camera lost images, and others' names do not tell
    which go with those left.
    """
    readings = names_by_camera(images)
    if all(len(paths) < 2 for paths in images.values()):
        return {}, ()
    named = {name: reading for name, reading in readings.items() if reading is not None}
    kinds = {"times" if reading.kind == "time" else "numbers" for reading in named.values()}
    if len(kinds) == 1 and len(named) == len(images):
        return named, ()
    if not named:
        what = f"the names of the images of {', '.join(images)} tell neither numbers nor times"
        return {}, (f"{what}: frames are taken in the order of the names",)
    what = f"not all names of images tell times, or all numbers ({', '.join(images)})"
    if lossy := [name for name, reading in named.items() if reading.lost.any()]:
        raise InputError(
            f"{what}, and by theirs {', '.join(lossy)} lost some: name them alike, or add"
            f" {TIMESTAMPS}"
        )
    return {}, (f"{what}: frames are paired in the order of the names",)


def ends_apart(times: Mapping[str, Times]) -> str:
    """That cameras did not stop together, in words, so that nothing tells that they started
    together; "" where they did.
    """
    ends = [float(taken[-1]) for taken in times.values()]
    slowest = max(even_numbers(taken)[1] for taken in times.values())
    counts = {len(taken) for taken in times.values()}  # a recorder may stop at a number of frames
    together = max(ends) - min(ends) <= 1.5 * slowest or len(counts) == 1
    return "" if together else f"cameras did not stop together ({spans_text(times)})"


def _check_ends(folder: Path, times: Mapping[str, Times]) -> None:
    doubt = ends_apart(times)
    if doubt:
        instants, _ = match_frames(times, folder)
        numbers, period = even_numbers(instants)
        numbers += round((instants[0] - min(float(taken[0]) for taken in times.values())) / period)
        raise InputError(
            f"{folder}: {doubt}: if their clocks agree, give --frames 0:{numbers[-1] + 1}, which"
            f" pairs frames by time; if not, `voxelpose calibrate sync` finds by how much, and"
            f" writes {TIMESTAMPS}"
        )


def _common_numbers(named: Mapping[str, NameReading]) -> tuple[dict[str, Times], tuple[str, ...]]:
    """Numbers of the cameras' images, counted in steps from a common begin, and what is to be told.
    InputError where it is not sure whether they do.

    Where all count as many, each begins with its first: some count from 0, others from 1.
    """
    if not named:
        return {}, ()
    values = {name: reading.values for name, reading in named.items()}
    first = min(float(numbers[0]) for numbers in values.values())
    same, notes = False, ()
    if any(reading.kind != "number" for reading in named.values()):
        step = min(even_numbers(numbers)[1] for numbers in values.values() if len(numbers) > 1)
    else:
        usual = [np.median(np.diff(numbers)) for numbers in values.values() if len(numbers) > 1]
        step = max(min(usual, default=1), 1)
        same = len({numbers[-1] - numbers[0] for numbers in values.values()}) == 1
    firsts = {int(numbers[0]) for numbers in values.values()}
    if same and len(firsts) > 1 and not firsts <= {0, 1}:
        listed = ", ".join(f"{name} from {int(numbers[0])}" for name, numbers in values.items())
        if max(firsts) <= min(numbers[-1] for numbers in values.values()):
            raise InputError(
                f"images are numbered from different numbers on ({listed}): where those of one"
                " number belong together, remove those that a camera lacks; where the first ones"
                " do, number each camera's from 0"
            )
        notes = (
            f"images are numbered from different numbers on ({listed}): the first ones are"
            " taken to belong together",
        )
    return {
        name: (numbers - (numbers[0] if same else first)) / step for name, numbers in values.items()
    }, notes


def _fault(times: Times, images: NDArray[np.int64] | None, noun: str) -> str:
    """What a camera lost by its own times, in words; "" where nothing."""
    if np.array_equal(even_numbers(times)[0], np.arange(len(times))):
        return ""
    gaps = lost_between(times)
    lost = int(gaps.sum())
    plural = "" if lost == 1 else "s"
    if images is not None:
        return f"lost {lost} {noun}{plural} ({_missing(images, gaps)})"
    if not lost or 10 * np.count_nonzero(gaps) > len(gaps):
        slow, fast = 1 / np.quantile(np.diff(times), (0.95, 0.05))
        return f"filmed {slow:.4g} to {fast:.4g} frames per second"
    return f"lost {lost} {noun}{plural}"


def _missing(images: NDArray[np.int64], gaps: NDArray[np.int64]) -> str:
    """Numbers that are not among those of images, as text."""
    step, gap = int(np.median(np.diff(images))), np.flatnonzero(gaps)
    ends = [(int(images[k]) + step, int(images[k + 1]) - step) for k in gap.tolist()]
    listed = [f"{a} to {b}" if b > a else f"{a}" for a, b in ends[:_LISTED]]
    return ", ".join(listed) + (" and more" if len(ends) > _LISTED else "")


def _late_starts(
    times: Mapping[str, Times], images: Mapping[str, NDArray[np.int64]]
) -> list[tuple[str, str]]:
    """By how much cameras began later than the first, in words, and their names."""
    earliest = min(float(taken[0]) for taken in times.values())
    half = min(even_numbers(taken)[1] for taken in times.values()) / 2
    late = {name: float(taken[0]) - earliest for name, taken in times.items()}
    return [
        (f"began {f'with image {images[name][0]}' if name in images else f'{s:.3f} s later'}", name)
        for name, s in late.items()
        if s >= half
    ]


def _rates_apart(times: Mapping[str, Times]) -> list[str]:
    """That rates differ so little that the cameras' numbers of frames alone tell it, in words."""
    periods = {name: even_numbers(taken)[1] for name, taken in times.items()}
    counts = {len(taken) for taken in times.values()}
    drift = min(counts) * (max(periods.values()) - min(periods.values()))
    rates = {name: 1 / period for name, period in periods.items()}
    if len(counts) == 1 or rates_differ(rates.values()) or 2 * drift < min(periods.values()):
        return []
    listed = ", ".join(f"{name} {rate:.6g}" for name, rate in rates.items())
    return [f"rates differ ({listed} frames per second)"]
