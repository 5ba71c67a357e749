"""The scoring backend in NumPy: as the equations are written, and what other backends are compared
with.
"""

import numpy as np

from silhouette_core.image.spans import Spans
from silhouette_core.scoring.backend import FloatArray, Voxels, check_placements, check_spans


class ReferenceBackend:
    """Scores in NumPy; see `silhouette_core.scoring.backend.Backend`."""

    def voxel_overlap(
        self,
        voxels: Voxels,
        points: FloatArray,
        weights: FloatArray,
        rotations: FloatArray,
        translations: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """See `Backend.voxel_overlap`."""
        check_placements(points, weights, rotations, translations)
        shape = np.array(voxels.occupancy.shape)
        per_voxel = 1.0 / voxels.voxel_size_m
        inside, outside = np.zeros(len(rotations)), np.zeros(len(rotations))
        for k, (rotation, translation) in enumerate(zip(rotations, translations, strict=True)):
            # Written out, so that every sum is taken in one stated order.
            placed = (points[:, :1] * rotation[:, 0] + points[:, 1:2] * rotation[:, 1]) + points[
                :, 2:
            ] * rotation[:, 2]
            index = np.floor((placed + translation - voxels.origin_m) * per_voxel)
            within = ((index >= 0) & (index < shape)).all(axis=1)
            occupied = np.zeros(len(points), dtype=bool)
            occupied[within] = voxels.occupancy[tuple(index[within].astype(np.int64).T)]
            if len(points):
                inside[k] = np.cumsum(np.where(occupied, weights, 0.0))[-1]
                outside[k] = np.cumsum(np.where(occupied, 0.0, weights))[-1]
        return inside, outside

    def span_distance(self, prefix: FloatArray, base: float, spans: Spans) -> FloatArray:
        """See `Backend.span_distance`."""
        check_spans(prefix, spans)
        distances = np.empty(len(spans))
        for k, (first, last) in enumerate(zip(spans.offsets[:-1], spans.offsets[1:], strict=True)):
            rows, starts, ends = (
                spans.rows[first:last],
                spans.starts[first:last],
                spans.ends[first:last],
            )
            terms = np.concatenate([[base], prefix[rows, ends] - prefix[rows, starts]])
            distances[k] = np.cumsum(terms)[-1]
        return distances
