"""A scoring backend in NumPy, written by the documentation of `silhouette_core.scoring.backend`.

All candidates at once where an array has room for them, drawn face by face. Registered as

    [project.entry-points."silhouette_core.backends"]
    numpy = "numpy_backend:NumpyBackend"

it scores for `voxelpose fit --backend numpy`, slowly. Its tests are those of the program:

    from examples.backend_conformance import BackendConformance

    class TestNumpyBackend(BackendConformance):
        backend = NumpyBackend()
"""

import weakref

import numpy as np

from silhouette_core.scoring.backend import Backend, checked_placements, chosen_spans

_NEAR_M = 0.05


class ResidentCopies:
    """What is made of objects that are handed over many times: once each, kept while they live.

    Args:
        make: makes it, for example by copying an array to a device.
    """

    def __init__(self, make):
        """Has made nothing yet."""
        self._make, self._made = make, {}

    def __call__(self, source):
        """What was made of an object, which is the same one, not an equal one."""
        if id(source) not in self._made:
            self._made[id(source)] = self._make(source)
            # The number may be another object's later.
            weakref.finalize(source, self._made.pop, id(source), None).atexit = False
        return self._made[id(source)]


class NumpyBackend(Backend):
    """Scores in whole arrays; what it does is said at `Backend`."""

    def __init__(self):
        """Keeps the pixels of every silhouette of a library, as a device would in its memory."""
        self._pixels = ResidentCopies(_pixels_of)

    def span_distances(self, target, spans, which):
        """Eq. (7): the weight of P, and over the pixels of each Q what Q adds to it."""
        margin = target.margin_px
        offsets, rows, columns = self._pixels(spans)
        chosen = chosen_spans(spans, which)
        shifts = target.shifts_px
        distances = np.empty((len(chosen), len(target.masks) * len(shifts)))
        for p, (mask, weights) in enumerate(zip(target.masks, target.weights, strict=True)):
            inside = np.pad(mask, margin)
            wide = np.pad(weights.astype(np.float64), margin, mode="edge")
            signed, weight = np.where(inside, -wide, wide), wide[inside].sum()
            for s, (right, down) in enumerate(shifts):
                for k, number in enumerate(chosen):
                    own = slice(offsets[number], offsets[number + 1])
                    moved = rows[own] + margin + down, columns[own] + margin + right
                    distances[k, p * len(shifts) + s] = weight + signed[moved].sum()
        return target.scale * distances.reshape(
            len(chosen), len(target.masks) * len(target.shifts_px)
        )

    def part_images(self, vertices_cam, faces, face_part, matrix, size, cull_back=True):
        """One mesh after the other."""
        images = np.zeros((len(vertices_cam), *size[::-1]), np.uint8)
        for image, mesh in zip(images, vertices_cam, strict=True):
            _draw(image, mesh, faces, face_part, matrix, cull_back)
        return images

    def drawn_weights(self, weights, vertices_cam, faces, matrix):
        """The weights under each drawn mesh."""
        drawn = self._silhouettes(vertices_cam, faces, matrix, weights.shape)
        return np.tensordot(drawn.astype(np.float64), weights, 2)

    def silhouette_errors(self, masks, matrices, vertices_cam, faces, unknown=None):
        """Counts of pixels, camera by camera."""
        apart, either = np.zeros((2, len(vertices_cam), len(masks)))
        for c, (mask, matrix) in enumerate(zip(masks, matrices, strict=True)):
            drawn = self._silhouettes(vertices_cam[:, c], faces, matrix, mask.shape)
            if unknown is not None:
                drawn &= ~unknown[c]
            apart[:, c], either[:, c] = (drawn ^ mask).sum((1, 2)), (drawn | mask).sum((1, 2))
        counted = (either > 0).sum(axis=1)
        ratios = (apart / np.maximum(either, 1)).sum(axis=1)
        return np.where(counted, ratios / np.maximum(counted, 1), 1.0)

    def pixel_scores(self, views, images, points, rotations, translations_m):
        """Each point in each camera."""
        world = _placed(points, rotations, translations_m)
        scores = np.zeros(len(rotations), np.int64)
        cameras = zip(images, views.intrinsics, views.rotation, views.translation_m, strict=True)
        for image, (fx, fy, cx, cy), rotation, translation_m in cameras:
            x, y, depth = np.moveaxis(world @ rotation.T + translation_m, -1, 0)
            near = depth < _NEAR_M
            depth = np.where(near, 1.0, depth)
            pixels = np.stack([fy * y / depth + cy, fx * x / depth + cx], axis=-1)
            pixels = np.where(near[..., None], -1, np.floor(pixels + 0.5))
            scores += _entries(image, pixels, 0).sum(axis=1, dtype=np.int64)
        return scores

    def voxel_overlap(self, grid, occupancy, points, weights, rotations, translations_m):
        """The voxel of each point."""
        voxels = _voxels(grid, points, rotations, translations_m)
        occupied = _entries(occupancy, voxels, False)
        return occupied @ weights, ~occupied @ weights

    def voxel_cover(self, grid, numbers, words, points, rotations, translations_m):
        """The number of each point's voxel, as a bit."""
        result = _entries(numbers, _voxels(grid, points, rotations, translations_m), -1)
        bits = np.zeros((len(rotations), words), np.uint64)
        k, p = np.nonzero(result >= 0)
        number = result[k, p].astype(np.uint64)
        bit = np.uint64(1) << (number & np.uint64(63))
        np.bitwise_or.at(bits, (k, (number >> np.uint64(6)).astype(int)), bit)
        return bits, (result == -1).sum(axis=1), (result == -2).sum(axis=1)

    def _silhouettes(self, vertices_cam, faces, matrix, shape):
        """Drawn pixels (K, h, w) bool."""
        parts = np.zeros(len(faces), np.int32)
        return self.part_images(vertices_cam, faces, parts, matrix, shape[::-1]) > 0


