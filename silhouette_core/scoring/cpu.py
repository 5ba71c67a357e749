"""The scoring backend in compiled loops over CPU threads."""

import numpy as np

from calib.checks import FloatArray, IntArray, check_array
from silhouette_core.image.raster import NEAR_M, render_many
from silhouette_core.scoring.backend import Backend, checked_placements, chosen_spans
from silhouette_core.scoring.kernels import lookups
from silhouette_core.scoring.kernels import spans as span_kernels

_FEW = 512  # distances for which starting threads costs more than it brings


class CpuBackend(Backend):
    """Scores with numba; see `silhouette_core.scoring.backend.Backend`.

    `silhouette_core.jit.set_threads` sets the number of threads; the results are the same for any.
    """

    def span_distances(self, target, spans, which, parallel=True):
        r"""Weighted disagreement of silhouettes, see `Backend.span_distances`.

        .. math::
            :label: okada-7

            d_{wXOR}(P, Q) = \frac{1}{|W|} \sum_{x \in W} d_P(x) \, |P(x) - Q(x)|

        1 / |W| is the target's scale. The sum is that of d P over the window, and of d (1 - 2 P)
        over the runs of pixels of Q, read from sums along rows: exact. `parallel` may be False for
        callers that are threads themselves.

        Source: Okada and Stenger, eq. (7).
        """
        chosen, (prefixes, bases) = chosen_spans(spans, which), target.prefixes
        distances = np.empty((len(chosen), len(bases)))
        few = not parallel or distances.size < _FEW
        score = span_kernels.span_distances if few else span_kernels.span_distances_parallel
        score(  # eq. (7), rearranged into runs
            prefixes,
            target.shifts_px,
            target.margin_px,
            bases,
            target.scale,
            spans.rows,
            spans.starts,
            spans.ends,
            spans.offsets,
            chosen,
            distances,
        )
        return distances

    def part_images(self, vertices_cam, faces, face_part, matrix, size, cull_back=True):
        """See `Backend.part_images`."""
        return render_many(vertices_cam, faces, face_part, matrix, size, cull_back)

    def drawn_weights(self, weights, vertices_cam, faces, matrix):
        """See `Backend.drawn_weights`."""
        labels, size = np.zeros(len(faces), np.int32), weights.shape[::-1]
        parts = render_many(vertices_cam, faces, labels, matrix, size)
        return np.array([weights[image > 0].sum() for image in parts], np.float64)

    def silhouette_errors(self, masks, matrices, vertices_cam, faces, unknown=None):
        """See `Backend.silhouette_errors`."""
        check_array("vertices_cam", vertices_cam, ("K", len(masks), "V", 3))
        # Pixel positions times depth: all cameras are drawn by the same matrix, each in a window.
        meshes = vertices_cam @ np.swapaxes(matrices, 1, 2)
        height, width = np.max([mask.shape for mask in masks], axis=0)
        corners, size = _windows(meshes, (width, height))
        meshes[..., :2] -= corners[:, :, None] * meshes[..., 2:]
        labels, errors = np.zeros(len(faces), np.int32), np.ones(len(vertices_cam))
        images = render_many(meshes.reshape(-1, *meshes.shape[2:]), faces, labels, np.eye(3), size)
        totals = [np.count_nonzero(mask) for mask in masks]
        silhouettes = images.view(np.bool_).reshape(*corners.shape[:2], *images.shape[1:])
        for k, body_silhouettes in enumerate(silhouettes):
            ratios = []
            for c, (mask, (left, top)) in enumerate(zip(masks, corners[k], strict=True)):
                window = slice(top, top + size[1]), slice(left, left + size[0])
                seen = mask[window]
                drawn = body_silhouettes[c, : seen.shape[0], : seen.shape[1]]
                if unknown is not None:
                    drawn = drawn & ~unknown[c][window]
                both = np.count_nonzero(drawn & seen)
                either = np.count_nonzero(drawn) + totals[c] - both
                if either:
                    ratios.append((either - both) / either)
            errors[k] = np.mean(ratios or 1.0)
        return errors

    def pixel_scores(self, views, images, points, rotations, translations_m):
        """See `Backend.pixel_scores`."""
        placed = checked_placements(points, rotations, translations_m)
        images, scores = np.ascontiguousarray(images), np.empty(len(rotations), np.int64)
        lookups.pixel_scores(
            *placed, views.intrinsics, views.rotation, views.translation_m, images, scores
        )
        return scores

    def voxel_overlap(self, grid, occupancy, points, weights, rotations, translations_m):
        """See `Backend.voxel_overlap`."""
        check_array("occupancy", occupancy, ("nx", "ny", "nz"), np.bool_)
        check_array("weights", weights, (len(points),))
        points, turns, moves = checked_placements(points, rotations, translations_m)
        inside, outside = np.empty(len(turns)), np.empty(len(turns))
        cells, per_voxel = np.ascontiguousarray(occupancy), 1.0 / grid.voxel_size_m
        weights, origin = np.ascontiguousarray(weights, np.float64), grid.origin_m
        lookups.voxel_overlap(
            cells, origin, per_voxel, points, weights, turns, moves, inside, outside
        )
        return inside, outside

    def voxel_cover(self, grid, numbers, words, points, rotations, translations_m):
        """See `Backend.voxel_cover`."""
        placed = checked_placements(points, rotations, translations_m)
        bits = np.empty((len(rotations), words), np.uint64)
        empty, taken = np.empty(len(rotations), np.int64), np.empty(len(rotations), np.int64)
        cells, per_voxel = np.ascontiguousarray(numbers), 1.0 / grid.voxel_size_m
        lookups.voxel_cover(cells, grid.origin_m, per_voxel, *placed, bits, empty, taken)
        return bits, empty, taken


def _windows(meshes: FloatArray, size: tuple[int, int]) -> tuple[IntArray, tuple[int, int]]:
    """Upper left corners (K, C, 2) of windows of one size (width, height) within images of a given
    size, that hold meshes (K, C, V, 3) given in pixels times depth.
    """
    depth = meshes[..., 2:]
    whole = ~(depth.min(2) >= NEAR_M)  # a mesh that is clipped may be drawn anywhere
    pixels = meshes[..., :2] / np.where(whole[:, :, None], 1.0, depth)
    low = np.where(whole, 0, np.floor(pixels.min(2)) - 1)
    high = np.where(whole, size, np.ceil(pixels.max(2)) + 2)
    low, high = (np.clip(corner, 0, size).astype(np.int64) for corner in (low, high))
    width, height = np.maximum((high - low).max((0, 1), initial=1), 1)
    return low, (int(width), int(height))
