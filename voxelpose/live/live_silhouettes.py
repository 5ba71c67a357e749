"""Silhouettes of live pictures, in a process of their own, and the background of the empty view."""

import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from calib.components import label_components
from calib.errors import InputError
from silhouette_core.image.person_windows import PeopleWindows
from silhouette_core.image.pose_network import PersonSeen
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.monocular.person_finder import LONG_SIDE_PX
from voxelpose.live.remote_object import RemoteObject
from voxelpose.multiview.tracking.body_track import Moment
from voxelpose.tuning import LIVE

Mask = NDArray[np.bool_]
Picture = NDArray[np.uint8]

_FEW, _FEW_PX, _MANY_PX = 5, 480, 384  # up to so many cameras, and more
_LEAST_MARGIN_PX = 32
_WHOLE_EVERY = 10  # frames after which a camera's whole picture is looked at again


def long_side_px(rig: Rig) -> int:
    """Longer side to which larger pictures are reduced.

    Several cameras make up for each other's pixels: there, smaller pictures cost no accuracy.
    """
    if len(rig) == 1:
        return LONG_SIDE_PX
    return _FEW_PX if len(rig) <= _FEW else _MANY_PX


@dataclass(frozen=True)
class EmptyView:
    """Pictures of the empty scene as a source of frames, for `Silhouettes`; of cameras without any,
    the moments in which people were there.
    """

    rig: Rig  # the cameras, as they take their pictures
    pictures: Mapping[str, Sequence[Picture]]  # (H, W, 3) uint8 BGR each, by camera name
    # (H, W) bool, where the person may be, by camera name.
    allowed: Mapping[str, Mask] = field(default_factory=dict)
    silhouettes_given: bool = False  # whether the pictures are silhouettes already
    moments: Sequence[Mapping[str, Picture]] = ()  # (H, W, 3) uint8 BGR, by camera name
    fps: float = 30

    @property
    def frame_count(self) -> int:
        """See `FrameSource.frame_count`."""
        return len(self.moments)

    def backgrounds(self) -> Mapping[str, Sequence[Picture]]:
        """See `FrameSource.backgrounds`."""
        return self.pictures

    def regions(self) -> Mapping[str, Mask]:
        """See `FrameSource.regions`."""
        return self.allowed

    def unknown(self) -> Mapping[str, Mask]:
        """See `FrameSource.unknown`: live, nothing is marked."""
        return {}

    def at(self, steps: Sequence[int]) -> Iterator[Mapping[str, Picture]]:
        """See `FrameSource.at`."""
        return (self.moments[step] for step in steps)

    def __iter__(self) -> Iterator[tuple[int, float, Mapping[str, Picture]]]:
        return ((step, step / self.fps, frames) for step, frames in enumerate(self.moments))


class PeopleInTurn:
    """Whom the pose network sees: it looks at one camera after the other, as often as that keeps
    up, and what it sees counts in that frame alone. Four frames later people have moved so far that
    their mask spoils more of a silhouette than it mends.

    Args:
        windows: by camera name, what follows people there.

    Attributes:
        idle_s: time without work since the last look, which has to be as long as that was.
    """

    def __init__(self, windows: Mapping[str, PeopleWindows]):
        self.idle_s = self._took_s = 0.0
        self._windows = dict(windows)
        self._seen: dict[str, Mapping[int, PersonSeen]] = {}

    def look(self, step: int, frames: Mapping[str, Picture]) -> None:
        """See `People.look`; steps are those of this session, one after the other."""
        self._seen = {}
        name = next((name for name in self._windows if name in frames), None)
        if name is None or self.idle_s < self._took_s:
            return
        begun_s = time.perf_counter()
        self._seen[name] = self._windows[name].see(frames[name])
        self._windows[name] = self._windows.pop(name)  # the last in turn
        self.idle_s, self._took_s = 0.0, time.perf_counter() - begun_s

    def of(self, name: str, step: int) -> Mapping[int, PersonSeen]:
        """See `People.of`."""
        return self._seen.get(name, {})


