"""Residuals of the continuous refinement, their Jacobian, and the normal equations.

Source: articulated iterative closest points on contours, as in Rosenhahn, Brox and Weickert,
"Three-dimensional shape knowledge for joint image segmentation and pose tracking" (2007); the
tangent planes and the choice of the rim are ours. Gauss-Newton is textbook. Reference:
`silhouette_core.refinement.kernels.reference`.
"""

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange

_CHUNK = 32  # contour points that are matched together


@kernel
def _match_chunk(camera, center, ray, normal, points, point_normals, reach, matched, gap):
    """Part of `match_contours`: the contour points of one pose that are given.

    Distances are computed for all surface points at once, by vector instructions; most of them are
    out of reach.
    """
    count = points.shape[0]
    x, y, z = np.empty(count), np.empty(count), np.empty(count)
    square, distance2 = np.empty(count), np.empty(count)
    seen_by = -1
    for i in range(camera.shape[0]):
        d, n = ray[i], normal[i]
        if camera[i] != seen_by:
            seen_by = camera[i]
            o = center[seen_by]
            for v in range(count):
                x[v], y[v], z[v] = points[v, 0] - o[0], points[v, 1] - o[1], points[v, 2] - o[2]
                square[v] = x[v] * x[v] + y[v] * y[v] + z[v] * z[v]
        for v in range(count):
            along = x[v] * d[0] + y[v] * d[1] + z[v] * d[2]
            distance2[v] = square[v] - along * along if along > 0.0 else np.inf
        best, limit, index = 1e30, reach * reach, -1
        for v in range(count):
            if distance2[v] >= limit:
                continue
            m = point_normals[v]
            facing = m[0] * n[0] + m[1] * n[1] + m[2] * n[2]
            cost = distance2[v] + 0.01 * (1.0 - facing)
            if facing >= 0.5 and cost < best:
                best, limit, index = cost, min(cost, limit), v
        matched[i], gap[i] = index, 0.0
        if index >= 0:
            gap[i] = x[index] * n[0] + y[index] * n[1] + z[index] * n[2]


@parallel_kernel
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
    for task in prange(points.shape[0] * chunks):
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


@kernel
def _measure_one(points, intrinsics, rotation, translation, outside, gap, direction):
    """One surface of `measure_outside`."""
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    height, width = outside.shape
    for v in range(points.shape[0]):
        gap[v] = 0.0
        p = points[v]
        x = rotation[0, 0] * p[0] + rotation[0, 1] * p[1] + rotation[0, 2] * p[2] + translation[0]
        y = rotation[1, 0] * p[0] + rotation[1, 1] * p[1] + rotation[1, 2] * p[2] + translation[1]
        z = rotation[2, 0] * p[0] + rotation[2, 1] * p[1] + rotation[2, 2] * p[2] + translation[2]
        if z <= 0.05:
            continue
        u, w = fx * x / z + cx, fy * y / z + cy
        if not (1.0 <= u < width - 2.0 and 1.0 <= w < height - 2.0):
            continue
        i, j = int(u), int(w)
        a, b = u - i, w - j
        d00, d01 = outside[j, i], outside[j, i + 1]
        d10, d11 = outside[j + 1, i], outside[j + 1, i + 1]
        distance = (1 - b) * ((1 - a) * d00 + a * d01) + b * ((1 - a) * d10 + a * d11) - 0.5
        if distance <= 0.0:
            continue
        gx = (1 - b) * (d01 - d00) + b * (d11 - d10)
        gy = (1 - a) * (d10 - d00) + a * (d11 - d01)
        gz = -(gx * x + gy * y) / z
        for k in range(3):
            direction[v, k] = rotation[0, k] * gx + rotation[1, k] * gy + rotation[2, k] * gz
        gap[v] = distance * z / fx


@parallel_kernel
def measure_outside(points, intrinsics, rotation, translation, outside, gap, direction):
    """Fills gap (K, V): distance of each point of K surfaces (K, V, 3) outside one camera's
    silhouette, in metres at the point's depth (0 inside the silhouette and outside the image), and
    direction (K, V, 3), the world direction in which it grows, where it is not 0.
    """
    for k in prange(points.shape[0]):
        _measure_one(points[k], intrinsics, rotation, translation, outside, gap[k], direction[k])


