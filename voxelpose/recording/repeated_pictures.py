"""Pictures that a camera gave again instead of a new one, as recorders do that stall, or files that
promise a higher rate than was filmed.
"""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from voxelpose.recording.frame_reader import FrameReader
from voxelpose.recording.timestamps import Times

_TIMES = 10
"""By how much the strongest change of a block exceeds what coding changes in a picture that is
repeated. Of 60 real and rendered videos of 28 scenes, 9 repeats in three change by 1/20 or less of
the steps before and after, and no other step by 1/10 or less."""
_BLOCK_PX, _BLOCKS = 16, 64  # least side of a block, and most blocks along the longer side
_SAMPLES = 100  # pictures that tell what is usually there
_SLOWEST = 4  # of so many equal pictures each, a video throughout


def without_repeats(
    readers: Mapping[str, FrameReader], timed: Mapping[str, Times] | None, fps: float | None
) -> tuple[dict[str, FrameReader], dict[str, Times] | None, tuple[str, ...]]:
    """Readers and times without the pictures that are repeated, and what is to be told.

    Decodes those videos and images whose files tell that some may be.

    Args:
        readers: frame readers by camera name, none of them selected.
        timed: (frames,) s, by camera name; None where frame n was taken at one moment by all.
        fps: frames per second, before what videos tell.
    """
    distinct, left = dict(readers), None if timed is None else dict(timed)
    asked = [name for name, reader in readers.items() if reader.coded.may_repeat]
    rate = fps or next((reader.fps for reader in readers.values() if reader.fps), None)
    if not asked or (left is None and rate is None):
        return distinct, left, ()
    times = left or {
        name: np.arange(reader.frame_count) / (fps or reader.fps or rate or 1.0)
        for name, reader in readers.items()
    }
    cameras = {name: _Camera(reader, times[name]) for name, reader in readers.items()}
    with ThreadPoolExecutor() as pool:
        readable = pool.map(lambda name: cameras[name].is_readable, asked)
        asked = [name for name, good in zip(asked, readable, strict=True) if good]
    named = dict[str, list[str]]()
    for name in asked:
        others = [camera for other, camera in cameras.items() if other != name]
        repeated = cameras[name].repeated(others)
        if repeated.any():
            numbers = np.flatnonzero(~repeated)
            distinct[name] = readers[name].select(numbers.tolist())
            times = {**times, name: times[name][numbers]}
            named.setdefault(_words(repeated), []).append(name)
    if not named:
        return distinct, left, ()
    words = "; ".join(f"{', '.join(names)} {what}" for what, names in named.items())
    return distinct, times, (f"{words}: repeated pictures are left out",)


@dataclass(frozen=True, eq=False)
class _Changes:
    """By how much each picture differs from the one before, grey levels; 0 of the first."""

    strongest: NDArray[np.float32]  #: (frames,) mean of the block that changes most.
    middle: NDArray[np.float32]  #: (frames,) that of the middle one: noise.
    blocks: NDArray[np.uint8]  #: (frames, rows, columns) uint8, means of the pictures' blocks.


@dataclass(frozen=True, eq=False)
class _Camera:
    """A camera's pictures, and when they were taken (frames,), s."""

    reader: FrameReader
    times: Times

    @cached_property
    def changes(self) -> _Changes:
        side = max(_BLOCK_PX, -(-max(self.reader.size) // _BLOCKS))
        size = tuple(max(length // side, 1) for length in self.reader.size)
        before, rows, blocks = None, [], []
        for frame in self.reader:
            grey = np.asarray(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY), np.float32)
            off = cv2.absdiff(grey, grey if before is None else before)
            change = cv2.resize(off, size, interpolation=cv2.INTER_AREA)
            rows.append((change.max(), np.median(change)))
            blocks.append(cv2.resize(grey, size, interpolation=cv2.INTER_AREA).astype(np.uint8))
            before = grey
        strongest, middle = np.array(rows, np.float32).T
        return _Changes(strongest, middle, np.stack(blocks))

    @property
    def is_readable(self) -> bool:
        """Whether all pictures can be read; else who needs them says which cannot."""
        try:
            return len(self.changes.blocks) > 0
        except InputError:
            return False

    def repeated(self, others: list["_Camera"]) -> NDArray[np.bool_]:
        """Which pictures (frames,) bool are those before them.

        In between two that move, a picture does not change: somebody does not stop and start again
        at once. But in videos without noise somebody may stand still or be out of sight.
        """
        changes = self.changes
        repeated = np.zeros(len(changes.strongest), np.bool_)
        runs = _still_runs(changes.strongest)
        for first, end in runs:
            repeated[first:end] = True
        new = np.flatnonzero(~repeated)
        usual = np.median(changes.blocks[new[:: -(-len(new) // _SAMPLES)]], axis=0)
        noise = np.median(changes.middle[new[new > 0]]) if len(new) > 1 else 0.0
        for first, end in runs:
            change = changes.strongest[first:end].max()
            seen = np.abs(changes.blocks[first] - usual).max() > _TIMES * change
            silent = noise > 0 and _TIMES * np.median(changes.middle[first:end]) <= noise
            begin_s, end_s = self.times[first - 1], self.times[end - 1]
            if not seen or not (
                end - first == 1
                or silent
                or any(camera.moves(begin_s, end_s, float(change)) for camera in others)
            ):
                repeated[first:end] = False
        for count in range(2, min(_SLOWEST, len(repeated)) + 1):
            every = np.arange(len(repeated)) % count
            new = [k for k in range(count) if not np.mean(repeated[every == k]) > 1 / 2]
            if len(new) == 1:
                return repeated | (every != new[0])
        return repeated

    def moves(self, begin_s: float, end_s: float, change: float) -> bool:
        """Whether something moves here from one time to another, beyond a change."""
        if not self.is_readable:
            return False
        during = (self.times > begin_s) & (self.times <= end_s)
        return bool((self.changes.strongest[during] > _TIMES * change).any())


def _still_runs(strongest: NDArray[np.float32]) -> list[tuple[int, int]]:
    """Spans of pictures, first and one past the last, in which next to nothing changes, while it
    does in the steps before and after, or there are none.
    """
    runs, first, count = list[tuple[int, int]](), 1, len(strongest)
    while first < count:
        before = strongest[first - 1] if first > 1 else np.inf
        end, most = first, 0.0
        while end < count and _TIMES * max(most, strongest[end]) <= before:
            if first == 1 and end > 1 and strongest[end] > _TIMES * most:
                break
            most, end = max(most, float(strongest[end])), end + 1
        moves = (first > 1 or end < count) and (end == count or strongest[end] > _TIMES * most)
        if end > first and moves:
            runs.append((first, end))
            first = end
        first += 1
    return runs


def _words(repeated: NDArray[np.bool_]) -> str:
    """What was repeated."""
    count = int(repeated.sum())
    edges = np.flatnonzero(np.diff(np.concatenate([[False], repeated, [False]])))
    spans = [(int(first), int(end) - 1) for first, end in edges.reshape(-1, 2)]
    factor = round(len(repeated) / (len(repeated) - count))
    if factor > 1 and abs(factor * (len(repeated) - count) - len(repeated)) < factor:
        return f"shows each picture {factor} times: it filmed at a lower rate"
    listed = [f"{first}" if first == last else f"{first} to {last}" for first, last in spans[:3]]
    more = " and more" if len(spans) > 3 else ""
    frames = "frame" if count == 1 else "frames"
    return f"repeats the picture before in {count} {frames} ({', '.join(listed)}{more})"