def _pixels_of(spans):
    """Offsets (K + 1,) of silhouettes, and the rows and columns of all their pixels."""
    lengths = spans.ends.astype(np.int64) - spans.starts
    before = np.concatenate([[0], np.cumsum(lengths)])
    columns = np.arange(before[-1]) + np.repeat(spans.starts - before[:-1], lengths)
    return before[spans.offsets], np.repeat(spans.rows.astype(np.int64), lengths), columns


def _placed(points, rotations, translations_m):
    """Points (K, P, 3) in the world."""
    points, rotations, translations_m = checked_placements(points, rotations, translations_m)
    return points @ rotations.transpose(0, 2, 1) + translations_m[:, None]


def _voxels(grid, points, rotations, translations_m):
    """Voxels (K, P, 3) of placed points."""
    world = _placed(points, rotations, translations_m)
    return np.floor((world - grid.origin_m) / grid.voxel_size_m)


def _entries(array, index, beyond):
    """Entries (K, P) of an array at indices (K, P, n), or `beyond` outside of it."""
    within = ((index >= 0) & (index < array.shape)).all(axis=-1)
    clipped = np.where(within[..., None], index, 0).astype(np.int64)
    return np.where(within, array[tuple(np.moveaxis(clipped, -1, 0))], beyond)


def _draw(image, mesh, faces, face_part, matrix, cull_back):
    """Draws a mesh (V, 3) into an image of part numbers (h, w) uint8."""
    depth = np.full(image.shape, np.inf, np.float32)
    for face, part in zip(faces, face_part, strict=True):
        corners = mesh[face]
        if not np.isfinite(corners).all():
            continue
        corners = _before_near_plane(corners)
        for k in range(2, len(corners)):
            _fill(image, depth, corners[[0, k - 1, k]], part + 1, matrix, cull_back)


def _before_near_plane(corners):
    """Corners (n, 3) of the part of a triangle (3, 3) that is far enough away, in their order."""
    kept = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if a[2] >= _NEAR_M:
            kept.append(a)
        if (a[2] >= _NEAR_M) != (b[2] >= _NEAR_M):
            # Alike from both sides of the edge.
            inner, outer = (a, b) if a[2] >= _NEAR_M else (b, a)
            cut = inner + (inner[2] - _NEAR_M) / (inner[2] - outer[2]) * (outer - inner)
            kept.append(np.append(cut[:2], _NEAR_M))
    return np.array(kept)


def _fill(image, depth, corners, label, matrix, cull_back):
    """Draws a triangle (3, 3) in the camera's frame where it is nearer than what is there."""
    x, y, z = corners.T
    columns = (matrix[0, 0] * x + matrix[0, 1] * y) / z + matrix[0, 2]
    screen = np.stack([columns, matrix[1, 1] * y / z + matrix[1, 2]], axis=1)
    # The limit keeps products of two coordinates within int64.
    a, b, c = np.clip(np.floor(256 * screen + 0.5), -(2**29), 2**29).astype(np.int64)
    near = 1 / z
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    if area == 0 or (cull_back and area > 0):
        return
    if area < 0:
        b, c, near = c, b, near[[0, 2, 1]]
    low = np.maximum(-(-np.min([a, b, c], axis=0) // 256), 0)
    high = np.minimum(np.max([a, b, c], axis=0) // 256 + 1, image.shape[::-1])
    if (low >= high).any():
        return
    x, y = np.meshgrid(*(256 * np.arange(*ends) for ends in zip(low, high, strict=True)))
    edges = []
    for (from_x, from_y), (to_x, to_y) in ((b, c), (c, a), (a, b)):
        dx, dy = to_x - from_x, to_y - from_y
        owned = dy < 0 or (dy == 0 and dx > 0)  # a left edge, or one above
        edges.append(dx * (y - from_y) - dy * (x - from_x) + owned - 1)
    inside = (np.array(edges) >= 0).all(axis=0)
    slopes = near[1:] - near[0]
    area = abs(area)
    by_column = (slopes[0] * (c[1] - a[1]) - slopes[1] * (b[1] - a[1])) / area
    by_row = (slopes[1] * (b[0] - a[0]) - slopes[0] * (c[0] - a[0])) / area
    nearness = near[0] + by_column * (x - a[0]) + by_row * (y - a[1])
    # The plane of a sliver is steep: it stays between its corners.
    found = (1 / np.clip(nearness, near.min(), near.max())).astype(np.float32)
    window = slice(low[1], high[1]), slice(low[0], high[0])
    nearer = inside & (found < depth[window])
    image[window][nearer], depth[window][nearer] = label, found[nearer]
