"""The project's own backend with every sum in the opposite order."""

import numpy as np

from silhouette_core.image.raster import render_many
from silhouette_core.image.spans import Spans
from silhouette_core.scoring.backend import Target, chosen_spans
from silhouette_core.scoring.cpu import CpuBackend


class BackwardBackend(CpuBackend):
    """Last camera, point, row, pixel and run first."""

    def span_distances(self, target, spans, which):
        # Pictures turned by half a turn.
        height, width = target.masks[0].shape
        turned = Target(
            tuple(mask[::-1, ::-1] for mask in target.masks),
            tuple(weights[::-1, ::-1] for weights in target.weights),
            -target.shifts_px,
            target.scale,
        )
        runs = height - 1 - spans.rows, width - spans.ends, width - spans.starts
        backward = Spans(*(array[::-1] for array in runs), (len(spans.rows) - spans.offsets)[::-1])
        chosen = len(spans) - 1 - chosen_spans(spans, which)
        return super().span_distances(turned, backward, chosen)

    def drawn_weights(self, weights, vertices_cam, faces, matrix):
        labels, size = np.zeros(len(faces), np.int32), weights.shape[::-1]
        drawn = render_many(vertices_cam, faces, labels, matrix, size) > 0
        return np.array([np.cumsum(weights[one][::-1])[-1] if one.any() else 0.0 for one in drawn])

    def silhouette_errors(self, masks, matrices, vertices_cam, faces, unknown=None):
        hidden = None if unknown is None else unknown[::-1]
        return super().silhouette_errors(
            masks[::-1], matrices[::-1], vertices_cam[:, ::-1], faces, hidden
        )

    def voxel_overlap(self, grid, occupancy, points, weights, rotations, translations_m):
        backward = points[::-1], weights[::-1], rotations, translations_m
        return super().voxel_overlap(grid, occupancy, *backward)