@kernel
def pose_surface(
    rest,
    rest_normals,
    joints,
    skin_parts,
    skin_weights,
    part_rotation,
    part_origin,
    points,
    normals,
):
    """Fills points (V, 3) by linear blend skinning and normals (V, 3) by the blended rotation."""
    for v in range(rest.shape[0]):
        for i in range(3):
            points[v, i] = 0.0
            normals[v, i] = 0.0
        for k in range(skin_parts.shape[1]):
            w = skin_weights[v, k]
            if w == 0.0:
                continue
            p = skin_parts[v, k]
            for i in range(3):
                position, normal = part_origin[p, i], 0.0
                for j in range(3):
                    position += part_rotation[p, i, j] * (rest[v, j] - joints[p, j])
                    normal += part_rotation[p, i, j] * rest_normals[v, j]
                points[v, i] += w * position
                normals[v, i] += w * normal
        length = np.sqrt(normals[v, 0] ** 2 + normals[v, 1] ** 2 + normals[v, 2] ** 2)
        if length > 0.0:
            for i in range(3):
                normals[v, i] /= length


@parallel_kernel
def pose_surfaces(
    rest,
    rest_normals,
    joints,
    skin_parts,
    skin_weights,
    part_rotation,
    part_origin,
    points,
    normals,
):
    """Fills points and normals (K, V, 3) of K poses, each as `pose_surface` does."""
    for k in prange(points.shape[0]):
        pose_surface(
            rest,
            rest_normals,
            joints,
            skin_parts,
            skin_weights,
            part_rotation[k],
            part_origin[k],
            points[k],
            normals[k],
        )


@kernel
def _fill_row(v, n, body, part_rotation, part_origin, world_axis, columns, values):
    """Derivatives of n . point v of the surface that are not 0: their columns and values, as many
    as the number returned.
    """
    rest, joints, skin_parts, skin_weights, descends, dof_part = body
    placed, whole = np.empty((4, 3)), np.zeros(3)
    used = 0  # skinning parts of weight 0 come last, or are skipped below
    for k in range(4):
        w = skin_weights[v, k]
        if w == 0.0:
            continue
        used = k + 1
        p = skin_parts[v, k]
        for a in range(3):
            position = part_origin[p, a]
            for b in range(3):
                position += part_rotation[p, a, b] * (rest[v, b] - joints[p, b])
            placed[k, a] = w * position
            whole[a] += w * position
    lx, ly = whole[0] - part_origin[0, 0], whole[1] - part_origin[0, 1]
    lz = whole[2] - part_origin[0, 2]
    for a in range(6):
        columns[a] = a
    values[0], values[1], values[2] = n[0], n[1], n[2]
    values[3] = ly * n[2] - lz * n[1]
    values[4] = lz * n[0] - lx * n[2]
    values[5] = lx * n[1] - ly * n[0]
    count, part, fraction = 6, -1, 0.0
    tx, ty, tz = 0.0, 0.0, 0.0
    for d in range(dof_part.shape[0]):
        if dof_part[d] != part:  # the angles of one part lie next to each other
            part = dof_part[d]
            fraction, lx, ly, lz = 0.0, 0.0, 0.0, 0.0
            for k in range(used):
                w = skin_weights[v, k]
                if w > 0.0 and descends[part, skin_parts[v, k]]:
                    fraction += w
                    lx += placed[k, 0]
                    ly += placed[k, 1]
                    lz += placed[k, 2]
            if fraction != 0.0:
                lx -= fraction * part_origin[part, 0]
                ly -= fraction * part_origin[part, 1]
                lz -= fraction * part_origin[part, 2]
                tx, ty, tz = ly * n[2] - lz * n[1], lz * n[0] - lx * n[2], lx * n[1] - ly * n[0]
        if fraction != 0.0:
            a = world_axis[d]
            columns[count] = 6 + d
            values[count] = a[0] * tx + a[1] * ty + a[2] * tz
            count += 1
    return count


