"""Residuals of the continuous refinement, their Jacobian, and the normal equations.

Source: Gauss-Newton is textbook; sums of products of wrenches by part, as the composite rigid
bodies of Featherstone, "Rigid body dynamics algorithms" (2008). Reference:
`tests.oracles.refinement`.
"""

import numpy as np

from silhouette_core.jit import kernel


@kernel
def measure_outside(points, intrinsics, rotation, translation, outside, gap, direction):
    """Fills gap (K, V): distance of each point of K surfaces (K, V, 3) outside one camera's
    silhouette, in metres at the point's depth (0 inside the silhouette and outside the image), and
    direction (K, V, 3), the world direction in which it grows, where it is not 0.
    """
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    r, t = rotation, translation
    height, width = outside.shape
    gap[:] = 0.0
    for k in range(points.shape[0]):
        for v in range(points.shape[1]):
            p = points[k, v]
            x = r[0, 0] * p[0] + r[0, 1] * p[1] + r[0, 2] * p[2] + t[0]
            y = r[1, 0] * p[0] + r[1, 1] * p[1] + r[1, 2] * p[2] + t[1]
            z = r[2, 0] * p[0] + r[2, 1] * p[1] + r[2, 2] * p[2] + t[2]
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
            for c in range(3):
                direction[k, v, c] = r[0, c] * gx + r[1, c] * gy + r[2, c] * gz
            gap[k, v] = distance * z / fx


@kernel
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
    """Fills points (K, V, 3) of K poses by linear blend skinning, and normals (K, V, 3) by the
    blended rotation.
    """
    points[:] = 0.0
    normals[:] = 0.0
    for pose in range(points.shape[0]):
        turns, origins = part_rotation[pose], part_origin[pose]
        posed, facing = points[pose], normals[pose]
        for v in range(rest.shape[0]):
            for k in range(skin_parts.shape[1]):
                w = skin_weights[v, k]
                if w == 0.0:
                    continue
                p = skin_parts[v, k]
                for i in range(3):
                    position, normal = origins[p, i], 0.0
                    for j in range(3):
                        position += turns[p, i, j] * (rest[v, j] - joints[p, j])
                        normal += turns[p, i, j] * rest_normals[v, j]
                    posed[v, i] += w * position
                    facing[v, i] += w * normal
            length = np.sqrt(facing[v, 0] ** 2 + facing[v, 1] ** 2 + facing[v, 2] ** 2)
            if length > 0.0:
                for i in range(3):
                    facing[v, i] /= length


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
    rows[:] = 0.0
    for i in range(index.shape[0]):
        v, n, row = index[i], direction[i], rows[i]
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
        row[0], row[1], row[2] = n[0], n[1], n[2]
        row[3] = ly * n[2] - lz * n[1]
        row[4] = lz * n[0] - lx * n[2]
        row[5] = lx * n[1] - ly * n[0]
        part, fraction = -1, 0.0
        tx, ty, tz = 0.0, 0.0, 0.0
        for d in range(dof_part.shape[0]):
            if dof_part[d] != part:  # the angles of one part lie next to each other
                part = dof_part[d]
                fraction, lx, ly, lz = 0.0, 0.0, 0.0, 0.0
                for k in range(4):
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
                row[6 + d] = a[0] * tx + a[1] * ty + a[2] * tz


@kernel
def fill_shape_jacobian(
    index,
    direction,
    skin_parts,
    skin_weights,
    part_rotation,
    vertices_change,
    joints_change,
    origin_change,
    rows,
):
    """Fills rows (N, K): derivatives of direction . point by K shape deviations.

    These change the points at rest by vertices_change (V, K, 3), the joints at rest by
    joints_change (K, P, 3), and the posed joints by origin_change (K, P, 3).
    """
    back = np.empty(3)
    rows[:] = 0.0
    for i in range(index.shape[0]):
        v, n = index[i], direction[i]
        for k in range(4):
            w = skin_weights[v, k]
            if w == 0.0:
                continue
            p = skin_parts[v, k]
            turn = part_rotation[p]
            for a in range(3):
                back[a] = w * (n[0] * turn[0, a] + n[1] * turn[1, a] + n[2] * turn[2, a])
            for s in range(rows.shape[1]):
                at_rest, joint, origin = (
                    vertices_change[v, s],
                    joints_change[s, p],
                    origin_change[s, p],
                )
                for a in range(3):
                    rows[i, s] += back[a] * (at_rest[a] - joint[a]) + w * n[a] * origin[a]


@kernel
def _add_residual(v, n, weight, gap, body, part_rotation, part_origin, wrench, moments, forces):
    """Adds a weighted residual along n of point v to moments (P, P, 6, 6), whose first part has
    the greater number, and to forces (P, 6); wrench (4, 6) is overwritten.
    """
    rest, joints, skin_parts, skin_weights = body[0], body[1], body[2], body[3]
    for k in range(4):
        w = skin_weights[v, k]
        if w == 0.0:
            continue
        p, h = skin_parts[v, k], wrench[k]
        x, y, z = rest[v, 0] - joints[p, 0], rest[v, 1] - joints[p, 1], rest[v, 2] - joints[p, 2]
        turn, origin = part_rotation[p], part_origin[p]
        px = w * (turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z + origin[0])
        py = w * (turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z + origin[1])
        pz = w * (turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z + origin[2])
        h[0], h[1], h[2] = w * n[0], w * n[1], w * n[2]
        h[3], h[4] = py * n[2] - pz * n[1], pz * n[0] - px * n[2]
        h[5] = px * n[1] - py * n[0]
        for a in range(6):
            forces[p, a] += weight * gap * h[a]
        for j in range(k + 1):
            if skin_weights[v, j] == 0.0:
                continue
            q, other = skin_parts[v, j], wrench[j]
            if p >= q:
                block, left, right = moments[p, q], h, other
            else:
                block, left, right = moments[q, p], other, h
            for a in range(6):
                scaled = weight * left[a]
                for b in range(6):
                    block[a, b] += scaled * right[b]


