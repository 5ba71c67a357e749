"""The scoring backend in compiled loops over CPU threads."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numba
import numpy as np

from silhouette_core.image.spans import Spans
from silhouette_core.jit import set_threads
from silhouette_core.scoring.backend import FloatArray, Voxels, check_placements, check_spans
from silhouette_core.scoring.kernels import overlap
from silhouette_core.scoring.kernels import spans as span_kernels


class CpuBackend:
    """Scores with numba; see `silhouette_core.scoring.backend.Backend`.

    Args: threads: How many; None takes what `silhouette_core.jit.set_threads` said. The results are
        the same for any number.

    Raises:
        ValueError: Fewer than one thread.
    """

    def __init__(self, threads: int | None = None) -> None:
        """Keeps the number of threads."""
        if threads is not None and threads < 1:
            raise ValueError(f"threads must be at least 1, got {threads}")
        self.threads = threads

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
        inside, outside = np.empty(len(rotations)), np.empty(len(rotations))
        occupancy, per_voxel = np.ascontiguousarray(voxels.occupancy), 1.0 / voxels.voxel_size_m
        origin, points, weights, rotations, translations = (
            np.ascontiguousarray(array, dtype=np.float64)
            for array in (voxels.origin_m, points, weights, rotations, translations)
        )
        with self._threads():
            overlap.voxel_overlap(
                occupancy,
                origin,
                per_voxel,
                points,
                weights,
                rotations,
                translations,
                inside,
                outside,
            )
        return inside, outside

    def span_distance(self, prefix: FloatArray, base: float, spans: Spans) -> FloatArray:
        """See `Backend.span_distance`."""
        check_spans(prefix, spans)
        distances = np.empty(len(spans))
        with self._threads():
            span_kernels.span_distance(
                np.ascontiguousarray(prefix),
                float(base),
                spans.rows,
                spans.starts,
                spans.ends,
                spans.offsets,
                distances,
            )
        return distances

    @contextmanager
    def _threads(self) -> Iterator[None]:
        """Sets the number of threads and puts it back."""
        before = numba.get_num_threads()
        if self.threads is not None:
            set_threads(self.threads)
        try:
            yield
        finally:
            numba.set_num_threads(before)
