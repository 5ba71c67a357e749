"""The scoring backend in NumPy: the equations as they are written."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from silhouette_core.image.raster import render_parts
from silhouette_core.image.spans import Spans
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.scoring.backend import FloatArray, Grid, checked_placements, chosen_spans
from silhouette_core.scoring.target import Target
from tests.oracles import scoring as kernels


class ReferenceBackend:
    """Scores in NumPy, candidate by candidate; see `silhouette_core.scoring.backend.Backend`."""

    def span_distances(
        self,
        target: Target,
        spans: Spans,
        which: NDArray[np.integer] | None = None,
        parallel: bool = True,
    ) -> FloatArray:
        """See `Backend.span_distances`."""
        margin, shifts = target.margin_px, target.shifts_px
        height, width = target.masks[0].shape
        masks = [np.pad(mask, margin) for mask in target.masks]
        weights = [np.pad(weight, margin, mode="edge") for weight in target.weights]
        chosen = chosen_spans(spans, which)
        distances = np.empty((len(chosen), len(masks) * len(shifts)))
        for k, number in enumerate(chosen):
            candidate = np.zeros((height, width), bool)
            for n in range(spans.offsets[number], spans.offsets[number + 1]):
                candidate[spans.rows[n], spans.starts[n] : spans.ends[n]] = True
            for s, (right, down) in enumerate(shifts):
                moved = np.pad(
                    candidate,
                    ((margin + down, margin - down), (margin + right, margin - right)),
                )
                for p, (mask, weight) in enumerate(zip(masks, weights, strict=True)):
                    disagreement = weight[mask ^ moved].sum(dtype=np.float64)  # eq. (7)
                    distances[k, p * len(shifts) + s] = target.scale * disagreement
        return distances

    def part_images(
        self,
        vertices_cam: FloatArray,
        faces: NDArray[np.integer],
        face_part: NDArray[np.integer],
        matrix: FloatArray,
        size: tuple[int, int],
        cull_back: bool = True,
    ) -> NDArray[np.uint8]:
        """See `Backend.part_images`."""
        images = np.zeros((len(vertices_cam), *size[::-1]), np.uint8)
        for k, mesh in enumerate(vertices_cam):
            images[k], _ = render_parts(mesh, faces, face_part, matrix, size, cull_back)
        return images

    def drawn_weights(
        self,
        weights: FloatArray,
        vertices_cam: FloatArray,
        faces: NDArray[np.integer],
        matrix: FloatArray,
        cull_back: bool = False,
    ) -> FloatArray:
        """See `Backend.drawn_weights`."""
        labels, totals = np.zeros(len(faces), np.int32), np.empty(len(vertices_cam))
        size = weights.shape[::-1]
        for k, mesh in enumerate(vertices_cam):
            parts, _ = render_parts(mesh, faces, labels, matrix, size, cull_back)
            kernels.sum_weights(parts[None], weights, totals[k : k + 1])
        return totals

    def silhouette_errors(
        self,
        masks: Sequence[NDArray[np.bool_]],
        matrices: FloatArray,
        vertices_cam: FloatArray,
        faces: NDArray[np.integer],
        unknown: Sequence[NDArray[np.bool_]] | None = None,
    ) -> FloatArray:
        """See `Backend.silhouette_errors`."""
        labels, errors = np.zeros(len(faces), np.int32), np.ones(len(vertices_cam))
        for k, meshes in enumerate(vertices_cam):
            ratios = []
            for c, (mask, matrix, mesh) in enumerate(zip(masks, matrices, meshes, strict=True)):
                parts, _ = render_parts(mesh, faces, labels, matrix, mask.shape[::-1], True)
                if unknown is not None:
                    parts = np.where(unknown[c], 0, parts)
                apart, either = kernels.count_disagreement(parts, mask)
                if either:
                    ratios.append(apart / either)
            errors[k] = np.mean(ratios or 1.0)
        return errors

    def pixel_scores(
        self,
        views: PinholeViews,
        images: NDArray[np.int8],
        points: FloatArray,
        rotations: FloatArray,
        translations_m: FloatArray,
    ) -> NDArray[np.int64]:
        """See `Backend.pixel_scores`."""
        placed = checked_placements(points, rotations, translations_m)
        scores = np.empty(len(rotations), np.int64)
        cameras = views.intrinsics, views.rotation, views.translation_m
        kernels.pixel_scores(*placed, *cameras, images, scores)
        return scores

    def voxel_overlap(
        self,
        grid: Grid,
        occupancy: NDArray[np.bool_],
        points: FloatArray,
        weights: FloatArray,
        rotations: FloatArray,
        translations_m: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """See `Backend.voxel_overlap`."""
        points, rotations, translations_m = checked_placements(points, rotations, translations_m)
        inside, outside = np.empty((2, len(rotations)))
        cells, placed = (occupancy, grid.origin_m, 1 / grid.voxel_size_m), (points, weights)
        kernels.voxel_overlap(*cells, *placed, rotations, translations_m, inside, outside)
        return inside, outside

    def voxel_cover(
        self,
        grid: Grid,
        numbers: NDArray[np.int32],
        words: int,
        points: FloatArray,
        rotations: FloatArray,
        translations_m: FloatArray,
    ) -> tuple[NDArray[np.uint64], NDArray[np.int64], NDArray[np.int64]]:
        """See `Backend.voxel_cover`."""
        placed = checked_placements(points, rotations, translations_m)
        bits = np.empty((len(rotations), words), np.uint64)
        empty, taken = np.empty((2, len(rotations)), np.int64)
        cells = numbers, grid.origin_m, 1 / grid.voxel_size_m
        kernels.voxel_cover(*cells, *placed, bits, empty, taken)
        return bits, empty, taken
