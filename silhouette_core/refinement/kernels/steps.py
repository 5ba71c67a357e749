"""Priors of K poses, and the bounded Gauss-Newton steps that their normal equations ask for.

Source: textbook Gauss-Newton; reweighting for Student's t as by Lange, Little and
Taylor (1989); rotations by Rodrigues' formula. Reference:
`tests.oracles.refinement`.
"""

import numpy as np

from silhouette_core.jit import kernel


@kernel
def _rotation_vector(turn, vector):
    """Fills vector (3,), radians, of a rotation matrix (3, 3), by way of its quaternion."""
    q = np.empty(4)
    trace = turn[0, 0] + turn[1, 1] + turn[2, 2]
    largest, value = 3, trace
    for a in range(3):
        if turn[a, a] > value:
            largest, value = a, turn[a, a]
    if largest == 3:
        q[0] = turn[2, 1] - turn[1, 2]
        q[1] = turn[0, 2] - turn[2, 0]
        q[2] = turn[1, 0] - turn[0, 1]
        q[3] = 1.0 + trace
    else:
        a, b, c = largest, (largest + 1) % 3, (largest + 2) % 3
        q[a] = 1.0 - trace + 2.0 * turn[a, a]
        q[b] = turn[b, a] + turn[a, b]
        q[c] = turn[c, a] + turn[a, c]
        q[3] = turn[c, b] - turn[b, c]
    if q[3] < 0.0:
        q *= -1.0
    sine = np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
    angle = 2.0 * np.arctan2(sine, q[3])
    scale = angle / sine if sine > 1e-12 * q[3] else 2.0 / q[3]
    for a in range(3):
        vector[a] = scale * q[a]


@kernel
def _turn_by(vector, rotation):
    """Replaces rotation (3, 3) R by Exp(vector) R."""
    x, y, z = vector[0], vector[1], vector[2]
    angle2 = x * x + y * y + z * z
    if angle2 < 1e-8:
        s, c = 1.0 - angle2 / 6.0, 0.5 - angle2 / 24.0
    else:
        angle = np.sqrt(angle2)
        s, c = np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle2
    for column in range(3):
        a, b, d = rotation[0, column], rotation[1, column], rotation[2, column]
        along = x * a + y * b + z * d
        # R v + s w x v + c (w (w v) - w² v), for every column v.
        rotation[0, column] = a + s * (y * d - z * b) + c * (x * along - angle2 * a)
        rotation[1, column] = b + s * (z * a - x * d) + c * (y * along - angle2 * b)
        rotation[2, column] = d + s * (x * b - y * a) + c * (z * along - angle2 * d)


@kernel
def add_pose_terms(poses, means, precision, usual, matrix, gradient):
    """Adds the priors of K poses to matrix (K, n, n) and gradient (K, n): resting stance,
    a Gaussian.

    poses are roots (K, 3), rotations (K, 3, 3) and angles (K, D), means the same of the Gaussians
    with the precisions (K, n), 0 for none. usual holds the precisions (K, D) of the resting stance,
    1/rad², and its angles (D,).
    """
    roots, rotations, angles = poses
    stance_precision, stance = usual
    turn, vector = np.empty((3, 3)), np.empty(3)
    for k in range(angles.shape[0]):
        for d in range(angles.shape[1]):
            angle, curvature = angles[k, d], stance_precision[k, d]
            gradient[k, 6 + d] += curvature * (angle - stance[d])
            off = angle - means[2][k, d]
            gradient[k, 6 + d] += precision[k, 6 + d] * off
            matrix[k, 6 + d, 6 + d] += curvature + precision[k, 6 + d]
        turn[:] = 0.0
        for i in range(3):
            for j in range(3):
                for a in range(3):
                    turn[i, j] += rotations[k, i, a] * means[1][k, j, a]
        _rotation_vector(turn, vector)
        for a in range(3):
            gradient[k, a] += precision[k, a] * (roots[k, a] - means[0][k, a])
            gradient[k, 3 + a] += precision[k, 3 + a] * vector[a]
            matrix[k, a, a] += precision[k, a]
            matrix[k, 3 + a, 3 + a] += precision[k, 3 + a]


@kernel
def _landmark_rows(part, local, descends, dof_part, rotation, origin, axis, place, rows):
    """Fills place (L, 3) and its derivatives rows (L, 3, n)."""
    rows[:] = 0.0
    for m in range(part.shape[0]):
        p = part[m]
        for a in range(3):
            place[m, a] = origin[p, a]
            for b in range(3):
                place[m, a] += rotation[p, a, b] * local[m, b]
            rows[m, a, a] = 1.0
        x, y, z = (
            place[m, 0] - origin[0, 0],
            place[m, 1] - origin[0, 1],
            place[m, 2] - origin[0, 2],
        )
        rows[m, 0, 4], rows[m, 0, 5] = z, -y
        rows[m, 1, 3], rows[m, 1, 5] = -z, x
        rows[m, 2, 3], rows[m, 2, 4] = y, -x
        for d in range(dof_part.shape[0]):
            q = dof_part[d]
            if descends[q, p]:
                x, y, z = (
                    place[m, 0] - origin[q, 0],
                    place[m, 1] - origin[q, 1],
                    place[m, 2] - origin[q, 2],
                )
                rows[m, 0, 6 + d] = axis[d, 1] * z - axis[d, 2] * y
                rows[m, 1, 6 + d] = axis[d, 2] * x - axis[d, 0] * z
                rows[m, 2, 6 + d] = axis[d, 0] * y - axis[d, 1] * x


