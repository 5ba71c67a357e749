"""What the names of a camera's images tell: their order, and a counter, or the times at which they
were taken.

A name may hold several groups of digits: a date and a time, seconds and a part of them, a counter
and a time. All names of a camera are read together, in every way that fits all of them. Ways that
disagree, so that frames would be paired otherwise, are asked about.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from itertools import pairwise, product
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from voxelpose.recording.timestamps import PER_SECOND, lost_between, possible_rate

_SIGN = r"(?:(?<![^\W_])-)?"  # a dash after a letter or digit parts words
_NUMBER = re.compile(rf"{_SIGN}\d+(?:[.,]\d+)?")
_DATES = (
    r"((?:19|20)\d\d)(\d\d)(\d\d)\D{0,2}",
    r"((?:19|20)\d\d)\D(\d\d?)\D(\d\d?)\D{1,4}",
    r"\d\d?\D\d\d?\D((?:19|20)\d\d)()()\D{1,4}",  # whether day or month comes first
)
_NO_DATES = "()()()", r"()()()\d{6}\D"  # the latter of years without their century
_CLOCKS = (r"(\d\d)(\d\d)(\d\d)", r"(\d\d?)\D(\d\d?)\D(\d\d?)")
_PART = r"(?:([^\dA-Za-z+]?|s)(\d{1,9}))?(Z|[+-]\d\d:?\d\d|\W?[ap]m\b)?(?!\d)"
_DATED, _CLOCK = (
    [re.compile(rf"(?<!\d){date}{clock}{_PART}", re.IGNORECASE) for date, clock in product(*each)]
    for each in ((_DATES, _CLOCKS), (_NO_DATES, _CLOCKS))
)
_HALF_DAY = re.compile(r"(?<![^\W\d_])[ap]m\b", re.IGNORECASE)
_TIMECODE_RATES = (24, 25, 30, 48, 50, 60, 100, 120)  # frames per second
_DAY_S = timedelta(days=1).total_seconds()
_HOUR_S = timedelta(hours=1).total_seconds()
_HEX = re.compile(r"(?<![^\W_])[0-9a-f]{1,15}(?![^\W_])", re.IGNORECASE)
_COUNTS = tuple(PER_SECOND.values())[1:]  # of a clock in a second
_SINCE_1970 = {9 + len(str(count)): count for count in _COUNTS}  # by the digits of the time
_MOST_DIGITS = 18  # of a counter
_RENAME = "rename them by their numbers alone (0001.png ...)"

_JOINED = (".", ",", "_", "-", " ", ":")  # between seconds and their part

Kind = Literal["number", "ticks", "time"]


@dataclass(frozen=True, eq=False)
class NameReading:
    """A way of reading the names of a camera's images."""

    kind: Kind  #: "number", of a counter; "ticks", of a clock of unknown unit; "time", s.
    order: NDArray[np.int64]  #: (n,) int64, places of the images in their order.
    values: NDArray[np.float64]
    """(n,) float64, what the images' names tell, in that order, increasing."""
    words: str  #: how the first name is read.

    @property
    def lost(self) -> NDArray[np.int64]:
        """How many images (n - 1,) int64 are missing between each two."""
        return lost_between(self.values) if len(self.values) > 1 else np.zeros(0, np.int64)

    @property
    def plausible(self) -> bool:
        """Whether at least half of the steps are alike, and times are those of a camera."""
        if len(self.values) < 2:
            return True
        usual, alike = _usual_step(np.diff(self.values))
        return 2 * alike >= len(self.values) - 1 and (
            self.kind != "time" or possible_rate(1 / usual)
        )


@dataclass(frozen=True, eq=False)
class _ImageNames:
    """The names of a camera's images."""

    order: NDArray[np.int64]  #: (n,) int64, places of the images in their order.
    reading: NameReading | None = None
    """What the names tell; None: no number or time of each image."""
    question: str = ""  #: why that is not sure, and the remedy, in words; "" where it is.

    @classmethod
    def of(cls, paths: Sequence[Path], clock: bool = False) -> "_ImageNames":
        """The names of the images of one camera.

        Args:
            clock: whether other cameras' names are known to tell times of a clock.
        """
        stems = [path.stem for path in paths]
        natural = np.array(sorted(range(len(paths)), key=lambda k: natural_order(paths[k])), int)
        if twice := [stem for stem, count in Counter(stems).items() if count > 1]:
            names = " and ".join(sorted(p.name for p in paths if p.stem == twice[0])[:2])
            return cls(natural, None, f"holds {names}: remove one")
        shapes = [_HALF_DAY.sub("am", _NUMBER.sub("\0", stem)) for stem in stems]
        counts = Counter(shapes)
        if len(counts) > 1 and (hexadecimal := _hexadecimal(stems)) is not None:
            return cls(hexadecimal.order, hexadecimal)
        usual, count = counts.most_common(1)[0] if counts else ("", 0)
        if "\0" not in usual or 2 * count <= len(stems):
            return cls(natural)
        if count < len(stems):
            odd = next(p.name for p, shape in zip(paths, shapes, strict=True) if shape != usual)
            usually = paths[shapes.index(usual)].name
            question = f"holds {odd} among images that are named as {usually}: move it out"
            return cls(natural, None, question)
        return _decided(_Columns.of(stems), natural, clock)


