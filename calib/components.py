"""Connected components of silhouettes and of voxel volumes."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from calib.checks import FloatArray


@dataclass(frozen=True, eq=False)
class MaskComponents:
    """Connected components of a mask, numbered from 1; 0 is the background."""

    labels: NDArray[np.int32]  #: int32, of the mask's shape: each element's component.
    sizes: NDArray[np.int64]
    """(N + 1,) int64, number of elements of each component; 0 for the background."""

    @cached_property
    def bounds(self) -> NDArray[np.int64]:
        """(N, 2, D) int64: first index of each component's bounding box, and one past its last."""
        boxes = ndimage.find_objects(self.labels)
        corners = [[[s.start for s in box], [s.stop for s in box]] for box in boxes]
        return np.reshape(corners, (-1, 2, self.labels.ndim)).astype(np.int64)

    @cached_property
    def centroids(self) -> FloatArray:
        """(N, D) float64: mean index of each component along each axis."""
        indices = np.nonzero(self.labels)
        owners = self.labels[indices]
        sums = [np.bincount(owners, weights=axis)[1:] for axis in indices]
        return np.column_stack(sums) / self.sizes[1:, None]


def label_components(mask: NDArray[np.bool_], *, diagonal: bool = True) -> MaskComponents:
    """Finds the connected components of a mask.

    Args:
        mask: (H, W) or (nx, ny, nz) bool.
        diagonal: Whether elements that share only a corner or an edge are connected: 8 or 26
            neighbours instead of 4 or 6.
    """
    labels, box = np.zeros(mask.shape, np.int32), _occupied(mask)
    inside = np.ascontiguousarray(mask[box])
    if mask.ndim == 2:
        _, inner = cv2.connectedComponents(inside.view(np.uint8), connectivity=8 if diagonal else 4)
    else:
        neighbours = ndimage.generate_binary_structure(3, 3 if diagonal else 1)
        inner = np.empty(inside.shape, np.int32)
        ndimage.label(inside, neighbours, output=inner)
    labels[box] = inner
    # OpenCV's own statistics take several times as long as its labels.
    return MaskComponents(labels, np.bincount(labels[box][inside], minlength=1))


def _occupied(mask: NDArray[np.bool_]) -> tuple[slice, ...]:
    """Bounding box of a mask; one element of an empty mask."""
    box = []
    for axis in range(mask.ndim):
        others = tuple(other for other in range(mask.ndim) if other != axis)
        places = np.flatnonzero(mask.any(axis=others))
        box.append(slice(places[0], places[-1] + 1) if len(places) else slice(0, 1))
    return tuple(box)
