"""When frames were taken as their files tell: presentation times of videos, numbers of images."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from voxelpose.recording.frame_reader import FrameReader
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
    None where frame n was taken at one moment by all. And what is to be told.

    Args:
        folder: the recording folder.
        readers: frame readers by camera name, none of them selected.
        fps: frames per second, before timestamps.csv and what videos tell.
        together: whether cameras that did not stop together are refused.

    Raises:
        InputError: the rate is impossible, the times are damaged, or cameras did not stop together.
    """
    if fps is not None:
        checked_rate(fps, "--fps", "correct it")
    elif (folder / TIMESTAMPS).exists():
        return read_timestamps(folder / TIMESTAMPS, readers)
    file_times = times_in_files(readers, fps)
    if file_times is not None:
        if together:
            _check_ends(folder, file_times.times)
        return file_times.times, (file_times.note,)
    aside = None if fps is None else times_in_files(readers)
    return None, () if aside is None else (f"{aside.faults}: --fps sets them aside",)


@dataclass(frozen=True, eq=False)
class FileTimes:
    """Times of the frames of cameras whose frames of one number were not all taken at once.

    Attributes:
        times: (frames,) float64, s, by camera name.
        faults: what the cameras lost, or how they differ, and what tells so, in words.
    """

    times: dict[str, Times]
    faults: str

    @property
    def note(self) -> str:
        """What is to be told."""
        used = "frames are paired by them" if len(self.times) > 1 else "frames keep their times"
        return f"{self.faults}: {used}"


def times_in_files(
    readers: Mapping[str, FrameReader], fps: float | None = None
) -> FileTimes | None:
    """Times that the files tell, by which cameras lost frames, began late or film at a varying
    rate; None where they tell no such thing, so that frame n is the same moment in all.

    Args:
        readers: frame readers by camera name, none of them selected.
        fps: frames per second, before what videos tell.
    """
    rate = fps or next((reader.fps for reader in readers.values() if reader.fps), None)
    if rate is None:
        return None
    stills = {name: image_numbers(reader.stills) for name, reader in readers.items()}
    images = {name: numbers for name, numbers in stills.items() if numbers is not None}
    counted, times = _common_numbers(images), dict[str, Times]()
    for name, reader in readers.items():
        times[name] = np.arange(reader.frame_count) / (fps or reader.fps or rate)
        if name in counted:
            times[name] = counted[name] / rate
        elif fps is None and reader.shown_s is not None:
            times[name] = reader.shown_s
    faults = [(_fault(taken, images.get(name)), name) for name, taken in times.items()]
    faults += _late_starts(times, images)
    named = {words: [name for fault, name in faults if fault == words] for words, _ in faults}
    listed = [f"{', '.join(names)} {words}" for words, names in named.items() if words]
    listed += _rates_apart(times)
    source = "numbers of the images" if images else "times in the files"
    return FileTimes(times, f"by the {source}, {'; '.join(listed)}") if listed else None


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


def image_numbers(stills: Sequence[Path]) -> NDArray[np.int64] | None:
    """Numbers (n,) in the names of n images, increasing: of their groups of digits the one that
    changes; None where none, or more than one, does.
    """
    groups = [re.findall(r"\d+", path.stem) for path in stills]
    if not groups or len({len(words) for words in groups}) > 1:
        return None
    changing = [column for column in zip(*groups, strict=True) if len({*column}) > 1]
    if (len(groups) > 1 and len(changing) != 1) or not groups[0]:
        return None
    words = changing[0] if changing else groups[0][-1:]
    if max(map(len, words)) > 18:  # digits that an integer holds
        return None
    numbers = np.array([int(word) for word in words], np.int64)
    return numbers if (np.diff(numbers) > 0).all() else None


def _common_numbers(numbered: Mapping[str, NDArray[np.int64]]) -> dict[str, Times]:
    """Numbers of the cameras' images, counted in steps from a common begin.

    Where all cover the same, each begins with its first: some count from 0, others from 1.
    """
    if not numbered:
        return {}
    steps = [np.median(np.diff(numbers)) for numbers in numbered.values() if len(numbers) > 1]
    step = max(min(steps, default=1), 1)
    same = len({int(numbers[-1] - numbers[0]) for numbers in numbered.values()}) == 1
    first = min(int(numbers[0]) for numbers in numbered.values())
    return {
        name: (numbers - (numbers[0] if same else first)) / step
        for name, numbers in numbered.items()
    }


def _fault(times: Times, images: NDArray[np.int64] | None) -> str:
    """What a camera lost by its own times, in words; "" where nothing."""
    if np.array_equal(even_numbers(times)[0], np.arange(len(times))):
        return ""
    gaps = lost_between(times)
    lost = int(gaps.sum())
    plural = "" if lost == 1 else "s"
    if images is not None:
        return f"lost {lost} image{plural} ({_missing(images, gaps)})"
    if not lost or 10 * np.count_nonzero(gaps) > len(gaps):
        slow, fast = 1 / np.quantile(np.diff(times), (0.95, 0.05))
        return f"filmed {slow:.4g} to {fast:.4g} frames per second"
    return f"lost {lost} frame{plural}"


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
