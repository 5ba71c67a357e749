"""The kernels of this folder in NumPy, as close to their equations as can be: what tests compare
with. Each takes the arguments of the kernel of its name and fills the same arrays.
"""

import numpy as np


def padded_prefix(observation, weights, margin, prefix):
    """Okada and Stenger, eq. (7): sums along rows of d (1 - 2 P), and the sum of d P."""
    mask = np.pad(observation, margin)
    wide = np.pad(weights.astype(np.float64), margin, mode="edge")
    prefix[:, 0] = 0.0
    np.cumsum(np.where(mask, -wide, wide), axis=1, out=prefix[:, 1:])
    return wide[mask].sum()


def span_distances(
    prefixes, shifts, margin, bases, scale, rows, starts, ends, offsets, which, distances
):
    """Okada and Stenger, eq. (7): the sum of d P, and that of d (1 - 2 P) over the runs of Q."""
    for k, number in enumerate(which):
        runs = slice(offsets[number], offsets[number + 1])
        for c, base in enumerate(bases):
            prefix, (right, down) = prefixes[c // len(shifts)], shifts[c % len(shifts)]
            moved = prefix[margin + down :, margin + right :]
            signed = moved[rows[runs], ends[runs]] - moved[rows[runs], starts[runs]]
            distances[k, c] = scale * (base + signed.sum())


span_distances_parallel = span_distances


def pixel_scores(
    points, rotations, translations, intrinsics, camera_rotation, camera_translation, images, scores
):
    """Pinhole projection of every point, and the pixel there."""
    scores[:] = 0
    for k, world in enumerate(_placed(points, rotations, translations)):
        cameras = _placed(world, camera_rotation, camera_translation)
        for image, (fx, fy, cx, cy), seen in zip(images, intrinsics, cameras, strict=True):
            x, y, depth = seen[seen[:, 2] >= 0.05].T
            pixel = np.stack([fy * y / depth + cy, fx * x / depth + cx], axis=1)
            scores[k] += _look_up(image, np.floor(pixel + 0.5), 0).sum(dtype=np.int64)


def voxel_overlap(
    occupancy, origin, per_voxel, points, weights, rotations, translations, inside, outside
):
    """Iiyama, Kameda and Minoh, step (5): the weights of the points, by the voxel of each."""
    for k, world in enumerate(_placed(points, rotations, translations)):
        occupied = _look_up(occupancy, np.floor((world - origin) * per_voxel), False)
        # Sums in the order of the points.
        sums = np.cumsum([np.where(occupied, weights, 0), np.where(occupied, 0, weights)], axis=1)
        inside[k], outside[k] = sums[:, -1] if len(points) else (0.0, 0.0)


def voxel_cover(numbers, origin, per_voxel, points, rotations, translations, bits, empty, taken):
    """Iiyama, Kameda and Minoh, step (5): the set of the points' voxels."""
    for k, world in enumerate(_placed(points, rotations, translations)):
        result = _look_up(numbers, np.floor((world - origin) * per_voxel), -1)
        covered = np.zeros(64 * bits.shape[1], bool)
        covered[result[result >= 0]] = True
        bits[k] = np.packbits(covered, bitorder="little").view(np.uint64)
        empty[k], taken[k] = np.count_nonzero(result == -1), np.count_nonzero(result == -2)


def _placed(points, rotations, translations):
    """Yields the points (P, 3) of every placement; written out, so that sums have one order."""
    x, y, z = points[:, :1], points[:, 1:2], points[:, 2:]
    for r, t in zip(rotations, translations, strict=True):
        yield ((x * r[:, 0] + y * r[:, 1]) + z * r[:, 2]) + t


def _look_up(array, index, beyond):
    """Returns the entries of an array at indices (P, n), or `beyond` outside of it."""
    within = ((index >= 0) & (index < array.shape)).all(axis=1)
    result = np.full(len(index), beyond, array.dtype)
    result[within] = array[tuple(index[within].astype(np.int64).T)]
    return result
