"""The kernels of this folder voxel by voxel in NumPy: what tests compare with, bit for bit. Each
takes the arguments of the kernel of its name and fills the same array.
"""

import math

import numpy as np
from numpy.typing import NDArray

from voxelpose.multiview.carving.kernels import blocks as columns

FloatArray = NDArray[np.float64]


def carve_blocks(rows, kinds, bounds, frames, sums, pixels, rule, axes, order, occupancy):
    """Carves every voxel of the grid, with masks put together from their crops."""
    masks = []
    for width, height, left, upper, wide, high, first, _, _ in frames:
        # The crop's rim may lie beyond the image.
        mask = np.zeros((height + 2, width + 2), np.uint8)
        crop = pixels[first : first + wide * high].reshape(high, wide)
        mask[upper + 1 : upper + 1 + high, left + 1 : left + 1 + wide] = crop
        masks.append(mask[1:-1, 1:-1])
    axes = tuple(axis[:count] for axis, count in zip(axes, occupancy.shape, strict=True))
    occupancy[:] = carve_voxels(rows, kinds, masks, rule, axes)


def carve_voxels(
    rows: FloatArray,
    kinds: NDArray[np.int64],
    masks: list[NDArray[np.uint8]],
    rule: tuple[int, int],
    axes: tuple[FloatArray, ...],
) -> NDArray[np.bool_]:
    """Occupancy (nx, ny, nz) of the voxels with centres on axes, from whole masks (h, w) of pixels
    as there; the other arguments are those of `blocks.carve_blocks`.
    """
    tolerance, least = rule
    x, y, z = np.meshgrid(*axes, indexing="ij", sparse=True)
    agreeing, objecting = np.zeros((2, *map(len, axes)), dtype=np.int64)
    for row, kind, mask in zip(rows, kinds, masks, strict=True):
        verdict = _verdict(row, kind, mask, x, y, z)
        agreeing += verdict == columns.AGREES
        objecting += verdict == columns.OBJECTS
    return (objecting <= tolerance) & (agreeing >= least)


def mark_voxels(
    occupancy: NDArray[np.bool_],
    x: FloatArray,
    y: FloatArray,
    z: FloatArray,
    projection: FloatArray,
    footprint: NDArray[np.uint8],
) -> float:
    """Projects the centre of every occupied voxel to its nearest pixel; the least depth."""
    i, j, k = np.nonzero(occupancy)
    u, v, depth = projection @ np.stack([x[i], y[j], z[k], np.ones(len(i))])
    front = depth > 0
    column, row = np.rint(u[front] / depth[front]), np.rint(v[front] / depth[front])
    height, width = footprint.shape
    seen = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    footprint[row[seen].astype(int), column[seen].astype(int)] = 1
    return float(depth.min(initial=np.inf))


def _distort_unbounded(
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


def _verdict(
    row: FloatArray, kind: int, mask: NDArray[np.uint8], x: FloatArray, y: FloatArray, z: FloatArray
) -> NDArray[np.int64]:
    """One camera's verdict on points x, y, z, which broadcast: BLIND where it does not see them,
    else the pixel, which is AGREES, OBJECTS or BLIND.
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
            a, b = _distort_unbounded(row, kind, u, v)
            u, v = (fx * a + skew * b) + cx, fy * b + cy
        column, line = np.floor(u + 0.5), np.floor(v + 0.5)
        sees &= (column >= 0) & (line >= 0) & (column < mask.shape[1]) & (line < mask.shape[0])
    verdict = np.full(sees.shape, columns.BLIND)
    verdict[sees] = mask[line[sees].astype(int), column[sees].astype(int)]
    return verdict
