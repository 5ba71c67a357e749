"""Pixels that voxels cover."""

import numpy as np

from calib.camera import Camera
from calib.checks import BoolArray
from silhouette_core.image.cleanup import bounding_box, dilated
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.kernels.footprint import mark_voxels


def footprint(
    occupancy: BoolArray, grid: VoxelGrid, camera: Camera, mask: BoolArray | None = None
) -> BoolArray:
    """Pixels (h, w) bool that voxels (nx, ny, nz) cover, without gaps between them.

    Args:
        occupancy: the voxels.
        grid: where they are.
        camera: a pinhole.
        mask: (h, w) bool, only its pixels; None: all.
    """
    marked = np.zeros(camera.size[::-1], np.uint8)
    depth_m = mark_voxels(occupancy, *grid.axes(), camera.projection, marked)
    size_px = camera.matrix[0, 0] * grid.voxel_size_m / max(depth_m, 0.1)
    # A voxel's diagonal, so that neighbours close up, and what its centre misses at the edge.
    side = int(np.ceil(2 * size_px)) | 1
    if mask is None:
        return dilated(marked.view(np.bool_), side)
    covered, window = np.zeros_like(mask), bounding_box(mask, side // 2)
    covered[window] = mask[window] & dilated(marked[window].view(np.bool_), side)
    return covered
