"""Bounds of the images of whole blocks, by which carving decides them: they hold under any lens."""

import numpy as np
import pytest
from carving_scenes import any_camera

from calib.camera import Camera, Rig
from voxelpose.multiview.carving.carver import pack_rig
from voxelpose.multiview.carving.kernels import blocks


def cubes_before(camera: Camera, rng, count=160):
    """Centres (count, 8, 3) of cubes, half their edges (count,), and points (count, 8, 30, 3) in
    each: the first is shown by a pixel in the image or around it, often in its corner.
    """
    width, height = camera.size
    pixels = rng.uniform(-0.1, 1.1, (8 * count, 2)) * (width, height) - 0.5
    corners = rng.integers(0, 2, pixels.shape) * (width - 1, height - 1)
    pixels = np.where(rng.random((8 * count, 1)) < 0.4, corners, pixels)
    origin, rays = camera.rays(pixels)
    rays[np.isnan(rays).any(axis=1)] = camera.rotation[2]
    shown = origin + rays * np.exp(rng.uniform(np.log(0.01), np.log(9), (8 * count, 1)))
    half = np.exp(rng.uniform(np.log(1e-4), np.log(0.5), count))
    inside = rng.uniform(-1, 1, (30, 8 * count, 3))
    inside[1:15] = np.sign(inside[1:15])
    moved = shown.reshape(count, 8, 3) - half[:, None, None] * inside[0].reshape(count, 8, 3)
    points = moved + half[:, None, None] * inside.reshape(30, count, 8, 3)
    return moved, half, np.moveaxis(points, 0, 2)


@pytest.mark.parametrize("seed", range(40))
def test_a_blocks_image_lies_in_its_bounds_and_a_blind_camera_sees_none_of_it(seed):
    rng = np.random.default_rng(seed)
    camera = any_camera(rng, "any", rng.normal(size=3), 2 * rng.normal(size=3))
    rows, kinds, bounds = pack_rig(Rig((camera,)))
    seen, boxes, bounded = np.empty(8, np.int64), np.empty((4, 8)), 0
    for centres, half, points in zip(*cubes_before(camera, rng), strict=True):
        blocks._pinhole_boxes(rows, 0, np.ascontiguousarray(centres.T), half, seen, boxes)
        if kinds[0] != blocks.PINHOLE:
            blocks._lens_boxes(rows, kinds, bounds, 0, seen, boxes)
        x, y = np.moveaxis(camera.project(points.reshape(-1, 3))[0].reshape(8, 30, 2), 2, 0)
        left, right, top, bottom = boxes[:, seen == blocks.AGREES, None]
        u, v = x[seen == blocks.AGREES], y[seen == blocks.AGREES]
        assert ((u > left - 1e-6) & (u < right + 1e-6)).all()
        assert ((v > top - 1e-6) & (v < bottom + 1e-6)).all()
        u, v = x[seen == blocks.BLIND] + 0.5, y[seen == blocks.BLIND] + 0.5
        assert not ((u >= 0) & (v >= 0) & (u < camera.size[0]) & (v < camera.size[1])).any()
        bounded += len(left)
    assert bounded > 20
