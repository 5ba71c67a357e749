"""The surface points that should touch the tangent planes of contour points.

Source: articulated iterative closest points on contours, as in Rosenhahn, Brox and Weickert,
"Three-dimensional shape knowledge for joint image segmentation and pose tracking" (2007); the
tangent planes and the choice of the rim are ours. Reference:
`tests.oracles.refinement`.
"""

import numpy as np

from silhouette_core.jit import kernel

_CHUNK = 256  # contour points that are matched together
_BINS = 128
_FIRST_M = 4 / 100  # within which a match is looked for first: decides the speed alone


@kernel
def _spread_axis(points, o):
    """World axis along which the directions of points (V, 3) from o (3,) spread most; the least
    component along it, the spread, and the least distance.
    """
    low, high, nearest2 = np.full(3, np.inf), np.full(3, -np.inf), np.inf
    for v in range(points.shape[0]):
        p = points[v]
        x, y, z = p[0] - o[0], p[1] - o[1], p[2] - o[2]
        square = x * x + y * y + z * z
        nearest2, inverse = min(nearest2, square), 1.0 / np.sqrt(max(square, 1e-12))
        low[0], high[0] = min(low[0], x * inverse), max(high[0], x * inverse)
        low[1], high[1] = min(low[1], y * inverse), max(high[1], y * inverse)
        low[2], high[2] = min(low[2], z * inverse), max(high[2], z * inverse)
    axis = int((high - low).argmax())
    return axis, low[axis], max(high[axis] - low[axis], 1e-9), np.sqrt(nearest2)


@kernel
def _sort_points(points, point_normals, o, axis, low, per_bin, binned, order, begin):
    """Fills found (7, V): points from o, their squared distances and their normals, in bins of
    their direction's component along the axis; order (V,), and begin (_BINS + 1,) of the bins.
    """
    count = points.shape[0]
    bins = np.empty(count, np.int64)
    begin[:] = 0
    for v in range(count):
        p = points[v]
        x, y, z = p[0] - o[0], p[1] - o[1], p[2] - o[2]
        along = (p[axis] - o[axis]) / np.sqrt(max(x * x + y * y + z * z, 1e-12))
        bins[v] = min(max(int((along - low) * per_bin), 0), _BINS - 1)
        begin[bins[v] + 1] += 1
    for b in range(_BINS):
        begin[b + 1] += begin[b]
    filled = begin[:_BINS].copy()
    for v in range(count):
        k = filled[bins[v]]
        filled[bins[v]] += 1
        order[k] = v
        p, m = points[v], point_normals[v]
        x, y, z = p[0] - o[0], p[1] - o[1], p[2] - o[2]
        binned[0, k], binned[1, k], binned[2, k], binned[3, k] = x, y, z, x * x + y * y + z * z
        binned[4, k], binned[5, k], binned[6, k] = m[0], m[1], m[2]


@kernel
def _match_chunk(camera, center, ray, normal, points, point_normals, reach, matched, gap):
    """Part of `match_contours`: the contour points of one pose that are given.

    A point within reach of a ray is seen at most asin(reach / distance) from it, and so much, at
    most, differ the components of the two directions along any axis: only bins of so similar ones
    are searched. Distances are computed for a whole bin at once, by vector instructions; most of
    them are out of reach.
    """
    count = points.shape[0]
    binned, distance2 = np.empty((7, count)), np.empty(count)
    order, begin = np.empty(count, np.int64), np.empty(_BINS + 1, np.int64)
    seen_by, axis, low, per_bin, nearest = -1, 0, 0.0, 0.0, 0.0
    x, y, z, square = binned[0], binned[1], binned[2], binned[3]
    for i in range(camera.shape[0]):
        d, n = ray[i], normal[i]
        if camera[i] != seen_by:
            seen_by = camera[i]
            o = center[seen_by]
            axis, low, spread, nearest = _spread_axis(points, o)
            per_bin = _BINS / spread
            _sort_points(points, point_normals, o, axis, low, per_bin, binned, order, begin)
        radius, best, index = min(_FIRST_M, reach), np.inf, -1
        while True:
            apart = np.arcsin(radius / nearest) + 1e-6 if radius < nearest else 2.0
            first = int(min(max((d[axis] - apart - low) * per_bin, 0.0), _BINS - 1.0))
            last = int(min(max((d[axis] + apart - low) * per_bin, 0.0), _BINS - 1.0))
            for k in range(begin[first], begin[last + 1]):
                along = x[k] * d[0] + y[k] * d[1] + z[k] * d[2]
                distance2[k] = square[k] - along * along if along > 0.0 else np.inf
            limit = radius * radius
            for k in range(begin[first], begin[last + 1]):
                if distance2[k] >= limit:
                    continue
                facing = binned[4, k] * n[0] + binned[5, k] * n[1] + binned[6, k] * n[2]
                cost = distance2[k] + 0.01 * (1.0 - facing)
                if facing >= 0.5 and cost < best:
                    best, limit, index = cost, min(cost, limit), k
            if radius >= reach or best <= radius * radius:  # others are farther
                break
            radius = min(2.0 * radius, reach)
        matched[i], gap[i] = -1, 0.0
        if index >= 0:
            matched[i] = order[index]
            gap[i] = x[index] * n[0] + y[index] * n[1] + z[index] * n[2]


@kernel
def match_contours(camera, center, ray, normal, points, point_normals, reach, matched, gap):
    """Fills matched (K, N): the point of each of K posed surfaces that should touch each contour
    point's tangent plane.

    That is, among surface points (K, V, 3) whose normal points out of the plane (the rim as seen
    from that camera), the one nearest to the viewing ray, a deviating normal counting as distance;
    -1 if it is farther than `reach` (K,), m. Fills gap (K, N) with the signed distance from plane
    to point, positive outside.
    """
    count = camera.shape[0]
    chunks = (count + _CHUNK - 1) // _CHUNK
    for task in range(points.shape[0] * chunks):
        k, first = task // chunks, task % chunks * _CHUNK
        last = min(first + _CHUNK, count)
        _match_chunk(
            camera[first:last],
            center,
            ray[first:last],
            normal[first:last],
            points[k],
            point_normals[k],
            reach[k],
            matched[k, first:last],
            gap[k, first:last],
        )
