"""Pixels that voxels cover."""

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.image.cleanup import dilated
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.kernels.footprint import mark_voxels


def footprint(occupancy: NDArray[np.bool_], grid: VoxelGrid, camera: Camera) -> NDArray[np.bool_]:
    """Pixels (h, w) bool that voxels (nx, ny, nz) cover, without gaps between them.

    Args:
        occupancy: the voxels.
        grid: where they are.
        camera: a pinhole.
    """
    marked = np.zeros(camera.size[::-1], np.uint8)
    depth_m = mark_voxels(occupancy, *grid.axes(), camera.projection, marked)
    size_px = camera.matrix[0, 0] * grid.voxel_size_m / max(depth_m, 0.1)
    # A voxel's diagonal, so that neighbours close up, and what its centre misses at the edge.
    return dilated(marked.view(np.bool_), int(np.ceil(2 * size_px)) | 1)
