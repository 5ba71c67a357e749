import cv2
import numpy as np

from calib.camera import Rig
from tests.kernel_examples import Example
from tests.voxelpose.multiview.carving.carving_scenes import look_at
from voxelpose.multiview.carving.carver import block_order, pack_masks, pack_rig
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.kernels.blocks import LARGEST

LENSES = (
    {},
    {"distortion": (-0.3, 0.12, -0.002, 0.003, -0.01)},
    {"distortion": (0.05, -0.01, 0.003, -0.001), "fisheye": True},
)


def mask(rng, size):
    noise = cv2.GaussianBlur(rng.normal(size=size[::-1]), (0, 0), 4)
    return (noise > 0).view(np.uint8)


def carve_blocks(rng):
    cameras = (
        look_at(f"c{i}", rng.normal(size=3) * 2, rng.normal(size=3), (60, 50), 60.0, **lens)
        for i, lens in enumerate(LENSES)
    )
    rig = Rig(tuple(cameras))
    unknown = [mask(rng, camera.size) > rng.integers(2) for camera in rig]
    frames, sums, pixels = pack_masks([mask(rng, camera.size) for camera in rig], unknown)
    grid = VoxelGrid(rng.normal(size=3) - 1.5, 0.05, tuple(rng.integers(1, 70, 3)))
    axes = grid.axes(LARGEST)
    order = block_order(int(np.prod([len(axis) // LARGEST for axis in axes])))
    rule = 1, int(rng.integers(3))
    occupancy = np.zeros(grid.shape, bool)
    return Example((*pack_rig(rig), frames, sums, pixels, rule, axes, order, occupancy))


def mark_voxels(rng):
    axes = (np.sort(rng.uniform(-1, 1, count)) for count in (6, 7, 8))
    projection = np.array([[6.0, 0.4, 3, 4], [0.2, 5, 2, 3], [0.1, 0.2, 1, 0.8]])
    projection += 0.1 * rng.normal(size=(3, 4))
    # So few pixels that every border is met.
    return Example(
        (rng.random((6, 7, 8)) < 0.3, *axes, projection, np.zeros((6, 8), np.uint8)), atol=1e-12
    )
