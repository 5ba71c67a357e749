"""Residuals of the continuous refinement, their Jacobian, and the normal equations.

Source: articulated iterative closest points on contours, as in Rosenhahn, Brox and Weickert,
"Three-dimensional shape knowledge for joint image segmentation and pose tracking" (2007); the
tangent planes and the choice of the rim are ours. Gauss-Newton is textbook. Reference:
`silhouette_core.refinement.kernels.reference`.
"""

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange


@parallel_kernel
def match_contours(camera, center, ray, normal, points, point_normals, reach, matched, gap):
    """Fills matched (N,): the surface point that should touch each contour point's tangent plane.

    That is, among surface points whose normal points out of the plane (the rim as seen from that
    camera), the one nearest to the viewing ray, a deviating normal counting as distance; -1 if it
    is farther than `reach` (m). Fills gap (N,) with the signed distance from plane to point,
    positive outside.
    """
    for i in prange(camera.shape[0]):
        o, d, n = center[camera[i]], ray[i], normal[i]
        best, index = 1e30, -1
        for v in range(points.shape[0]):
            facing = (
                point_normals[v, 0] * n[0] + point_normals[v, 1] * n[1] + point_normals[v, 2] * n[2]
            )
            if facing < 0.5:
                continue
            x, y, z = points[v, 0] - o[0], points[v, 1] - o[1], points[v, 2] - o[2]
            along = x * d[0] + y * d[1] + z * d[2]
            if along <= 0.0:
                continue
            distance2 = x * x + y * y + z * z - along * along
            cost = distance2 + 0.01 * (1.0 - facing)
            if cost < best and distance2 < reach * reach:
                best, index = cost, v
        matched[i] = index
        if index >= 0:
            gap[i] = (
                (points[index, 0] - o[0]) * n[0]
                + (points[index, 1] - o[1]) * n[1]
                + (points[index, 2] - o[2]) * n[2]
            )
        else:
            gap[i] = 0.0


@kernel
def measure_outside(points, intrinsics, rotation, translation, outside, gap, direction):
    """Fills gap (V,): distance of each surface point outside one camera's silhouette, in metres at
    the point's depth (0 inside the silhouette and outside the image), and direction (V, 3), the
    world direction in which it grows.
    """
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
    placed, whole = np.empty((4, 3)), np.empty(3)
    for i in range(index.shape[0]):
        v = index[i]
        n = direction[i]
        placed[:] = 0.0
        whole[:] = 0.0
        for k in range(4):
            w = skin_weights[v, k]
            if w == 0.0:
                continue
            p = skin_parts[v, k]
            for a in range(3):
                position = part_origin[p, a]
                for b in range(3):
                    position += part_rotation[p, a, b] * (rest[v, b] - joints[p, b])
                placed[k, a] = w * position
                whole[a] += w * position
        lx, ly = whole[0] - part_origin[0, 0], whole[1] - part_origin[0, 1]
        lz = whole[2] - part_origin[0, 2]
        rows[i, 0], rows[i, 1], rows[i, 2] = n[0], n[1], n[2]
        rows[i, 3] = ly * n[2] - lz * n[1]
        rows[i, 4] = lz * n[0] - lx * n[2]
        rows[i, 5] = lx * n[1] - ly * n[0]
        for d in range(dof_part.shape[0]):
            part = dof_part[d]
            fraction, lx, ly, lz = 0.0, 0.0, 0.0, 0.0
            for k in range(4):
                if skin_weights[v, k] > 0.0 and descends[part, skin_parts[v, k]]:
                    fraction += skin_weights[v, k]
                    lx += placed[k, 0]
                    ly += placed[k, 1]
                    lz += placed[k, 2]
            if fraction == 0.0:
                rows[i, 6 + d] = 0.0
                continue
            lx -= fraction * part_origin[part, 0]
            ly -= fraction * part_origin[part, 1]
            lz -= fraction * part_origin[part, 2]
            a = world_axis[d]
            rows[i, 6 + d] = (
                a[0] * (ly * n[2] - lz * n[1])
                + a[1] * (lz * n[0] - lx * n[2])
                + a[2] * (lx * n[1] - ly * n[0])
            )


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
