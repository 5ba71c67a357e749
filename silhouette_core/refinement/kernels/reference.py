"""The kernels of this folder in NumPy, as close to their equations as can be: what tests compare
with. Each takes the arguments of the kernel of its name and fills the same arrays.
"""

import numpy as np


def match_contours(camera, center, ray, normal, points, point_normals, reach, matched, gap):
    """Nearest surface point to the ray among those that look out of the tangent plane."""
    for i, c in enumerate(camera):
        offset, facing = points - center[c], point_normals @ normal[i]
        along = offset @ ray[i]
        distance2 = (offset**2).sum(axis=1) - along**2
        allowed = (facing >= 0.5) & (along > 0) & (distance2 < reach**2)
        cost = np.where(allowed, distance2 + 0.01 * (1 - facing), np.inf)
        best = cost.argmin()
        matched[i] = best if allowed[best] else -1
        gap[i] = offset[best] @ normal[i] if allowed[best] else 0.0


def measure_outside(points, intrinsics, rotation, translation, outside, gap, direction):
    """Bilinear distance outside the silhouette and its derivative with the point."""
    fx, fy, cx, cy = intrinsics
    height, width = outside.shape
    x, y, z = (points @ rotation.T + translation).T
    u, v = fx * x / z + cx, fy * y / z + cy
    seen = (z > 0.05) & (u >= 1) & (u < width - 2) & (v >= 1) & (v < height - 2)
    i, j = np.where(seen, u, 0).astype(int), np.where(seen, v, 0).astype(int)
    a, b = u - i, v - j
    upper = (1 - a) * outside[j, i] + a * outside[j, i + 1]
    lower = (1 - a) * outside[j + 1, i] + a * outside[j + 1, i + 1]
    left = (1 - b) * outside[j, i] + b * outside[j + 1, i]
    right = (1 - b) * outside[j, i + 1] + b * outside[j + 1, i + 1]
    distance = (1 - b) * upper + b * lower - 0.5
    off = seen & (distance > 0)
    gap[:] = np.where(off, distance * z / fx, 0)
    along_x, along_y = right - left, lower - upper
    gradient = np.stack([along_x, along_y, -(along_x * x + along_y * y) / z], axis=1)
    direction[off] = (gradient @ rotation)[off]


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
    """Points sum_k w_k (R_k (v - J_k) + o_k), normals along sum_k w_k R_k n."""
    points[:] = np.einsum(
        "vk,vki->vi",
        skin_weights,
        _placed(rest, joints, skin_parts, part_rotation, part_origin),
    )
    turned = np.einsum("vk,vkij,vj->vi", skin_weights, part_rotation[skin_parts], rest_normals)
    normals[:] = turned / np.linalg.norm(turned, axis=1, keepdims=True)


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
    """n, (x - o_root) x n, and a_d . (sum_k w_k (x_k - o_d) x n) over the parts that d moves."""
    parts, weights = skin_parts[index], skin_weights[index]
    placed = _placed(rest[index], joints, parts, part_rotation, part_origin)
    rows[:, :3] = direction
    whole = np.einsum("nk,nki->ni", weights, placed)
    rows[:, 3:6] = np.cross(whole - part_origin[0], direction)
    moved = np.moveaxis(descends[dof_part][:, parts], 0, 1) * weights[:, None]
    lever = np.einsum("ndk,nki->ndi", moved, placed)
    lever -= moved.sum(axis=2)[..., None] * part_origin[dof_part]
    rows[:, 6:] = (world_axis * np.cross(lever, direction[:, None])).sum(axis=2)


def add_normal_equations(rows, weight, gap, matrix, gradient):
    """J^T W J and J^T W r."""
    matrix += rows.T @ (weight[:, None] * rows)
    gradient += rows.T @ (weight * gap)


def _placed(rest, joints, skin_parts, part_rotation, part_origin):
    """Positions (V, 4, 3) of rest points by each of their parts."""
    local = rest[:, None] - joints[skin_parts]
    return np.einsum("vkij,vkj->vki", part_rotation[skin_parts], local) + part_origin[skin_parts]
