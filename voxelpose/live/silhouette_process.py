"""Live silhouettes in a process of their own."""

import os
from collections.abc import Mapping
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from calib.errors import InputError
from silhouette_core.image.silhouettes import Silhouettes
from voxelpose.live.live_silhouettes import LiveSilhouettes
from voxelpose.live.remote_object import RemoteObject
from voxelpose.multiview.tracking.body_track import Moment

Picture = NDArray[np.uint8]
_Shapes = dict[str, tuple[int, int, int]]


class SilhouetteProcess:
    """`LiveSilhouettes` in another process, which shares the pictures' memory.

    Args:
        rig: the cameras, as they take their pictures.

    Raises:
        InputError: the machine has too little shared memory.
    """

    def __init__(self, rig: Rig):
        """Begins the process, and returns at once."""
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
    """The same in its process."""

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