@dataclass(frozen=True, eq=False)
class _Columns:
    """Groups of digits in names that are alike but for these."""

    stems: list[str]
    words: list[list[str]]  #: each group in all names.
    before: list[str]  #: what stands between each group and the one before it.
    spans: list[tuple[int, int]]  #: where each group stands in the first name.

    @classmethod
    def of(cls, stems: list[str]) -> "_Columns":
        words, before, spans, end = [], [], [], 0
        numbers = zip(*map(_NUMBER.findall, stems), strict=True)
        for group, match in zip(numbers, _NUMBER.finditer(stems[0]), strict=True):
            parts = [re.split("[.,]", word) for word in group]
            many = max(map(len, parts))
            words += [[(*part, "0")[k] for part in parts] for k in range(many)]
            before += [stems[0][end : match.start()], "."][:many]
            spans += [match.span()] * many
            end = match.end()
        return cls(stems, words, before, spans)

    @property
    def changing(self) -> list[int]:
        """Groups that are not the same in all names."""
        return [k for k, words in enumerate(self.words) if len({*words}) > 1]

    def times(self, clock: bool) -> Iterator[tuple[set[int], NameReading | None, Sequence[float]]]:
        """Yields the groups of what may be a time, its reading, and that time in all names, s.

        Args:
            clock: whether other cameras' names are known to tell times of a clock.
        """
        covered, words = set[int](), f"the time in {self.stems[0]}"
        for pattern in (*_DATED, *_CLOCK):
            matches = [[*pattern.finditer(stem)] for stem in self.stems]
            if covered or len({*map(len, matches)}) > 1:
                continue
            for place in zip(*matches, strict=True):
                start, end = place[0].span()
                groups = {k for k, (a, b) in enumerate(self.spans) if start < b and a < end}
                for seconds in _moments([match.groups("") for match in place]):
                    reading = _reading("time", seconds, words)
                    if pattern in _DATED or (reading is not None and reading.plausible):
                        covered = groups
                        yield groups, reading, seconds
        for k, group in enumerate(self.words):
            digits = {len(word) for word in group}
            if len(digits) == 1 and (per_second := _SINCE_1970.get(*digits)):
                seconds = [int(word) / per_second for word in group]
                if all(10**9 <= second < 3 * 10**9 for second in seconds):
                    yield {k}, _reading("time", seconds, words), seconds
            if k and not {k - 1, k} & covered and self.before[k] in _JOINED:
                for kind, seconds in self._seconds(k, clock):
                    reading = _reading(kind, seconds, words)
                    if reading is not None and reading.plausible and self._follows(reading, k):
                        yield {k - 1, k}, reading, seconds

    def _follows(self, reading: NameReading, k: int) -> bool:
        """Whether the groups before k - 1, which may be minutes, increase as a reading does."""
        before = ([float(word) for word in self.words[other]] for other in range(k - 1))
        return all(_goes_along(reading.order, values) for values in before)

    def _seconds(self, k: int, clock: bool) -> Iterator[tuple[Kind, list[float]]]:
        """Yields seconds of group k - 1 with their part in group k."""
        whole, decimal, kind = self.words[k - 1], self.before[k] in (".", ","), "time"
        if max(map(len, whole)) > _MOST_DIGITS:
            return
        since_1970 = all(len(word) == 10 and word[0] in "12" for word in whole)
        if not (clock or since_1970 or 1 < len({*whole}) < len(whole)):
            if not decimal or 1 < len({*whole}) < len(whole) or not any(map(int, self.words[k])):
                return  # two counters, or a camera and a counter
            if len({*whole}) == 1:  # a camera, a take, or all of one second
                whole = ["0"] * len(whole)
            kind = "ticks"
        for part in _parts(self.words[k], whole, decimal):
            signs = (-1 if word[0] == "-" else 1 for word in whole)
            yield kind, [int(w) + s * share for w, s, share in zip(whole, signs, part, strict=True)]

    def counter(self, k: int) -> NameReading | None:
        """Reading of a group as a number."""
        if max(map(len, self.words[k])) > _MOST_DIGITS:
            return None
        numbers = [int(word) for word in self.words[k]]
        steps = np.diff(np.unique(numbers))
        ticks = len(steps) and (steps % steps.min()).any()
        return _reading("ticks" if ticks else "number", numbers, f"the number {self.words[k][0]}")


