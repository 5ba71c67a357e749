"""Silhouettes of live pictures, and the background learned from the empty view."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from calib.components import label_components
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.monocular.monocular_stages import LONG_SIDE_PX
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
    """Pictures of the empty scene as a source of frames, for `Silhouettes`.

    Attributes:
        rig: the cameras, as they take their pictures.
        pictures: (H, W, 3) uint8 BGR each, by camera name.
        allowed: (H, W) bool, where the person may be, by camera name.
        silhouettes_given: whether the pictures are silhouettes already.
    """

    rig: Rig
    pictures: Mapping[str, Sequence[Picture]]
    allowed: Mapping[str, Mask] = field(default_factory=dict)
    silhouettes_given: bool = False
    fps: float = 30
    frame_count: int = 0

    def backgrounds(self) -> Mapping[str, Sequence[Picture]]:
        """See `FrameSource.backgrounds`."""
        return self.pictures

    def regions(self) -> Mapping[str, Mask]:
        """See `FrameSource.regions`."""
        return self.allowed

    def unknown(self) -> Mapping[str, Mask]:
        """See `FrameSource.unknown`: live, nothing is marked."""
        return {}

    def at(self, steps: Sequence[int]) -> Iterator[dict[str, Picture]]:
        """See `FrameSource.at`: there are no frames."""
        return iter(())

    def __iter__(self) -> Iterator[tuple[int, float, dict[str, Picture]]]:
        """There are no frames."""
        return iter(())


class LiveSilhouettes:
    """Silhouettes near the last ones, and now and then, camera by camera, of the whole picture.

    Args:
        silhouettes: with the learned backgrounds.

    Attributes:
        others: names of the cameras that show somebody beside the largest component.
    """

    def __init__(self, silhouettes: Silhouettes):
        """Starts without silhouettes."""
        self.others: frozenset[str] = frozenset()
        self._silhouettes = silhouettes
        self._near: dict[str, tuple[slice, slice]] = {}
        self._frame = 0

    def of(self, pictures: Mapping[str, Picture]) -> dict[str, Mask]:
        """Silhouettes (h, w) bool of pictures (H, W, 3) uint8 BGR by camera name, as recorded."""
        whole = {
            name
            for k, name in enumerate(pictures)
            if (self._frame + k) % _WHOLE_EVERY == 0 or name not in self._near
        }
        self._frame += 1
        near = {name: window for name, window in self._near.items() if name not in whole}
        masks = self._silhouettes.of(pictures, near)
        self._near = {name: w for name, mask in masks.items() if (w := _around(mask)) is not None}
        for name in whole:
            several = _shows_several(masks[name])
            self.others = self.others | {name} if several else self.others - {name}
        return masks


def _around(mask: Mask) -> tuple[slice, slice] | None:
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
