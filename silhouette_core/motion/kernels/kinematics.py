"""Forward and inverse kinematics of a body, and linear blend skinning.

Source: Rodrigues' formula and the left Jacobian of SO(3) as in Barfoot, "State Estimation for
Robotics" (2017), section 7.1; linear blend skinning and the Gauss-Newton method are textbook.
Reference: `tests.oracles.motion`.
"""

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange
from silhouette_core.tuning import REFINEMENT

_STEPS = 30
_TRUST_RAD = REFINEMENT.trust_rad


@kernel
def exponential_map(vector, rotation, jacobian):
    """Fills rotation (3, 3) = Exp(vector) by Rodrigues' formula, and jacobian (3, 3), the left
    Jacobian of SO(3) there; series for small angles.
    """
    x, y, z = vector[0], vector[1], vector[2]
    angle2 = x * x + y * y + z * z
    if angle2 < 1e-8:
        s, c, d = 1.0 - angle2 / 6.0, 0.5 - angle2 / 24.0, 1.0 / 6.0 - angle2 / 120.0
    else:
        angle = np.sqrt(angle2)
        s = np.sin(angle) / angle
        c = (1.0 - np.cos(angle)) / angle2
        d = (1.0 - s) / angle2
    k = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
    for i in range(3):
        for j in range(3):
            square = vector[i] * vector[j] - (angle2 if i == j else 0.0)
            identity = 1.0 if i == j else 0.0
            rotation[i, j] = identity + s * k[i][j] + c * square
            jacobian[i, j] = identity + c * k[i][j] + d * square


@kernel
def _place_parts(body, root_rotation, root, angles, part_rotation, part_origin, world_axis):
    """Fills part_rotation (P, 3, 3) and part_origin (P, 3), world from part, and world_axis (D, 3):
    angle k moves a point x of its part at the rate world_axis[k] x (x - origin).
    """
    parents, joints, dof_part, dof_axis = body
    local, jacobian, vector = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    k = 0
    for p in range(parents.shape[0]):
        parent = parents[p]
        if parent < 0:
            for i in range(3):  # an assignment of arrays compiles for seconds
                part_origin[p, i] = root[i]
            base = root_rotation
        else:
            base = part_rotation[parent]
            for i in range(3):
                position = part_origin[parent, i]
                for j in range(3):
                    position += base[i, j] * (joints[p, j] - joints[parent, j])
                part_origin[p, i] = position
        first = k
        vector[0], vector[1], vector[2] = 0.0, 0.0, 0.0
        while k < dof_part.shape[0] and dof_part[k] == p:
            for i in range(3):
                vector[i] += angles[k] * dof_axis[k, i]
            k += 1
        exponential_map(vector, local, jacobian)
        for i in range(3):
            for j in range(3):
                part_rotation[p, i, j] = (
                    base[i, 0] * local[0, j] + base[i, 1] * local[1, j] + base[i, 2] * local[2, j]
                )
        for d in range(first, k):
            for i in range(3):
                vector[i] = (
                    jacobian[i, 0] * dof_axis[d, 0]
                    + jacobian[i, 1] * dof_axis[d, 1]
                    + jacobian[i, 2] * dof_axis[d, 2]
                )
            for i in range(3):
                world_axis[d, i] = (
                    base[i, 0] * vector[0] + base[i, 1] * vector[1] + base[i, 2] * vector[2]
                )


@kernel
def place_bodies(
    parents,
    joints,
    dof_part,
    dof_axis,
    root_rotations,
    roots,
    angles,
    part_rotations,
    part_origins,
    world_axes,
):
    """Fills part_rotations (K, P, 3, 3), part_origins (K, P, 3) and world_axes (K, D, 3) of K
    poses: angle d of pose k moves a point x of its part at the rate
    world_axes[k, d] x (x - origin).
    """
    body = (parents, joints, dof_part, dof_axis)
    for k in range(angles.shape[0]):
        rotation, origin, axes = part_rotations[k], part_origins[k], world_axes[k]
        _place_parts(body, root_rotations[k], roots[k], angles[k], rotation, origin, axes)


@parallel_kernel
def place_one_part(
    parents, joints, dof_part, dof_axis, root_rotation, root, angles, part, rotations, origins
):
    """Fills rotations (K, 3, 3) and origins (K, 3) of one part for each row of angles (K, D)."""
    for k in prange(angles.shape[0]):
        rotation, origin = np.empty((parents.shape[0], 3, 3)), np.empty((parents.shape[0], 3))
        body, axes = (parents, joints, dof_part, dof_axis), np.empty((dof_part.shape[0], 3))
        _place_parts(body, root_rotation, root, angles[k], rotation, origin, axes)
        for i in range(3):
            origins[k, i] = origin[part, i]
            for j in range(3):
                rotations[k, i, j] = rotation[part, i, j]