def _reading(kind: Kind, values: Sequence[float], words: str) -> NameReading | None:
    """A reading of names by their values; None where two have the same."""
    numbers = np.array(values, np.float64)
    order = np.argsort(numbers, kind="stable")
    if (np.diff(numbers[order]) <= 0).any():
        return None
    return NameReading(kind, order.astype(np.int64), numbers[order], words)


def _moments(groups: Sequence[tuple[str, ...]]) -> Iterator[list[float]]:
    """Yields the seconds of dates and times of day with their parts, as the patterns group them."""
    whole, zones = list[float](), list[float]()
    for year, month, day, hour, minute, second, _, _, zone in groups:
        try:
            date = datetime(int(year or 1970), int(month or 1), int(day or 1), tzinfo=UTC)
            half = zone[-2:].lower()
            past = int(hour) % 12 + 12 * (half == "pm") if half in ("am", "pm") else int(hour)
            moment = date.replace(hour=past, minute=int(minute), second=int(second))
        except ValueError:
            return
        away = re.sub(r"\D", "", zone).zfill(4)
        zones.append((-1 if zone[:1] == "-" else 1) * 60 * (60 * int(away[:2]) + int(away[2:])))
        whole.append(moment.timestamp())
    dated, joint = bool(groups[0][0]), {group[6] for group in groups if group[7]}
    if not dated and (joint in ({""}, set()) or not 1 < len({*whole}) < len(whole)):
        return
    none = "0" * max(len(group[7]) for group in groups)  # as some write a whole second
    words, decimal = [group[7] or none for group in groups], joint <= {".", ","}
    parts = list(_parts(words, whole, decimal)) if len(joint) == 1 else []
    numbers = [int(word or 0) for word in words]
    if not parts and len({*numbers}) < len(numbers) and max(numbers) + 1 in _TIMECODE_RATES:
        parts = [[number / (max(numbers) + 1) for number in numbers]]
    for part in parts or [0.0] * dated:
        seconds = np.array(whole) + part - zones
        if not groups[0][2] and np.ptp(seconds) > _DAY_S / 2:  # past midnight
            seconds = np.where(seconds < _DAY_S / 2, seconds + _DAY_S, seconds)
        yield (seconds if any(group[8] for group in groups) else _past_summer(seconds)).tolist()