@kernel
def _add_weighed(rows, precision, weight, error, columns, weighed, matrix, gradient):
    """Adds rows^T (weight precision) rows and the gradient, of rows (3, n) mostly zero."""
    count = 0
    for j in range(rows.shape[1]):
        if rows[0, j] != 0.0 or rows[1, j] != 0.0 or rows[2, j] != 0.0:
            columns[count] = j
            for a in range(3):
                weighed[count, a] = weight * (
                    precision[a, 0] * rows[0, j]
                    + precision[a, 1] * rows[1, j]
                    + precision[a, 2] * rows[2, j]
                )
            count += 1
    for i in range(count):
        w, first = weighed[i], columns[i]
        gradient[first] += w[0] * error[0] + w[1] * error[1] + w[2] * error[2]
        for j in range(count):
            c = columns[j]
            matrix[first, c] += w[0] * rows[0, c] + w[1] * rows[1, c] + w[2] * rows[2, c]


@kernel
def _add_landmarks(body, placed, prior, pelvis, freedom, matrix, gradient):
    """`add_landmark_terms` of one pose."""
    part, local, descends, dof_part = body
    rotation, origin, axis = placed
    relative, precision = prior
    size = matrix.shape[0]
    place, rows = np.empty((part.shape[0], 3)), np.empty((part.shape[0], 3, size))
    columns, weighed, error = np.empty(size, np.int64), np.empty((size, 3)), np.empty(3)
    _landmark_rows(part, local, descends, dof_part, rotation, origin, axis, place, rows)
    for m in range(1, part.shape[0]):
        square = 0.0
        for a in range(3):
            error[a] = place[m, a] - place[0, a] - relative[m, a]
            for j in range(size):
                rows[m, a, j] -= rows[0, a, j]
        for a in range(3):
            for b in range(3):
                square += error[a] * precision[m, a, b] * error[b]
        weight = (freedom + 3.0) / (freedom + square)
        _add_weighed(rows[m], precision[m], weight, error, columns, weighed, matrix, gradient)
    for a in range(3):
        error[a] = place[0, a] - pelvis[0][a]
    _add_weighed(rows[0], pelvis[1], 1.0, error, columns, weighed, matrix, gradient)


@kernel
def add_landmark_terms(body, placed, prior, freedom, matrix, gradient):
    """Adds priors of the L landmarks of K poses to matrix (K, n, n) and gradient (K, n).

    body is the part (L,) of each landmark, its place in that part (L, 3), descends (P, P) and
    dof_part (D,); placed is part_rotation (K, P, 3, 3), part_origin (K, P, 3) and world_axis
    (K, D, 3). prior is: given (K,) bool, the means (K, L, 3) relative to landmark 0 and their
    inverse squared scales (K, L, 3, 3), of a Student's t of that many degrees of freedom; the mean
    (K, 3) and the inverse covariance (K, 3, 3) of landmark 0.
    """
    rotations, origins, axes = placed
    given, relative, precision, pelvis, pelvis_precision = prior
    for k in range(given.shape[0]):
        if given[k]:
            placement, precisions = (rotations[k], origins[k], axes[k]), (relative[k], precision[k])
            mean = pelvis[k], pelvis_precision[k]
            _add_landmarks(body, placement, precisions, mean, freedom, matrix[k], gradient[k])


@kernel
def _solve(matrix, vector, count):
    """Solves for vector in place, by an LDL^T decomposition of the first `count` rows of matrix."""
    for j in range(count):
        inverse = 1.0 / matrix[j, j]
        upper = matrix[j]
        for i in range(j + 1, count):
            factor = upper[i] * inverse
            row = matrix[i]
            for c in range(i, count):
                row[c] -= factor * upper[c]
            vector[i] -= factor * vector[j]
    for i in range(count - 1, -1, -1):
        row = matrix[i]
        total = vector[i]
        for c in range(i + 1, count):
            total -= row[c] * vector[c]
        vector[i] = total / row[i]


@kernel
def _bounded_step(matrix, gradient, free, low, high, step):
    """`bounded_steps` of one quadratic."""
    count = free.shape[0]
    moving, part, solved = free.copy(), np.empty((count, count)), np.empty(count)
    for d in range(step.shape[0]):
        step[d] = 0.0
    while count:
        for i in range(count):
            row = matrix[moving[i]]
            total = gradient[moving[i]]
            for j in range(row.shape[0]):
                total += row[j] * step[j]
            solved[i] = -total
            for j in range(i, count):
                part[i, j] = row[moving[j]]
            part[i, i] += 1e-6
        _solve(part, solved, count)
        left = 0
        for i in range(count):
            m = moving[i]
            if solved[i] < low[m]:
                step[m] = low[m]
            elif solved[i] > high[m]:
                step[m] = high[m]
            else:
                moving[left], solved[left] = m, solved[i]
                left += 1
        if left == count:
            for i in range(count):
                step[moving[i]] = solved[i]
            break
        count = left


@kernel
def bounded_steps(matrix, gradient, free, low, high, steps):
    """Fills steps (K, n), which minimise the quadratics of matrix (K, n, n) and gradient (K, n)
    within bounds low and high (K, n); only the unknowns `free` move.

    Unknowns are fixed at the bounds that they violate, until none does.
    """
    for k in range(matrix.shape[0]):
        _bounded_step(matrix[k], gradient[k], free, low[k], high[k], steps[k])


@kernel
def move_poses(steps, limits, roots, rotations, angles):
    """Moves K poses, roots (K, 3), rotations (K, 3, 3) and angles (K, D), by steps (K, 6 + D) in
    place; angles are clipped to limits (D, 2).
    """
    for k in range(steps.shape[0]):
        for a in range(3):
            roots[k, a] += steps[k, a]
        _turn_by(steps[k, 3:6], rotations[k])
        for d in range(angles.shape[1]):
            angle = angles[k, d] + steps[k, 6 + d]
            angles[k, d] = min(max(angle, limits[d, 0]), limits[d, 1])