@kernel
def skin_vertices(vertices, joints, skin_parts, skin_weights, part_rotation, part_origin, posed):
    """Fills posed (V, 3) = sum_k w_k (R_k (v - J_k) + o_k)."""
    for v in range(vertices.shape[0]):
        x, y, z = 0.0, 0.0, 0.0
        for k in range(skin_parts.shape[1]):
            w = skin_weights[v, k]
            if w == 0.0:
                continue
            p = skin_parts[v, k]
            a, b, c = (
                vertices[v, 0] - joints[p, 0],
                vertices[v, 1] - joints[p, 1],
                vertices[v, 2] - joints[p, 2],
            )
            r = part_rotation[p]
            x += w * (r[0, 0] * a + r[0, 1] * b + r[0, 2] * c + part_origin[p, 0])
            y += w * (r[1, 0] * a + r[1, 1] * b + r[1, 2] * c + part_origin[p, 1])
            z += w * (r[2, 0] * a + r[2, 1] * b + r[2, 2] * c + part_origin[p, 2])
        posed[v, 0], posed[v, 1], posed[v, 2] = x, y, z


@kernel
def _descends(parents, ancestor, part):
    """Whether a part hangs on another, or is it."""
    while part >= 0 and part != ancestor:
        part = parents[part]
    return part == ancestor


@kernel
def _inner(one, other):
    """Inner product of two vectors (3,)."""
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


@kernel
def _solve(matrix, vector):
    """Replaces vector (n,) by the solution of matrix (n, n), symmetric and positive definite, whose
    lower triangle becomes its Cholesky factor. LAPACK takes seconds to compile in.
    """
    for i in range(vector.shape[0]):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = np.sqrt(total) if i == j else total / matrix[j, j]
        for k in range(i):
            vector[i] -= matrix[i, k] * vector[k]
        vector[i] /= matrix[i, i]
    for i in range(vector.shape[0] - 1, -1, -1):
        for k in range(i + 1, vector.shape[0]):
            vector[i] -= matrix[k, i] * vector[k]
        vector[i] /= matrix[i, i]


@kernel
def _solve_frame(body, limits, root, targets, directions, rest, angles):
    """Improves angles (D,) of one frame in place, as `solve_angles`.

    An angle at its limit that is pushed outward is fixed for the step, so that the next part
    takes over what it cannot do.
    """
    parents, _, dof_part, _ = body
    target_part, target_axis, weight = targets
    count, parts = dof_part.shape[0], parents.shape[0]
    rotation, origin = np.empty((parts, 3, 3)), np.empty((parts, 3))
    axes, zero = np.empty((count, 3)), np.zeros(3)
    normal, gradient = np.empty((count, count)), np.empty(count)
    columns, members = np.empty((count, 3)), np.empty(count, np.int64)
    pointing, error = np.empty(3), np.empty(3)
    previous = np.inf
    for _ in range(_STEPS):
        _place_parts(body, root, zero, angles, rotation, origin, axes)
        cost = 0.0
        normal[:] = 0.0
        for d in range(count):
            cost += rest * angles[d] ** 2
            gradient[d] = -rest * angles[d]
            normal[d, d] = rest + 1e-6
        for k in range(target_part.shape[0]):
            for i in range(3):
                row = rotation[target_part[k], i]
                pointing[i] = _inner(row, target_axis[k])
                error[i] = directions[k, i] - pointing[i]
            cost += weight[k] * _inner(error, error)
            used = 0
            for d in range(count):
                if _descends(parents, dof_part[d], target_part[k]):
                    columns[used, 0] = axes[d, 1] * pointing[2] - axes[d, 2] * pointing[1]
                    columns[used, 1] = axes[d, 2] * pointing[0] - axes[d, 0] * pointing[2]
                    columns[used, 2] = axes[d, 0] * pointing[1] - axes[d, 1] * pointing[0]
                    members[used] = d
                    used += 1
            for i in range(used):
                gradient[members[i]] += weight[k] * _inner(columns[i], error)
                for j in range(used):
                    normal[members[i], members[j]] += weight[k] * _inner(columns[i], columns[j])
        if abs(previous - cost) < 1e-7:
            break
        previous = cost
        for d in range(count):
            if (angles[d] <= limits[d, 0] and gradient[d] < 0) or (
                angles[d] >= limits[d, 1] and gradient[d] > 0
            ):
                for other in range(count):
                    normal[d, other], normal[other, d] = 0.0, 0.0
                gradient[d], normal[d, d] = 0.0, 1.0
        _solve(normal, gradient)
        scale = 1.0
        for d in range(count):
            scale = max(scale, abs(gradient[d]) / _TRUST_RAD)
        for d in range(count):
            angles[d] = min(max(angles[d] + gradient[d] / scale, limits[d, 0]), limits[d, 1])


@kernel
def solve_angles(
    parents, joints, dof_part, dof_axis, limits, roots, targets, directions, rest, angles
):
    """Fills angles (T, D), each within limits (D, 2), by Gauss-Newton steps on the cost
    sum_k w_k |R_k a_k - t_k|^2 + rest |q|^2.

    Each frame starts from the angles of the previous one, the first from those given. Targets are
    parts (K,), axes a (K, 3) in those parts and weights w (K,), with directions t (T, K, 3); roots
    (T, 3, 3) are world from body.
    """
    body = (parents, joints, dof_part, dof_axis)
    for t in range(angles.shape[0]):
        if t > 0:
            for d in range(angles.shape[1]):
                angles[t, d] = angles[t - 1, d]
        _solve_frame(body, limits, roots[t], targets, directions[t], rest, angles[t])
