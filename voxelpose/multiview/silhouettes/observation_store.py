"""Observations of a recording's frames: each hull is carved once and kept on disk."""

import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass

import numpy as np

from calib.checks import BoolArray, FloatArray
from calib.storage.temporary import ScratchFile
from silhouette_core.image.seen_joints import SeenJoints
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.read_ahead import side_by_side
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import COMPONENT, FrameObservation, HullObserver
from voxelpose.multiview.silhouettes.mask_store import MaskStore

JointsOf = Callable[[int, int, BoolArray], SeenJoints | None]
"""Joints of the person with a silhouette, by the number of the camera and of the frame."""
_NOWHERE = -1
_TOGETHER = 16  # frames
_BOX = struct.Struct("3d3q")  # origin and shape of a grid


@contextmanager
def carved_observations(
    observer: HullObserver,
    masks: MaskStore,
    clock: StageClock,
    reporter: Reporter,
    blind: BoolArray,
    seen: JointsOf | None = None,
    other_people: "OtherPeople | None" = None,
) -> "Iterator[ObservationStore]":
    """Observations of all frames, whose hulls are carved, for a `with` block.

    Args:
        observer: finds the body in a frame.
        masks: the raw silhouettes.
        clock: told the durations.
        reporter: told the progress.
        blind: (T, C) bool, cameras that tell nothing of the body in a frame.
        seen: joints that the pose network sees; None: it is not asked.
        other_people: what is known of others beside the body; None: there are none.
    """
    with closing(ObservationStore(observer, masks, blind, seen, other_people)) as observations:
        reporter.stage("hulls", len(masks))
        for first in range(0, len(masks), _TOGETHER):
            together = range(first, min(first + _TOGETHER, len(masks)))
            with clock("hulls"):
                observations.carve(together)
            reporter.advance(len(together))
        yield observations


@dataclass(frozen=True, eq=False)
class OtherPeople:
    """What the silhouettes of one person's T frames leave open, since there are others."""

    unknown: MaskStore  #: where others are, or may be.
    places_m: FloatArray  #: (T, 3) float64, about where the person is; NaN: not there.
    hidden: FloatArray  #: (T,) float64, share of the person that others may hide.


