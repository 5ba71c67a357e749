"""The kernels of this folder in NumPy, as close to their equations as can be: what tests compare
with. Each takes the arguments of the kernel of its name and fills the same arrays.
"""

import numpy as np
from scipy.spatial.transform import Rotation


def match_contours(camera, center, ray, normal, points, point_normals, reach, matched, gap):
    """Nearest surface point to the ray among those that look out of the tangent plane."""
    for k, i in np.ndindex(matched.shape):
        offset, facing = points[k] - center[camera[i]], point_normals[k] @ normal[i]
        along = offset @ ray[i]
        distance2 = (offset**2).sum(axis=1) - along**2
        allowed = (facing >= 0.5) & (along > 0) & (distance2 < reach[k] ** 2)
        cost = np.where(allowed, distance2 + 0.01 * (1 - facing), np.inf)
        best = cost.argmin()
        matched[k, i] = best if allowed[best] else -1
        gap[k, i] = offset[best] @ normal[i] if allowed[best] else 0.0


def measure_outside(points, intrinsics, rotation, translation, outside, gap, direction):
    """Bilinear distance outside the silhouette and its derivative with the point."""
    fx, fy, cx, cy = intrinsics
    height, width = outside.shape
    x, y, z = np.moveaxis(points @ rotation.T + translation, -1, 0)
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
    gradient = np.stack([along_x, along_y, -(along_x * x + along_y * y) / z], axis=-1)
    direction[off] = (gradient @ rotation)[off]


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
    """Points sum_k w_k (R_k (v - J_k) + o_k), normals along sum_k w_k R_k n, in every pose."""
    for pose, (turns, origins) in enumerate(zip(part_rotation, part_origin, strict=True)):
        placed = _placed(rest, joints, skin_parts, turns, origins)
        points[pose] = np.einsum("vk,vki->vi", skin_weights, placed)
        turned = np.einsum("vk,vkij,vj->vi", skin_weights, turns[skin_parts], rest_normals)
        normals[pose] = turned / np.linalg.norm(turned, axis=1, keepdims=True)


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
    """n . sum_k w_k (R_k (dv - dJ_k) + do_k)."""
    parts, weights = skin_parts[index], skin_weights[index]
    change = vertices_change[index][:, None] - np.moveaxis(joints_change[:, parts], 0, 2)
    posed = np.einsum("nkij,nksj->nksi", part_rotation[parts], change)
    posed += np.moveaxis(origin_change[:, parts], 0, 2)
    rows[:] = np.einsum("ni,nk,nksi->ns", direction, weights, posed)


def add_normal_equations(rows, weight, gap, matrix, gradient):
    """J^T W J and J^T W r."""
    matrix += rows.T @ (weight[:, None] * rows)
    gradient += rows.T @ (weight * gap)


def add_silhouette_terms(contour, outside, weights, outside_m, body, placed, matrix, gradient):
    """J^T W J and J^T W r of all contour points with a match and all points outside."""
    (matched, gap, normal), (away, toward) = contour, outside
    rest, joints, skin_parts, skin_weights, descends, dof_part = body
    for k in np.flatnonzero(weights[:, 1]):
        hits = matched[k] >= 0
        _, out = np.nonzero(away[k] > 0)
        r = np.concatenate([gap[k, hits], away[k][away[k] > 0]])
        direction = np.concatenate([normal[hits], toward[k][away[k] > 0]])
        scale = np.repeat([weights[k, 0], outside_m], [hits.sum(), len(out)])
        largest = np.repeat(weights[k, 1:], [hits.sum(), len(out)])
        weight = largest / (1 + (r / scale) ** 2) ** 2
        rotation, origin, axis = (one[k] for one in placed)
        rows = np.empty((len(r), matrix.shape[1]))
        index = np.concatenate([matched[k, hits], out])
        fill_jacobian(
            index,
            direction,
            rest,
            joints,
            skin_parts,
            skin_weights,
            rotation,
            origin,
            descends,
            dof_part,
            axis,
            rows,
        )
        add_normal_equations(rows, weight, r, matrix[k], gradient[k])


def add_pose_terms(poses, means, precision, usual, matrix, gradient):
    """Gaussians about a mean pose and the resting stance."""
    (roots, rotations, angles), (stance_precision, stance) = poses, usual
    turn = Rotation.from_matrix(rotations @ np.swapaxes(means[1], 1, 2)).as_rotvec()
    off = np.concatenate([roots - means[0], turn, angles - means[2]], axis=1)
    gradient += precision * off
    gradient[:, 6:] += stance_precision * (angles - stance)
    diagonal = precision.copy()
    diagonal[:, 6:] += stance_precision
    matrix += diagonal[..., None] * np.eye(diagonal.shape[1])


def add_landmark_terms(body, placed, prior, freedom, matrix, gradient):
    """Student's t about the means relative to landmark 0, and a Gaussian of landmark 0."""
    part, local, descends, dof_part = body
    given, relative, precision, pelvis, pelvis_precision = prior
    for k in np.flatnonzero(given):
        rotation, origin, axis = (one[k] for one in placed)
        place = origin[part] + np.einsum("lij,lj->li", rotation[part], local)
        lever = place[:, None] - origin[dof_part]
        moved = np.cross(axis, lever) * descends[dof_part][:, part].T[..., None]
        cross = np.cross(np.eye(3), (place - origin[0])[:, None])
        jacobian = np.concatenate([np.tile(np.eye(3), (len(part), 1, 1)), cross, moved], axis=1)
        for m, rows in enumerate(np.swapaxes(jacobian, 1, 2)):
            error, inverse, weight = place[0] - pelvis[k], pelvis_precision[k], 1.0
            if m:
                rows = rows - jacobian[0].T
                error, inverse = place[m] - place[0] - relative[k, m], precision[k, m]
                weight = (freedom + 3) / (freedom + error @ inverse @ error)
            matrix[k] += weight * rows.T @ inverse @ rows
            gradient[k] += weight * rows.T @ inverse @ error


def bounded_steps(matrix, gradient, free, low, high, steps):
    """Newton steps of the moving unknowns; those beyond a bound stop there."""
    steps[:] = 0
    for k, step in enumerate(steps):
        moving = free
        while len(moving):
            own = matrix[k][np.ix_(moving, moving)] + 1e-6 * np.eye(len(moving))
            solved = -np.linalg.solve(own, gradient[k, moving] + matrix[k, moving] @ step)
            bounded = np.clip(solved, low[k, moving], high[k, moving])
            violated = bounded != solved
            if not violated.any():
                step[moving] = solved
                break
            step[moving[violated]] = bounded[violated]
            moving = moving[~violated]


def move_poses(steps, limits, roots, rotations, angles):
    """Root position, rotation about the world's axes, and angles within their limits."""
    roots += steps[:, :3]
    rotations[:] = Rotation.from_rotvec(steps[:, 3:6]).as_matrix() @ rotations
    angles[:] = np.clip(angles + steps[:, 6:], *limits.T)


def _placed(rest, joints, skin_parts, part_rotation, part_origin):
    """Positions (V, 4, 3) of rest points by each of their parts."""
    local = rest[:, None] - joints[skin_parts]
    return np.einsum("vkij,vkj->vki", part_rotation[skin_parts], local) + part_origin[skin_parts]