@kernel
def fill_jacobian(
    index,
    direction,
    rest,
    joints,
    skin_parts,
    skin_weights,
    part_rotation,
    part_origin,
    descends,
    dof_part,
    world_axis,
    rows,
):
    """Fills rows (N, 6 + D): derivatives of direction . point by root position, root rotation
    vector (world) and joint angles.
    """
    body = rest, joints, skin_parts, skin_weights, descends, dof_part
    columns, values = np.empty(rows.shape[1], np.int64), np.empty(rows.shape[1])
    rows[:] = 0.0
    for i in range(index.shape[0]):
        count = _fill_row(
            index[i],
            direction[i],
            body,
            part_rotation,
            part_origin,
            world_axis,
            columns,
            values,
        )
        for c in range(count):
            rows[i, columns[c]] = values[c]


@kernel
def _add_row(columns, values, count, weight, gap, matrix, gradient):
    """Adds one weighted residual to the lower triangle of matrix and to gradient."""
    for a in range(count):
        scaled = weight * values[a]
        gradient[columns[a]] += scaled * gap
        for b in range(a + 1):
            matrix[columns[a], columns[b]] += scaled * values[b]


@parallel_kernel
def add_silhouette_terms(
    contour, outside, weights, outside_m, body, placed, matrix, gradient, totals
):
    """Adds J^T W J to matrix (K, n, n) and J^T W r to gradient (K, n) of K poses: contours as
    `match_contours` matched them, then points as `measure_outside` found them outside.

    contour is matched (K, N), gap (K, N) and normal (N, 3); outside is gap (K, C, V) and direction
    (K, C, V, 3). weights (K, 3) are the scale of a contour residual's robust weight (m), its
    largest weight and that of a point outside, 1/m², whose scale is outside_m; a pose of weight 0
    is left out. body is rest, joints, skin_parts, skin_weights, descends and dof_part of
    `fill_jacobian`; placed is part_rotation, part_origin and world_axis, each of K poses. Fills
    totals (K, 3): sums of w r² and of w, and the number of matched contour points.
    """
    matched, gap, normal = contour
    away, toward = outside
    rotations, origins, axes = placed
    size = matrix.shape[1]
    for k in prange(matched.shape[0]):
        totals[k] = 0.0
        if weights[k, 1] == 0.0:
            continue
        columns, values = np.empty(size, np.int64), np.empty(size)
        square, total, hits = 0.0, 0.0, 0
        for i in range(matched.shape[1]):
            v = matched[k, i]
            if v < 0:
                continue
            hits += 1
            r = gap[k, i]
            w = weights[k, 1] / (1 + (r / weights[k, 0]) ** 2) ** 2
            square += w * r * r
            total += w
            count = _fill_row(
                v, normal[i], body, rotations[k], origins[k], axes[k], columns, values
            )
            _add_row(columns, values, count, w, r, matrix[k], gradient[k])
        for c in range(away.shape[1]):
            for v in range(away.shape[2]):
                r = away[k, c, v]
                if r <= 0.0:
                    continue
                w = weights[k, 2] / (1 + (r / outside_m) ** 2) ** 2
                square += w * r * r
                total += w
                count = _fill_row(
                    v, toward[k, c, v], body, rotations[k], origins[k], axes[k], columns, values
                )
                _add_row(columns, values, count, w, r, matrix[k], gradient[k])
        totals[k, 0], totals[k, 1], totals[k, 2] = square, total, hits
        for a in range(size):
            for b in range(a):
                matrix[k, b, a] = matrix[k, a, b]


@kernel
def add_normal_equations(rows, weight, gap, matrix, gradient):
    """Adds J^T W J to matrix (n, n) and J^T W r to gradient (n,), with J the rows (N, n), W the
    diagonal of weight (N,), and r the gap (N,).

    Rows are mostly zeros, since few joints move a point, and so small that threads would cost more
    than they save.
    """
    nonzero = np.empty(rows.shape[1], np.int64)
    for i in range(rows.shape[0]):
        count = 0
        for j in range(rows.shape[1]):
            if rows[i, j] != 0.0:
                nonzero[count] = j
                count += 1
        for a in range(count):
            first = nonzero[a]
            scaled = weight[i] * rows[i, first]
            gradient[first] += scaled * gap[i]
            for b in range(a + 1):
                matrix[first, nonzero[b]] += scaled * rows[i, nonzero[b]]
    for a in range(matrix.shape[0]):
        for b in range(a):
            matrix[b, a] = matrix[a, b]
