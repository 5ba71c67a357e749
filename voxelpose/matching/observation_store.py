"""Observations of a recording's frames: each hull is carved once and kept on disk."""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import numpy as np

from silhouette_core.read_ahead import side_by_side
from silhouette_core.scratch_file import ScratchFile
from voxelpose.carving.grid import VoxelGrid
from voxelpose.matching.mask_store import MaskStore
from voxelpose.matching.observe import FrameObservation, HullComponents, HullObserver


class ObservationStore:
    """Observations of the frames of a recording by number; each body's hull is carved once.

    Hulls and their silhouettes are kept as compressed bits in a scratch file; memory holds only
    where each begins, and the boxes of the hull's components. Several threads may observe at once.

    Args:
        observer: finds the body in a frame.
        masks: the raw silhouettes.
    """

    def __init__(self, observer: HullObserver, masks: MaskStore):
        """Creates the scratch file; `close` or the end of the process removes it."""
        self.observer = observer
        self._masks = masks
        self._components: dict[int, HullComponents] = {}
        self._hulls: dict[tuple[int, int], tuple[VoxelGrid, int, int]] = {}
        self._file = ScratchFile()

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._masks)

    def carve(self, frames: Sequence[int]) -> None:
        """Carves the hulls of the largest bodies of some frames ahead of time, side by side."""

        def carved(t: int) -> tuple[HullComponents, int | None, tuple[VoxelGrid, bytes] | None]:
            components = self.observer.components(self._masks[t])
            body = components.body(None)
            grid = None if body is None else self.observer.window(components, body)
            return components, body, None if grid is None else (grid, self._packed(t, grid))

        for t, (components, body, hull) in zip(frames, side_by_side(carved, frames), strict=True):
            self._components[t] = components
            if body is not None and hull is not None:
                self._hulls[t, body] = self._kept(*hull)

    def observe(self, t: int, near_m: np.ndarray | None = None) -> FrameObservation | None:
        """One body of frame `t`, as `HullObserver.observe` of its raw silhouettes."""
        if t not in self._components:
            self._components[t] = self.observer.components(self._masks[t])
        body = self._components[t].body(near_m)
        if body is None:
            return None
        if (t, body) not in self._hulls:
            grid = self.observer.window(self._components[t], body)
            self._hulls[t, body] = self._kept(grid, self._packed(t, grid))
        grid, start, size = self._hulls[t, body]
        bits = np.frombuffer(zlib.decompress(self._file.read_at(start, size)), np.uint8)
        shapes = [*(camera.size[::-1] for camera in self.observer.views.rig), grid.shape]
        ends = np.cumsum([np.prod(shape) for shape in shapes])
        arrays = np.split(np.unpackbits(bits, count=ends[-1]).view(bool), ends[:-1])
        *masks, occupancy = (a.reshape(shape) for a, shape in zip(arrays, shapes, strict=True))
        return self.observer.select(masks, occupancy, grid, near_m)

    def close(self) -> None:
        """Removes the scratch file."""
        self._file.close()

    def _packed(self, t: int, grid: VoxelGrid) -> bytes:
        masks, occupancy = self.observer.carve(self._masks[t], grid)
        bits = np.packbits(np.concatenate([a.ravel() for a in (*masks, occupancy)]))
        return zlib.compress(bits.tobytes(), 1)

    def _kept(self, grid: VoxelGrid, packed: bytes) -> tuple[VoxelGrid, int, int]:
        return grid, self._file.append(packed), len(packed)