class ObservationStore:
    """Observations of the frames of a recording by number; each body's hull is carved once.

    The hulls' components, and hulls and silhouettes as compressed bits, are kept in a scratch
    file; memory holds only where each begins. Several threads may observe at once.

    Args:
        observer: finds the body in a frame.
        masks: the raw silhouettes.
        blind: (T, C) bool, cameras that tell nothing of the body in a frame; None: none do.
        seen: joints that the pose network sees; None: it is not asked.
        others: what is known of other people; None: there are none.
    """

    def __init__(
        self,
        observer: HullObserver,
        masks: MaskStore,
        blind: BoolArray | None = None,
        seen: JointsOf | None = None,
        others: OtherPeople | None = None,
    ):
        """Creates the scratch file; `close` or the end of the process removes it."""
        self.observer, self._seen = observer, seen
        self._masks, self._others = masks, others
        nowhere = np.zeros((len(masks), len(observer.views.rig)), np.bool_)
        self._blind = nowhere if blind is None else blind
        self._components = np.full((len(masks), 2), _NOWHERE)  # begin and number
        self._hulls = np.full((len(masks), 3), _NOWHERE)  # component, begin and bytes
        self._other_hulls: dict[tuple[int, int], tuple[int, int]] = {}  # rarely any
        self._file = ScratchFile()

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._masks)

    @property
    def there(self) -> np.ndarray:
        """(T,) bool, frames in which the person may be seen."""
        if self.places_m is None:
            return np.ones(len(self), np.bool_)
        return ~np.isnan(self.places_m[:, 0])

    @property
    def places_m(self) -> np.ndarray | None:
        """(T, 3) float64, about where one of several people is; NaN: not there. None: there are no
        others.
        """
        return None if self._others is None else self._others.places_m

    @property
    def hidden(self) -> np.ndarray:
        """(T,) float64, share of the person that others may hide, or that cameras do not show."""
        unseen = self._blind.mean(axis=1)
        return unseen if self._others is None else np.maximum(unseen, self._others.hidden)

    def joints(self, t: int) -> dict[int, SeenJoints]:
        """Joints that the pose network sees in a frame, by the camera's number."""
        if self._seen is None:
            return {}
        seen = {c: self._seen(c, t, mask) for c, mask in enumerate(self.masks(t))}
        return {c: joints for c, joints in seen.items() if joints is not None}

    def carve(self, frames: Sequence[int]) -> None:
        """Carves the hulls of the largest bodies of some frames ahead of time, side by side."""

        def carved(t: int) -> None:
            components = self._components_of(t)
            body = self.observer.body(components, self._near(t, None))
            if body is not None:
                self._keep_hull(t, body, components)

        for _ in side_by_side(carved, frames):
            pass

    def observe(self, t: int, near_m: np.ndarray | None = None) -> FrameObservation | None:
        """One body of frame `t`, as `HullObserver.observe` of its raw silhouettes."""
        components, near_m = self._components_of(t), self._near(t, near_m)
        body = self.observer.body(components, near_m)
        if body is None:
            return None
        if self._hull_at(t, body) is None:
            self._keep_hull(t, body, components)
        extent = self._hull_at(t, body)
        assert extent is not None, "the hull was just kept"
        record = self._file.read_at(*extent)
        *origin, nx, ny, nz = _BOX.unpack_from(record)
        grid = VoxelGrid(np.array(origin), self.observer.voxel_size_m, (nx, ny, nz))
        bits = np.frombuffer(zlib.decompress(record[_BOX.size :]), np.uint8)
        shapes = [*(camera.size[::-1] for camera in self.observer.views.rig), grid.shape]
        ends = np.cumsum([np.prod(shape) for shape in shapes])
        arrays = np.split(np.unpackbits(bits, count=ends[-1]).view(bool), ends[:-1])
        *masks, occupancy = (a.reshape(shape) for a, shape in zip(arrays, shapes, strict=True))
        return self._observer(t).select(masks, occupancy, grid, near_m)

    def masks(self, t: int) -> list[np.ndarray]:
        """Raw silhouettes (h, w) bool of frame `t`, one per camera; empty in blind ones."""
        pairs = zip(self._masks[t], self._blind[t], strict=True)
        return [np.zeros_like(mask) if blind else mask for mask, blind in pairs]

    def close(self) -> None:
        """Removes the scratch file."""
        self._file.close()

    def _near(self, t: int, near_m: np.ndarray | None) -> np.ndarray | None:
        """Where the person is in a frame: as told, or else as is known of people."""
        return near_m if near_m is not None or self._others is None else self._others.places_m[t]

    def _observer(self, t: int) -> HullObserver:
        """Of the hull of a frame."""
        blind = self._blind[t]
        if self._others is not None:
            hidden = self._others.unknown[t]
        elif blind.any():
            hidden = [np.zeros(camera.size[::-1], np.bool_) for camera in self.observer.views.rig]
        else:
            return self.observer
        return self.observer.with_unknown([a | b for a, b in zip(hidden, blind, strict=True)])

    def _components_of(self, t: int) -> np.ndarray:
        """Components of a frame's hull, found once; none where the person is not there."""
        start, count = self._components[t].tolist()
        if start == _NOWHERE:
            components = self._observer(t).components(self.masks(t))
            if self._others is not None and np.isnan(self._others.places_m[t]).any():
                components = components[:0]
            self._components[t] = self._file.append(components.tobytes()), len(components)
            return components
        return np.frombuffer(self._file.read_at(start, count * COMPONENT.itemsize), COMPONENT)

    def _keep_hull(self, t: int, body: int, components: np.ndarray) -> None:
        grid = self.observer.window(components, body)
        masks, occupancy = self._observer(t).carve(self.masks(t), grid)
        bits = np.packbits(np.concatenate([a.ravel() for a in (*masks, occupancy)]))
        record = _BOX.pack(*grid.origin_m, *grid.shape) + zlib.compress(bits.tobytes(), 1)
        where = self._file.append(record), len(record)
        if self._hulls[t, 0] == _NOWHERE:
            self._hulls[t] = body, *where
        else:
            self._other_hulls[t, body] = where

    def _hull_at(self, t: int, body: int) -> tuple[int, int] | None:
        stored_body, start, size = self._hulls[t].tolist()
        return (start, size) if stored_body == body else self._other_hulls.get((t, body))
