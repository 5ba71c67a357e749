"""The scoring backend in NumPy: the equations as they are written."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from silhouette_core.image.raster import render_parts
from silhouette_core.image.spans import Spans
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.scoring.backend import FloatArray, Grid, checked_placements, chosen_spans
from silhouette_core.scoring.target import Target


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
                    disagreement = weight[mask ^ moved].sum(dtype=np.float64)  # (7)
                    distances[k, p * len(shifts) + s] = target.scale * disagreement
        return distances

    def drawn_weights(
        self,
        weights: FloatArray,
        vertices_cam: FloatArray,
        faces: NDArray[np.integer],
        matrix: FloatArray,
        cull_back: bool = False,
    ) -> FloatArray:
        """See `Backend.drawn_weights`."""
        labels, size = np.zeros(len(faces), np.int32), weights.shape[::-1]
        drawn = (
            render_parts(mesh, faces, labels, matrix, size, cull_back)[0] > 0
            for mesh in vertices_cam
        )
        return np.array([weights[silhouette].sum() for silhouette in drawn])

    def silhouette_errors(
        self,
        masks: Sequence[NDArray[np.bool_]],
        matrices: FloatArray,
        vertices_cam: FloatArray,
        faces: NDArray[np.integer],
    ) -> FloatArray:
        """See `Backend.silhouette_errors`."""
        labels, errors = np.zeros(len(faces), np.int32), np.ones(len(vertices_cam))
        for k, meshes in enumerate(vertices_cam):
            ratios = []
            for mask, matrix, mesh in zip(masks, matrices, meshes, strict=True):
                parts, _ = render_parts(mesh, faces, labels, matrix, mask.shape[::-1], True)
                either = np.count_nonzero((parts > 0) | mask)
                if either:
                    ratios.append(np.count_nonzero((parts > 0) ^ mask) / either)
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
        scores = np.zeros(len(rotations), np.int64)
        for k, world in enumerate(_placed(points, rotations, translations_m)):
            cameras = _placed(world, views.rotation, views.translation_m)
            for image, (fx, fy, cx, cy), seen in zip(
                images, views.intrinsics, cameras, strict=True
            ):
                x, y, depth = seen[seen[:, 2] >= 0.05].T
                column = np.floor((fx * x / depth + cx) + 0.5)
                row = np.floor((fy * y / depth + cy) + 0.5)
                within = (row >= 0) & (row < len(image)) & (column >= 0) & (column < image.shape[1])
                pixel = row[within].astype(np.int64), column[within].astype(np.int64)
                scores[k] += image[pixel].sum(dtype=np.int64)
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
        scores = np.zeros((len(rotations), 2))
        for score, world in zip(scores, _placed(points, rotations, translations_m), strict=True):
            voxel = np.floor((world - grid.origin_m) * (1.0 / grid.voxel_size_m))
            occupied = _look_up(occupancy, voxel, False)
            # Sums in the order of the points.
            sums = np.cumsum([np.where(occupied, weights, 0), np.where(occupied, 0, weights)], 1)
            score[:] = sums[:, -1] if len(points) else 0.0
        return scores[:, 0], scores[:, 1]

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
        sets = np.zeros((len(rotations), 64 * words), bool)
        empty, taken = np.zeros((2, len(rotations)), np.int64)
        for k, world in enumerate(_placed(points, rotations, translations_m)):
            found = _look_up(numbers, np.floor((world - grid.origin_m) / grid.voxel_size_m), -1)
            sets[k, found[found >= 0]] = True
            empty[k], taken[k] = np.count_nonzero(found == -1), np.count_nonzero(found == -2)
        return np.packbits(sets, axis=1, bitorder="little").view(np.uint64), empty, taken


def _placed(
    points: FloatArray, rotations: FloatArray, translations_m: FloatArray
) -> Iterator[FloatArray]:
    """Yields the points (P, 3) of every placement; written out, so that sums have one order."""
    points, rotations, translations_m = checked_placements(points, rotations, translations_m)
    for r, t in zip(rotations, translations_m, strict=True):
        x, y, z = points[:, :1], points[:, 1:2], points[:, 2:]
        yield ((x * r[:, 0] + y * r[:, 1]) + z * r[:, 2]) + t


def _look_up(array: NDArray, voxel: FloatArray, beyond: int) -> NDArray:
    """Returns the entries of an array at voxels (P, 3), or `beyond` outside of it."""
    within = ((voxel >= 0) & (voxel < array.shape)).all(axis=1)
    found = np.full(len(voxel), beyond, array.dtype)
    found[within] = array[tuple(voxel[within].astype(np.int64).T)]
    return found