@kernel
def _add_block(total, block):
    """Adds a block (6, 6) to a total."""
    for a in range(6):
        for b in range(6):
            total[a, b] += block[a, b]


@kernel
def _add_moments(moments, forces, body, part_origin, world_axis, matrix, gradient):
    """Adds to matrix (n, n) and gradient (n,) what residuals gave to moments and forces.

    Unknown d moves the parts that descend from its own by the twist (o x a, a) of its axis a
    through o; the root's six move all parts.
    """
    descends, dof_part = body[4], body[5]
    parts, size = len(forces), len(gradient)
    composite, met = np.zeros((parts + 1, parts, 6, 6)), np.zeros((parts + 1, parts), np.bool_)
    twist, force = np.zeros((size, 6)), np.zeros((parts + 1, 6))
    for k in range(parts):
        for m in range(k + 1):
            block = moments[k, m]
            if block[0, 0] + block[1, 1] + block[2, 2] == 0.0:
                continue
            for s in range(parts + 1):
                if s == parts or descends[s, k]:
                    _add_block(composite[s, m], block)
                    met[s, m] = True
                if k != m and (s == parts or descends[s, m]):
                    _add_block(composite[s, k].T, block)
                    met[s, k] = True
        for s in range(parts + 1):
            if s == parts or descends[s, k]:
                for a in range(6):
                    force[s, a] += forces[k, a]
    o = part_origin[0]
    for a in range(3):
        twist[a, a] = 1.0
        twist[3 + a, 3 + a] = 1.0
    twist[3, 1], twist[3, 2] = o[2], -o[1]
    twist[4, 0], twist[4, 2] = -o[2], o[0]
    twist[5, 0], twist[5, 1] = o[1], -o[0]
    for d in range(len(dof_part)):
        o, a, t = part_origin[dof_part[d]], world_axis[d], twist[6 + d]
        t[0], t[1] = o[1] * a[2] - o[2] * a[1], o[2] * a[0] - o[0] * a[2]
        t[2] = o[0] * a[1] - o[1] * a[0]
        t[3], t[4], t[5] = a[0], a[1], a[2]
    moved, response = np.empty((parts, 6)), np.empty((parts + 1, 6))
    for d in range(size):
        s, t = dof_part[d - 6] if d >= 6 else parts, twist[d]
        for a in range(6):
            gradient[d] += t[a] * force[s, a]
        response[:] = 0.0
        for m in range(parts):
            if not met[s, m]:
                continue
            moment = moved[m]
            moment[:] = 0.0
            for a in range(6):
                for b in range(6):
                    moment[b] += t[a] * composite[s, m, a, b]
            for q in range(parts + 1):
                if q == parts or descends[q, m]:
                    for b in range(6):
                        response[q, b] += moment[b]
        for e in range(d + 1):
            other = response[dof_part[e - 6] if e >= 6 else parts]
            total = 0.0
            for b in range(6):
                total += twist[e, b] * other[b]
            matrix[d, e] += total


@kernel
def _add_terms(contour, outside, weights, outside_m, body, placed, matrix, gradient):
    """`add_silhouette_terms` of one pose."""
    matched, gap, normal = contour
    distance, toward = outside
    rotation, origin, axis = placed
    parts, wrench = rotation.shape[0], np.empty((4, 6))
    moments, forces = np.zeros((parts, parts, 6, 6)), np.zeros((parts, 6))
    for i in range(matched.shape[0]):
        v = matched[i]
        if v < 0:
            continue
        r = gap[i]
        w = weights[1] / (1 + (r / weights[0]) ** 2) ** 2
        _add_residual(v, normal[i], w, r, body, rotation, origin, wrench, moments, forces)
    for c in range(distance.shape[0]):
        for v in range(distance.shape[1]):
            r = distance[c, v]
            if r <= 0.0:
                continue
            w = weights[2] / (1 + (r / outside_m) ** 2) ** 2
            _add_residual(v, toward[c, v], w, r, body, rotation, origin, wrench, moments, forces)
    _add_moments(moments, forces, body, origin, axis, matrix, gradient)
    for a in range(matrix.shape[0]):
        for b in range(a):
            matrix[b, a] = matrix[a, b]


@kernel
def add_silhouette_terms(contour, outside, weights, outside_m, body, placed, matrix, gradient):
    """Adds J^T W J to matrix (K, n, n) and J^T W r to gradient (K, n) of K poses: contours as
    `match_contours` matched them, then points as `measure_outside` found them outside.

    contour is matched (K, N), gap (K, N) and normal (N, 3); outside is gap (K, C, V) and direction
    (K, C, V, 3). weights (K, 3) are the scale of a contour residual's robust weight (m), its
    largest weight and that of a point outside, 1/m², whose scale is outside_m; a pose of weight 0
    is left out. body is rest, joints, skin_parts, skin_weights, descends and dof_part of
    `fill_jacobian`; placed is part_rotation, part_origin and world_axis, each of K poses.

    The residuals are summed by the parts that move them before they are related to the unknowns,
    of which they depend on many more.
    """
    matched, gap, normal = contour
    distance, toward = outside
    rotations, origins, axes = placed
    for k in range(matched.shape[0]):
        if weights[k, 1] != 0.0:
            matches, beyond = (matched[k], gap[k], normal), (distance[k], toward[k])
            body_at = rotations[k], origins[k], axes[k]
            _add_terms(
                matches, beyond, weights[k], outside_m, body, body_at, matrix[k], gradient[k]
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