class LiveSilhouettes:
    """Silhouettes near the last ones, and now and then, camera by camera, of the whole picture, by
    learned backgrounds; `others` names the cameras that show somebody beside the largest component.
    """

    def __init__(self, silhouettes: Silhouettes):
        self.others: frozenset[str] = frozenset()
        self._silhouettes, self._ended_s = silhouettes, time.perf_counter()
        self._windows: dict[str, tuple[slice, slice]] = {}
        self._frame = 0

    def of(self, pictures: Mapping[str, Picture]) -> dict[str, Mask]:
        """Silhouettes (h, w) bool of pictures (H, W, 3) uint8 BGR by camera name, as recorded."""
        whole = {
            name
            for k, name in enumerate(pictures)
            if (self._frame + k) % _WHOLE_EVERY == 0 or name not in self._windows
        }
        self._frame += 1
        windows = {name: window for name, window in self._windows.items() if name not in whole}
        if isinstance(people := self._silhouettes.people, PeopleInTurn):
            people.idle_s += time.perf_counter() - self._ended_s
        masks = self._silhouettes.of(pictures, windows, self._frame)
        self._windows = {name: w for name, mask in masks.items() if (w := _box(mask)) is not None}
        for name in whole:
            several = _shows_several(masks[name])
            self.others = self.others | {name} if several else self.others - {name}
        self._ended_s = time.perf_counter()
        return masks


def _box(mask: Mask) -> tuple[slice, slice] | None:
    """Rows and columns around a silhouette; None where it is empty."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return None
    margin = max(_LEAST_MARGIN_PX, round(LIVE.window_margin * max(np.ptp(rows), np.ptp(columns))))
    top, left = max(int(rows[0]) - margin, 0), max(int(columns[0]) - margin, 0)
    return slice(top, int(rows[-1]) + margin + 1), slice(left, int(columns[-1]) + margin + 1)


def _shows_several(mask: Mask) -> bool:
    """Whether a silhouette has a second component as large as a person's part."""
    sizes = np.sort(label_components(mask).sizes[1:])
    if len(sizes) < 2:
        return False
    return sizes[-2] > max(LIVE.second_component * sizes[-1], LIVE.second_picture * mask.size)


_Shapes = dict[str, tuple[int, int, int]]


class SilhouetteProcess:
    """`LiveSilhouettes` in another process, which shares the pictures' memory; InputError where the
    machine has too little of it.
    """

    def __init__(self, rig: Rig):
        shapes = {camera.name: (camera.size[1], camera.size[0], 3) for camera in rig}
        size = sum(int(np.prod(shape)) for shape in shapes.values())
        self._memory = SharedMemory(create=True, size=size)
        try:
            _reserve(self._memory, size)
        except InputError:
            self._release()
            raise
        self._pictures = _arrays(self._memory, shapes)
        self._process = RemoteObject(_SilhouetteFinder, self._memory.name, shapes)

    def learn(self, silhouettes: Silhouettes) -> None:
        """Takes other backgrounds."""
        self._process.call("learn", silhouettes)

    def of(self, time_s: float, pictures: Mapping[str, Picture]) -> tuple[Moment, frozenset[str]]:
        """Silhouettes of one moment's pictures, (H, W, 3) uint8 BGR by camera name, as recorded,
        and the names of the cameras that show somebody else too.
        """
        for name, picture in pictures.items():
            self._pictures[name][:] = picture
        return self._process.call("of", time_s, list(pictures))

    def close(self) -> None:
        """Ends the process."""
        self._process.close()
        self._pictures = {}  # views of the memory
        self._release()

    def _release(self) -> None:
        self._memory.close()
        self._memory.unlink()


class _SilhouetteFinder:
    def __init__(self, memory: str, shapes: _Shapes):
        self._memory = SharedMemory(memory)
        self._pictures = _arrays(self._memory, shapes)
        self._silhouettes: LiveSilhouettes | None = None

    def learn(self, silhouettes: Silhouettes) -> None:
        self._silhouettes = LiveSilhouettes(silhouettes)

    def of(self, time_s: float, names: list[str]) -> tuple[Moment, frozenset[str]]:
        assert self._silhouettes is not None
        masks = self._silhouettes.of({name: self._pictures[name] for name in names})
        return Moment.of(time_s, masks), self._silhouettes.others

    def close(self) -> None:
        self._pictures = {}
        self._memory.close()


def _arrays(memory: SharedMemory, shapes: _Shapes) -> dict[str, Picture]:
    """Pictures in the memory, one after the other."""
    arrays, first = {}, 0
    for name, shape in shapes.items():
        arrays[name] = np.ndarray(shape, np.uint8, memory.buf, first)
        first += arrays[name].nbytes
    return arrays


def _reserve(memory: SharedMemory, size: int) -> None:
    """Reserves the memory, where it is a file that grows: writing to a full disk ends a process."""
    path = Path("/dev/shm") / memory.name
    if not path.exists():
        return
    with path.open("r+b") as file:
        try:
            os.posix_fallocate(file.fileno(), 0, size)
        except OSError as error:
            raise InputError(
                f"the pictures need {size / 2**20:.0f} MiB of shared memory, and /dev/shm has less"
                " free: enlarge it (for example docker run --shm-size=256m)"
            ) from error
