"""Joint angles that turn parts into given directions."""

import numpy as np

from silhouette_core.jit import kernel
from silhouette_core.motion.kernels.kinematics import place_parts_and_axes


@kernel
def _carries(parents, ancestor, part):
    while part >= 0 and part != ancestor:
        part = parents[part]
    return part == ancestor


@kernel
def _solve(matrix, vector, fixed):
    """Solves for the columns that are not fixed, by Cholesky's method; the fixed ones get 0."""
    n = vector.shape[0]
    for i in range(n):
        if fixed[i]:
            vector[i] = 0.0
            matrix[i, :] = 0.0
            matrix[:, i] = 0.0
            matrix[i, i] = 1.0
    for j in range(n):
        for k in range(j):
            matrix[j, j] -= matrix[j, k] ** 2
        matrix[j, j] = np.sqrt(matrix[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] /= matrix[j, j]
    for i in range(n):
        for k in range(i):
            vector[i] -= matrix[i, k] * vector[k]
        vector[i] /= matrix[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            vector[i] -= matrix[k, i] * vector[k]
        vector[i] /= matrix[i, i]


@kernel
def aim_frame(
    parents,
    joints,
    dof_part,
    dof_axis,
    limits,
    root,
    target_part,
    target_axis,
    wanted,
    weight,
    rest,
    steps,
    angles,
):
    """Improves angles (D,) in place: Gauss and Newton on sum_k w_k |R_part a_k - t_k|^2 + rest
    |q|^2 within limits; returns the cost.

    An angle at its limit that is pushed outward is left there for the step, so that the next part
    takes over what it cannot do.
    """
    count, parts = dof_part.shape[0], parents.shape[0]
    rotation, origin = np.empty((parts, 3, 3)), np.empty((parts, 3))
    axes, zero = np.empty((count, 3)), np.zeros(3)
    normal, gradient = np.empty((count, count)), np.empty(count)
    columns, members = np.empty((count, 3)), np.empty(count, np.int64)
    fixed = np.zeros(count, np.bool_)
    cost, before = 0.0, np.inf
    for _ in range(steps):
        place_parts_and_axes(
            parents, joints, dof_part, dof_axis, root, zero, angles, rotation, origin, axes
        )
        cost = 0.0
        normal[:] = 0.0
        for d in range(count):
            cost += rest * angles[d] ** 2
            gradient[d] = -rest * angles[d]
            normal[d, d] = rest + 1e-6
        for k in range(target_part.shape[0]):
            pointing = rotation[target_part[k]] @ target_axis[k]
            missing = wanted[k] - pointing
            cost += weight[k] * (missing @ missing)
            used = 0
            for d in range(count):
                if _carries(parents, dof_part[d], target_part[k]):
                    columns[used, 0] = axes[d, 1] * pointing[2] - axes[d, 2] * pointing[1]
                    columns[used, 1] = axes[d, 2] * pointing[0] - axes[d, 0] * pointing[2]
                    columns[used, 2] = axes[d, 0] * pointing[1] - axes[d, 1] * pointing[0]
                    members[used] = d
                    used += 1
            for i in range(used):
                gradient[members[i]] += weight[k] * (columns[i] @ missing)
                for j in range(used):
                    normal[members[i], members[j]] += weight[k] * (columns[i] @ columns[j])
        if abs(before - cost) < 1e-7:
            break
        before = cost
        for d in range(count):
            fixed[d] = (angles[d] <= limits[d, 0] and gradient[d] < 0) or (
                angles[d] >= limits[d, 1] and gradient[d] > 0
            )
        _solve(normal, gradient, fixed)
        reach = max(
            1.0, np.abs(gradient).max() / 0.6
        )  # radians a step: farther away the model is not to be trusted
        for d in range(count):
            angles[d] = min(max(angles[d] + gradient[d] / reach, limits[d, 0]), limits[d, 1])
    return cost


@kernel
def aim(
    parents,
    joints,
    dof_part,
    dof_axis,
    limits,
    roots,
    target_part,
    target_axis,
    wanted,
    weight,
    rest,
    angles,
):
    """Fills angles (T, D), each frame starting from the one before and, where that fits badly, also
    from the rest pose.
    """
    again = np.empty(angles.shape[1])
    for t in range(angles.shape[0]):
        if t > 0:
            angles[t] = angles[t - 1]
        cost = aim_frame(
            parents,
            joints,
            dof_part,
            dof_axis,
            limits,
            roots[t],
            target_part,
            target_axis,
            wanted[t],
            weight,
            rest,
            30,
            angles[t],
        )
        if t == 0 or cost > 0.05:
            again[:] = 0.0
            other = aim_frame(
                parents,
                joints,
                dof_part,
                dof_axis,
                limits,
                roots[t],
                target_part,
                target_axis,
                wanted[t],
                weight,
                rest,
                30,
                again,
            )
            if other < 0.8 * cost:
                angles[t] = again
