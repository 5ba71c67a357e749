"""ForwardFilter kinematics, its axes of turning, and skinning."""

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange


@kernel
def turn(vector, rotation, jacobian):
    """Rodrigues' formula: fills rotation = Exp(vector) and jacobian, the left Jacobian of SO(3)
    there.
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
            one = 1.0 if i == j else 0.0
            rotation[i, j] = one + s * k[i][j] + c * square
            jacobian[i, j] = one + c * k[i][j] + d * square


@kernel
def place_parts_and_axes(
    parents,
    joints,
    dof_part,
    dof_axis,
    root_rotation,
    root,
    angles,
    part_rotation,
    part_origin,
    world_axis,
):
    """Fills part_rotation (P, 3, 3), part_origin (P, 3) and world_axis (D, 3): turning DOF k moves
    x by world_axis[k] x (x - origin).
    """
    local, jacobian, vector = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    k = 0
    for p in range(parents.shape[0]):
        parent = parents[p]
        if parent < 0:
            part_origin[p] = root
            base = root_rotation
        else:
            base = part_rotation[parent]
            for i in range(3):
                moved = part_origin[parent, i]
                for j in range(3):
                    moved += base[i, j] * (joints[p, j] - joints[parent, j])
                part_origin[p, i] = moved
        first = k
        vector[:] = 0.0
        while k < dof_part.shape[0] and dof_part[k] == p:
            for i in range(3):
                vector[i] += angles[k] * dof_axis[k, i]
            k += 1
        turn(vector, local, jacobian)
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
def place_parts(
    parents, joints, dof_part, dof_axis, root_rotation, root, angles, part_rotation, part_origin
):
    """As `place_parts_and_axes`, without the axes."""
    unused = np.empty((dof_part.shape[0], 3))
    place_parts_and_axes(
        parents,
        joints,
        dof_part,
        dof_axis,
        root_rotation,
        root,
        angles,
        part_rotation,
        part_origin,
        unused,
    )


@parallel_kernel
def place_one_part(
    parents, joints, dof_part, dof_axis, root_rotation, root, angles, part, rotations, origins
):
    """Fills rotations (K, 3, 3) and origins (K, 3) of one part for each row of angles (K, D)."""
    for k in prange(angles.shape[0]):
        rotation, origin = np.empty((parents.shape[0], 3, 3)), np.empty((parents.shape[0], 3))
        place_parts(
            parents, joints, dof_part, dof_axis, root_rotation, root, angles[k], rotation, origin
        )
        rotations[k] = rotation[part]
        origins[k] = origin[part]


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
