"""The kernels of this folder in NumPy and SciPy, as close to their equations as can be: what tests
compare with. Each takes the arguments of the kernel of its name and fills the same arrays.
"""

import numpy as np
from scipy.linalg import expm
from scipy.optimize import least_squares


def exponential_map(vector, rotation, jacobian):
    """Matrix exponentials: exp(K), and the integral of exp(s K) over s from 0 to 1."""
    x, y, z = vector
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    both = expm(np.block([[cross, np.eye(3)], [np.zeros((3, 6))]]))
    rotation[:], jacobian[:] = both[:3, :3], both[:3, 3:]


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
    """R_p = R_parent exp(sum_k q_k a_k), o_p = o_parent + R_parent (J_p - J_parent)."""
    for p, parent in enumerate(parents):
        base = root_rotation if parent < 0 else part_rotation[parent]
        above = root if parent < 0 else part_origin[parent]
        part_origin[p] = above + base @ (joints[p] - joints[max(parent, 0)]) * (parent >= 0)
        own, turned, jacobian = dof_part == p, np.empty((3, 3)), np.empty((3, 3))
        exponential_map(angles[own] @ dof_axis[own], turned, jacobian)
        part_rotation[p] = base @ turned
        world_axis[own] = dof_axis[own] @ (base @ jacobian).T


def place_parts(
    parents, joints, dof_part, dof_axis, root_rotation, root, angles, part_rotation, part_origin
):
    """The same without axes."""
    body = (parents, joints, dof_part, dof_axis, root_rotation, root, angles)
    place_parts_and_axes(*body, part_rotation, part_origin, np.empty((len(dof_part), 3)))


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
    """The same for every pose."""
    body, filled = (parents, joints, dof_part, dof_axis), (part_rotations, part_origins, world_axes)
    for k, row in enumerate(angles):
        own = (one[k] for one in filled)
        place_parts_and_axes(*body, root_rotations[k], roots[k], row, *own)


def place_one_part(
    parents, joints, dof_part, dof_axis, root_rotation, root, angles, part, rotations, origins
):
    """The same for every row of angles, of which one part is kept."""
    rotation, origin = np.empty((len(parents), 3, 3)), np.empty((len(parents), 3))
    for k, row in enumerate(angles):
        place_parts(parents, joints, dof_part, dof_axis, root_rotation, root, row, rotation, origin)
        rotations[k], origins[k] = rotation[part], origin[part]


def skin_vertices(vertices, joints, skin_parts, skin_weights, part_rotation, part_origin, posed):
    """Linear blend skinning: sum_k w_k (R_k (v - J_k) + o_k)."""
    local = vertices[:, None] - joints[skin_parts]
    placed = np.einsum("vkij,vkj->vki", part_rotation[skin_parts], local) + part_origin[skin_parts]
    posed[:] = np.einsum("vk,vki->vi", skin_weights, placed)


def solve_angles(
    parents, joints, dof_part, dof_axis, limits, roots, targets, directions, rest, angles
):
    """Least squares of sqrt(w_k) (R_k a_k - t_k) and sqrt(rest) q within limits, each frame from
    the rest pose.
    """
    part, axis, weight = targets
    rotation, origin = np.empty((len(parents), 3, 3)), np.empty((len(parents), 3))

    def residuals(q, t):
        place_parts(parents, joints, dof_part, dof_axis, roots[t], np.zeros(3), q, rotation, origin)
        error = np.einsum("kij,kj->ki", rotation[part], axis) - directions[t]
        return np.r_[(np.sqrt(weight)[:, None] * error).ravel(), np.sqrt(rest) * q]

    for t in range(len(angles)):
        start = np.zeros(angles.shape[1])
        angles[t] = least_squares(residuals, start, bounds=limits.T, args=(t,), xtol=1e-12).x
