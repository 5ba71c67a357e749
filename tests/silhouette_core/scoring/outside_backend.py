"""A scoring backend of somebody else: all candidates at once, in whole arrays."""

import numpy as np

from silhouette_core.image.raster import render_many


class ArrayBackend:
    def span_distances(self, target, spans, which=None, parallel=True):
        table, bases = target.sums
        runs = table[spans.rows, spans.ends] - table[spans.rows, spans.starts]
        sums = np.vstack([np.zeros((1, len(bases))), np.cumsum(runs, axis=0)])
        distances = target.scale * (bases + sums[spans.offsets[1:]] - sums[spans.offsets[:-1]])
        return distances if which is None else distances[which]

    def part_images(self, vertices_cam, faces, face_part, matrix, size, cull_back=True):
        return render_many(vertices_cam, faces, face_part, matrix, size, cull_back)

    def drawn_weights(self, weights, vertices_cam, faces, matrix, cull_back=False):
        drawn = _drawn(vertices_cam, faces, matrix, weights.shape, cull_back)
        return np.tensordot(drawn.astype(float), weights, 2)

    def silhouette_errors(self, masks, matrices, vertices_cam, faces, unknown=None):
        apart, either = np.zeros((2, len(masks), len(vertices_cam)))
        for c, (mask, matrix) in enumerate(zip(masks, matrices, strict=True)):
            drawn = _drawn(vertices_cam[:, c], faces, matrix, mask.shape, True)
            if unknown is not None:
                drawn &= ~unknown[c]
            apart[c], either[c] = (drawn ^ mask).sum((1, 2)), (drawn | mask).sum((1, 2))
        ratios = np.divide(apart, either, out=np.full(apart.shape, np.nan), where=either > 0)
        ratios[:, np.isnan(ratios).all(0)] = 1.0
        return np.nanmean(ratios, axis=0)

    def pixel_scores(self, views, images, points, rotations, translations_m):
        world = points @ rotations.transpose(0, 2, 1) + translations_m[:, None]
        scores = np.zeros(len(rotations), np.int64)
        cameras = zip(images, views.intrinsics, views.rotation, views.translation_m, strict=True)
        for image, (fx, fy, cx, cy), rotation, translation in cameras:
            x, y, depth = np.moveaxis(world @ rotation.T + translation, -1, 0)
            near = depth < 0.05
            depth = np.where(near, 1.0, depth)
            pixels = np.stack([fy * y / depth + cy, fx * x / depth + cx], -1)
            pixels = np.where(near[..., None], -1, np.floor(pixels + 0.5)).astype(int)
            scores += entries(image, pixels, 0).sum(1, dtype=np.int64)
        return scores

    def voxel_overlap(self, grid, occupancy, points, weights, rotations, translations_m):
        occupied = entries(occupancy, voxels(grid, points, rotations, translations_m), False)
        inside = occupied @ weights
        return inside, weights.sum() - inside

    def voxel_cover(self, grid, numbers, words, points, rotations, translations_m):
        result = entries(numbers, voxels(grid, points, rotations, translations_m), -1)
        bits = np.zeros((len(rotations), words), np.uint64)
        k, p = np.nonzero(result >= 0)
        number = result[k, p].astype(np.uint64)
        one = np.uint64(1) << (number & np.uint64(63))
        np.bitwise_or.at(bits, (k, (number >> np.uint64(6)).astype(int)), one)
        return bits, (result == -1).sum(1), (result == -2).sum(1)


def _drawn(vertices_cam, faces, matrix, shape, cull_back):
    labels = np.zeros(len(faces), np.int32)
    return render_many(vertices_cam, faces, labels, matrix, shape[::-1], cull_back) > 0


def voxels(grid, points, rotations, translations_m):
    world = points @ rotations.transpose(0, 2, 1) + translations_m[:, None]
    return np.floor((world - grid.origin_m) / grid.voxel_size_m).astype(int)


def entries(array, index, beyond):
    """Entries (K, P) of an array at indices (K, P, n), or `beyond` outside of it."""
    within = ((index >= 0) & (index < array.shape)).all(-1)
    clipped = np.where(within[..., None], index, 0)
    return np.where(within, array[tuple(np.moveaxis(clipped, -1, 0))], beyond)