def _past_summer(seconds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Times that go on where the clock was changed by an hour, in a take of under half an hour."""
    steps = np.diff(np.sort(seconds))
    if not len(steps) or steps.max() <= _HOUR_S / 2:
        return seconds
    before = seconds <= np.sort(seconds)[steps.argmax()]
    close = 2 * np.median(steps)
    if abs(np.ptp(seconds) - _HOUR_S) < close:  # those at the end of the hour were the first
        return seconds + _HOUR_S * before
    return seconds - _HOUR_S * (~before & (abs(steps.max() - _HOUR_S) < close))


def _parts(words: Sequence[str], whole: Sequence[object], decimal: bool) -> Iterator[list[float]]:
    """Yields parts of a second as groups of digits tell them: decimals, or numbers of thousandths,
    millionths or billionths.

    Args:
        decimal: whether a decimal point stands between.
    """
    numbers = [int(word) for word in words]
    ordered = sorted(zip(map(float, map(str, whole)), numbers, strict=True))
    steps = [b - a for (one, a), (other, b) in pairwise(ordered) if one == other]
    counted = bool(steps) and float(np.median(steps)) <= 1  # within each second
    if len({len(word) for word in words}) == 1:
        if decimal or not counted:
            yield [number / 10 ** len(words[0]) for number in numbers]
        return
    if decimal and all(word[-1] != "0" or not int(word) for word in words):
        yield [float(f"0.{word}") for word in words]
    count = next((count for count in _COUNTS if count > max(numbers)), 0)
    plain = all(str(number) == word for number, word in zip(numbers, words, strict=True))
    if count and plain and not counted:
        yield [number / count for number in numbers]


def _decided(columns: _Columns, natural: NDArray[np.int64], clock: bool) -> _ImageNames:
    """The reading of names that all others agree with, or the question which it is."""
    changing = columns.changing or [len(columns.words) - 1]
    parts = list(columns.times(clock))
    timed = {k for groups, _, _ in parts for k in groups}
    read = [
        groups
        for groups, reading, seconds in parts
        if (reading is not None and reading.plausible)
        and (len(groups.intersection(changing)) > 1 or len({*map(int, seconds)}) > 1)
    ]
    counters = list[NameReading]()
    for k in changing:
        others = [seconds for groups, _, seconds in parts if k not in groups]
        lone = [other for other in changing if other != k and other not in timed]
        others += [[float(word) for word in columns.words[other]] for other in lone]
        # A moment is no counter, nor is any of the groups that change together as a time.
        counter = None if any(k in groups for groups in read) else columns.counter(k)
        if counter is not None and all(_goes_along(counter.order, other) for other in others):
            counters.append(counter)
    times = [reading for _, reading, _ in parts if reading is not None]
    counts = Counter(map(int, columns.words[changing[0]]))
    if len(changing) == 1 and not times and len(counts) < len(columns.stems):
        number, count = counts.most_common(1)[0]
        question = f"holds {count} images of the number {number}: remove all but one"
        return _ImageNames(natural, None, question)
    exact = [counter for counter in counters if counter.kind == "number" and counter.plausible]
    if len(changing) == 1 and exact and not clock:
        return _ImageNames(exact[0].order, exact[0])  # equal steps, whatever stands before them
    return _agreed(times, counters, natural)


def _usual_step(steps: NDArray[np.number]) -> tuple[float, int]:
    """The median of steps, and how many are like it."""
    usual = float(np.median(steps))
    return usual, int(np.count_nonzero(np.abs(steps - usual) <= usual / 4))


def _goes_along(order: NDArray[np.int64], values: Sequence[float]) -> bool:
    """Whether other numbers in the names of images increase as these do, or are no numbers of
    images: all different, in irregular steps.
    """
    along = np.array(values, np.float64)[order]
    if (np.diff(along) >= 0).all():
        return True
    steps = np.diff(np.unique(along))
    return len(steps) + 1 == len(along) and 2 * _usual_step(steps)[1] < len(steps)


def _agreed(
    times: list[NameReading], counters: list[NameReading], natural: NDArray[np.int64]
) -> _ImageNames:
    """Times before counters, unless a counter lacks what the times do not."""
    every = [*times, *counters]
    likely = [reading for reading in every if reading.plausible] or every[: len(every) == 1]
    if not likely:
        return _ImageNames(natural)
    # A counter without gaps may have been given to the images that were stored.
    telling = [one for one in likely if one.kind == "time" or one.lost.any()]
    best = (telling or likely)[0]
    for other in likely:
        same = np.array_equal(other.order, best.order)
        if not same or (other.lost[best.lost == 0] > 0).any():
            question = f"is named so that {best.words} and {other.words} disagree: {_RENAME}"
            return _ImageNames(best.order, best, question)
    return _ImageNames(best.order, best)


def _hexadecimal(stems: Sequence[str]) -> NameReading | None:
    """The reading of names that count in hexadecimal; None where they do not."""
    runs = [_HEX.findall(stem) for stem in stems]
    if len({_HEX.sub("\0", stem) for stem in stems}) > 1:
        return None
    changing = [column for column in zip(*runs, strict=True) if len({*column}) > 1]
    words = [*changing[0]] if len(changing) == 1 else []
    padded = len({len(word) for word in words}) == 1
    counted = padded or not any(word.startswith("0") and word != "0" for word in words)
    if not (counted and any(map(str.isdigit, "".join(words)))):
        return None
    reading = _reading("number", [int(word, 16) for word in words], f"the number {words[0]}")
    few = reading is not None and reading.plausible and reading.lost.sum() < len(words)
    return reading if few else None


def names_by_camera(stills: Mapping[str, Sequence[Path]]) -> dict[str, NameReading | None]:
    """What the names of images tell, by camera; None where they tell nothing. InputError where they
    may be read in several ways, or are several times the same.

    Args:
        stills: the images of each camera, in the order of their names.
    """
    names = {camera: _ImageNames.of(paths) for camera, paths in stills.items()}
    kinds = {one.reading.kind for one in names.values() if one.reading is not None}
    if "time" in kinds and len(kinds) > 1:  # within a second, its part may look like a counter
        timed = {camera: _ImageNames.of(paths, clock=True) for camera, paths in stills.items()}
        names |= {k: one for k, one in timed.items() if one.reading and one.reading.kind == "time"}
    for camera, paths in stills.items():
        question = names[camera].question
        if not question and (names[camera].order != np.arange(len(paths))).any():
            question = f"is named so that its order is not sure: {_RENAME}"
        if question:
            raise InputError(f"{paths[0].parent} {question}")
    return {camera: each.reading for camera, each in names.items()}


def in_order(paths: Sequence[Path]) -> tuple[Path, ...]:
    """The images of a camera in the order that their names tell."""
    return tuple(paths[k] for k in _ImageNames.of(paths).order.tolist())


def natural_order(path: Path) -> list[tuple[int, str]]:
    """Returns a sort key that puts frame_2 before frame_10."""
    words = filter(None, re.split(r"(\d+)", path.name))
    return [(int(word), "") if word.isdecimal() else (-1, word) for word in words]
