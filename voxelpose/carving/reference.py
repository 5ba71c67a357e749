"""Carving voxel by voxel in NumPy: slow, and what the kernels are compared with bit for bit."""

import math

import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from voxelpose.carving.carver import CarveRule
from voxelpose.carving.grid import VoxelGrid
from voxelpose.carving.kernels import blocks as columns
from voxelpose.carving.views import Masks, mask_list, view

FloatArray = NDArray[np.float64]


def distort_unbounded(
    row: FloatArray, kind: int, x: FloatArray, y: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Distorts ideal coordinates. Source: OpenCV, "Camera Calibration and 3D Reconstruction" and
    "Fisheye camera model".
    """
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = row[columns.K1 : columns.S4 + 1]
    s = x * x + y * y
    if kind == columns.FISHEYE:
        radius = np.sqrt(s)
        # NumPy's own arctan may differ from the C library's in the last bit.
        angle = np.asarray(np.frompyfunc(math.atan, 1, 1)(radius), dtype=np.float64)
        t = angle * angle
        ratio = angle * (1.0 + t * (k1 + t * (k2 + t * (k3 + t * k4)))) / radius
        ratio = np.where(radius < 1e-8, 1.0, ratio)
        return x * ratio, y * ratio
    ratio = (1.0 + s * (k1 + s * (k2 + s * k3))) / (1.0 + s * (k4 + s * (k5 + s * k6)))
    xy = 2.0 * x * y
    a = x * ratio + (p1 * xy + p2 * (s + 2.0 * x * x)) + s * (s1 + s * s2)
    b = y * ratio + (p1 * (s + 2.0 * y * y) + p2 * xy) + s * (s3 + s * s4)
    tilt = row[columns.TILT : columns.TILT + 9].reshape(3, 3)
    if tilt[0, 0] != 0.0:
        u, v, w = ((tilt[i, 0] * a + tilt[i, 1] * b) + tilt[i, 2] for i in range(3))
        a, b = u / w, v / w
    return a, b


def look(
    row: FloatArray, kind: int, mask: NDArray[np.uint8], x: FloatArray, y: FloatArray, z: FloatArray
) -> NDArray[np.int64]:
    """Says what a camera makes of points: AGREES, OBJECTS or BLIND, in the shape of x, y and z
    broadcast together.
    """
    p = row[:12].reshape(3, 4)
    u, v, w = (((p[i, 0] * x + p[i, 1] * y) + p[i, 3]) + p[i, 2] * z for i in range(3))
    with np.errstate(all="ignore"):
        inverse = 1.0 / w
        u, v = u * inverse, v * inverse
        sees = w > 0.0
        if kind != columns.PINHOLE:
            sees &= ~(u * u + v * v > row[columns.FIELD_SQUARED])
            fx, skew, cx, fy, cy = row[columns.FX : columns.CY + 1]
            a, b = distort_unbounded(row, kind, u, v)
            u, v = (fx * a + skew * b) + cx, fy * b + cy
        column, line = np.floor(u + 0.5), np.floor(v + 0.5)
        sees &= (column >= 0) & (line >= 0) & (column < mask.shape[1]) & (line < mask.shape[0])
    verdict = np.full(sees.shape, columns.BLIND)
    foreground = mask[line[sees].astype(int), column[sees].astype(int)]
    verdict[sees] = np.where(foreground, columns.AGREES, columns.OBJECTS)
    return verdict


def carve(
    rig: Rig, masks: Masks, grid: VoxelGrid, rule: CarveRule | None = None
) -> NDArray[np.bool_]:
    """Carves as `voxelpose.carving.carver.carve` does; see there."""
    tolerance, least, outside = (rule or CarveRule()).packed(len(rig))
    x, y, z = grid.axes()
    agreeing = np.zeros(grid.shape, dtype=np.int64)
    objecting = np.zeros(grid.shape, dtype=np.int64)
    for camera, mask in zip(rig, mask_list(rig, masks), strict=True):
        row, kind = view(camera).row, view(camera).kind
        verdict = look(row, kind, mask, x[:, None, None], y[None, :, None], z[None, None, :])
        verdict[verdict == columns.BLIND] = outside
        agreeing += verdict == columns.AGREES
        objecting += verdict == columns.OBJECTS
    return (objecting <= tolerance) & (agreeing >= least)
