"""Tests that any scoring backend passes, for the author of one.

    from examples.backend_conformance import BackendConformance

    class TestMyBackend(BackendConformance):
        backend = MyBackend()

in a file of tests, or `BackendConformance.run(MyBackend())` without any. Rules that are easily
missed have a case each with a known answer; the rest is compared with `cpu` on random cases.
"""

from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal, assert_equal
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calib.checks import ByteArray, FloatArray, IntArray
from silhouette_core.image.spans import Spans
from silhouette_core.scoring.backend import Backend, Target
from silhouette_core.scoring.cpu import CpuBackend

_MATRIX = np.array([[40, 1, 31], [0, 42, 23], [0, 0, 1]], np.float64)
_FACES = np.arange(30).reshape(10, 3)
_PIXELS = np.eye(3)  # of meshes whose corners are given in pixels, at 1 m
_SIZE = 20, 26
_SEEDS = 4


class BackendConformance:
    """The tests; `backend` is what they test."""

    backend: ClassVar[Backend]

    @classmethod
    def run(cls, backend: Backend) -> None:
        """Tests a backend; AssertionError where it does not conform."""
        tests = type("Tests", (cls,), {"backend": backend})()
        for name in dir(tests):
            if name.startswith("test_"):
                getattr(tests, name)()

    def test_distances_of_silhouettes(self) -> None:
        """Eq. (7), in several windows, moved, of few and of many silhouettes."""
        for seed in range(_SEEDS):
            for windows, shifts in ((1, 1), (3, 1), (1, 4), (2, 9)):
                rng = np.random.default_rng(seed)
                target, spans = _target(rng, windows, shifts), _spans(rng, (7, 600, 0, 40)[seed])
                for which in (np.arange(len(spans)), rng.permutation(len(spans))[:5]):
                    result = self._same("span_distances", target, spans, which)
                    assert_equal(result.shape, (len(which), windows * shifts))

    def test_a_silhouette_moved_out_of_the_window_counts_on(self) -> None:
        """Beyond the window the weight at its border goes on."""
        mask = np.zeros((2, 2), np.bool_)
        weights = np.array([[1, 2], [4, 8]], np.float32)
        target = Target((mask,), (weights,), np.array([[0, 0], [1, 0], [2, 2]]), 0.5)
        result = self._same("span_distances", target, Spans.from_masks([~mask]), np.arange(1))
        assert_array_equal(result, 0.5 * np.array([[15, 20, 32]]))

    def test_a_number_that_no_silhouette_has_is_refused(self) -> None:
        """ValueError."""
        target = Target((np.zeros((3, 4), np.bool_),), (np.ones((3, 4)),))
        spans = Spans.from_masks([np.ones((3, 4), np.bool_)])
        for which in (-1, 1):
            try:
                self.backend.span_distances(target, spans, np.array([which]))
            except ValueError:
                continue
            raise AssertionError(f"silhouette {which} of 1 was measured")

    def test_part_images(self) -> None:
        """Ten triangles, some of them cut at the near plane, one not finite."""
        for seed in range(_SEEDS):
            meshes = _meshes(np.random.default_rng(seed), 3)
            meshes[0, 4, 1] = np.nan
            for cull in (False, True):
                parts = np.arange(10)[::-1]
                result = self._same("part_images", meshes, _FACES, parts, _MATRIX, (64, 48), cull)
                assert_array_equal(len(np.unique(result)) > 3, True)

    def test_pixels_on_an_edge_belong_to_one_triangle(self) -> None:
        """A square of two triangles draws the pixels on its left and upper edges, and no others."""
        square = [(2, 1, 1), (2, 5, 1), (6, 5, 1), (6, 1, 1)]
        expected = np.zeros((8, 8), np.uint8)
        expected[1:5, 2:6] = 1
        self._draws(square, [(0, 1, 2), (0, 2, 3)], expected)
        self._draws(square, [(2, 1, 0), (3, 2, 0)], expected, cull_back=False)
        self._draws(square, [(2, 1, 0), (3, 2, 0)], 0 * expected)

    def test_corners_are_rounded_to_a_256th_of_a_pixel(self) -> None:
        """Halves up: within half a step an edge is on the pixel."""
        for step, moved in ((0.5, 1), (0.4, 0), (-0.5, 0), (-0.6, 0)):
            low, high = 2 + step / 256, 5 + step / 256
            expected = np.zeros((8, 8), np.uint8)
            expected[2 + moved : 5 + moved, 2 + moved : 5 + moved] = 1
            square = [(low, low, 1), (low, high, 1), (high, high, 1), (high, low, 1)]
            self._draws(square, [(0, 1, 2), (0, 2, 3)], expected)

    def test_of_equally_near_faces_the_first_is_drawn(self) -> None:
        """And the nearer one of others, whatever their order."""
        corners = [(0, 0, 1), (0, 9, 1), (9, 0, 1), (0, 0, 0.5), (0, 9, 0.5), (9, 0, 0.5)]
        near, far = (3, 4, 5), (0, 1, 2)
        for faces, drawn in (((far, near), 2), ((near, far), 1), ((far, far), 1)):
            mesh, triangles = _scene(corners, faces)
            images = self._same("part_images", mesh, triangles, np.arange(2), _PIXELS, (8, 8))
            assert_array_equal(np.unique(images), [0, drawn])

    def test_weights_under_drawn_meshes(self) -> None:
        """Dyadic weights are summed exactly."""
        for seed in range(_SEEDS):
            rng = np.random.default_rng(seed)
            weights, meshes = _dyadic(rng, (48, 64)) - 0.5, _meshes(rng, 7)
            drawn = self._same("drawn_weights", weights, meshes, _FACES, _MATRIX)
            parts = np.zeros(10, np.int64)
            images = self.backend.part_images(meshes, _FACES, parts, _MATRIX, (64, 48))
            assert_array_equal(drawn, [weights[image > 0].sum() for image in images])

    def test_silhouette_errors(self) -> None:
        """Cameras of several sizes, with pixels of which nothing is known."""
        for seed in range(_SEEDS):
            rng = np.random.default_rng(seed)
            unknown = [rng.random(size) > 0.8 for size in ((48, 64), (40, 80), (60, 50))]
            masks = [(rng.random(where.shape) > 0.3) & ~where for where in unknown]
            matrices = np.stack([_MATRIX, 1.3 * _MATRIX, 0.8 * _MATRIX])
            matrices[:, 2, 2] = 1
            meshes = _meshes(rng, 4, 3)
            meshes[2] += (0, 0, 4)  # before all cameras
            meshes[3] -= (0, 0, 9)  # behind them
            for where in (None, unknown):
                errors = self._same("silhouette_errors", masks, matrices, meshes, _FACES, where)
                assert_array_equal(errors[3], 1)

    def test_a_camera_without_silhouettes_is_left_out(self) -> None:
        """The error is that of the others, and 1 where there are none."""
        masks = [np.eye(8, dtype=np.bool_), np.zeros((8, 8), np.bool_)]
        corners, faces = _scene([(0, 0, 1), (0, 8, 1), (8, 0, 1)], [(0, 1, 2)])
        behind, matrices = corners - (0, 0, 9), np.stack([_PIXELS, _PIXELS])
        both = np.stack([corners, behind], axis=1)
        for given, errors in (
            ((masks, matrices, both), [1 - 4 / (36 + 4)]),
            ((masks[1:], matrices[1:], behind[:, None]), [1]),
            ((masks[:1], matrices[:1], corners[:, None]), [0.9]),
        ):
            assert_allclose(self._same("silhouette_errors", *given, faces), errors, rtol=1e-12)

    def test_scores_of_pixels(self) -> None:
        """Points before, beside and behind three cameras."""
        for seed in range(_SEEDS):
            rng = np.random.default_rng(seed)
            views = _views(rng.uniform(20, 60, (3, 4)), *_placements(rng, 3))
            views.translation_m[:, 2] += 1
            images = rng.integers(-3, 3, (3, 50, 70)).astype(np.int8)
            points, placements = rng.normal(size=(40, 3)), _placements(rng, 20 * seed)
            self._same("pixel_scores", views, images, points, *placements)

    def test_points_are_in_the_nearest_pixel(self) -> None:
        """Halves up, half a pixel beyond the image, and from 0.05 m on."""
        views = _views(np.array([[1.0, 1, 0, 0]]), np.eye(3)[None], np.zeros((1, 3)))
        images = np.array([[[1, 10], [100, 50]]], np.int8)
        points = np.array([(-0.5, -0.5), (0.5, 0.4), (1.4, 1.4), (1.5, 0), (0, -0.6), (-0.1, 0.5)])
        for depth_m, expected in ((1.0, [1, 10, 50, 0, 0, 100]), (0.049, [0] * 6)):
            translations_m = np.column_stack([depth_m * points, np.full(6, depth_m)])
            turns = np.repeat(np.eye(3)[None], 6, axis=0)
            point = np.zeros((1, 3))
            scores = self._same("pixel_scores", views, images, point, turns, translations_m)
            assert_array_equal(scores, expected)

    def test_voxels_of_placements(self) -> None:
        """Overlap and cover, in small grids, of few points and of none."""
        for seed in range(2 * _SEEDS):
            rng = np.random.default_rng(seed)
            shape = tuple(rng.integers(1, 14, 3).tolist())
            numbers = np.arange(np.prod(shape), dtype=np.int32).reshape(shape)
            numbers[rng.random(shape) < 0.4] = -1
            points, placed = rng.normal(size=(seed * 8, 3)), _placements(rng, 12)
            weights = _dyadic(rng, len(points))
            grid = SimpleNamespace(origin_m=rng.normal(size=3) - 0.5, voxel_size_m=0.1)
            inside, outside = self._same(
                "voxel_overlap", grid, numbers >= 0, points, weights, *placed
            )
            assert_array_equal(inside + outside, weights.sum())
            numbers[rng.random(shape) < 0.2] = -2
            self._same("voxel_cover", grid, numbers, 35, points, *placed)

    def test_a_part_lies_where_it_was_cut_out(self) -> None:
        """Voxels from their lower corners on; what is outside of the grid is empty."""
        numbers = np.full((10, 10, 10), -1, np.int32)
        numbers[2:5, 3:6, 4:8] = np.arange(36).reshape(3, 3, 4)
        grid = SimpleNamespace(origin_m=np.array([0.5, 0, -0.5]), voxel_size_m=0.125)
        points = (np.argwhere(numbers >= 0) + 0.5) * 0.125
        moved = np.array([[0, 0, 0], [0.125, 0, 0], [0, 0, 0.25], [5, 0, 0]])
        turns, places_m = np.repeat(np.eye(3)[None], 4, axis=0), grid.origin_m + moved
        weights = np.ones(36)
        overlap = self._same("voxel_overlap", grid, numbers >= 0, points, weights, turns, places_m)
        assert_array_equal(overlap, [[36, 24, 18, 0], [0, 12, 18, 36]])
        numbers[2] = np.where(numbers[2] >= 0, -2, -1)
        bits, empty, taken = self._same("voxel_cover", grid, numbers, 1, points, turns, places_m)
        free = 2**36 - 2**12
        upper = sum(1 << n for n in range(12, 36) if n % 4 > 1)
        assert_array_equal(bits[:, 0], np.array([free, free, upper, 0], np.uint64))
        assert_array_equal([empty, taken], [[0, 12, 18, 36], [12, 0, 6, 0]])

    def _draws(self, corners: Any, faces: Any, expected: ByteArray, cull_back: bool = True) -> None:
        """Corners given in pixels and metres, as all methods that draw see them."""
        meshes, faces = _scene(corners, faces)
        parts = np.zeros(len(faces), np.int64)
        (image,) = self._same("part_images", meshes, faces, parts, _PIXELS, (8, 8), cull_back)
        assert_array_equal(image, expected)

    def _same(self, method: str, *given: Any) -> Any:
        """What a method gives, which is the same as `cpu` gives, and of arrays that are not
        contiguous; it leaves them alone.
        """
        strided = [_strided(one) for one in given]
        expected = getattr(CpuBackend(), method)(*given)
        result = getattr(self.backend, method)(*given)
        assert_equal(given, strided)
        twice = getattr(self.backend, method)(*strided)
        assert_equal(strided, given)
        for array, other, reference in zip(*map(_listed, (result, twice, expected)), strict=True):
            assert_equal((array.dtype, array.shape), (reference.dtype, reference.shape))
            assert_array_equal(array, other)
            within = 1e-12 if method == "silhouette_errors" else 0  # a mean over the cameras
            assert_allclose(array, reference, rtol=within)
        return result


def _dyadic(rng: np.random.Generator, shape: Any) -> FloatArray:
    """Weights from 0 to 1 whose sums are exact."""
    return rng.integers(0, 1 << 12, shape) / (1 << 12)


def _target(rng: np.random.Generator, windows: int, shifts: int) -> Target:
    return Target(
        tuple(rng.random(_SIZE) > 0.5 for _ in range(windows)),
        tuple(_dyadic(rng, _SIZE).astype(rng.choice(["f4", "f8"])) for _ in range(windows)),
        rng.integers(-3, 4, (shifts, 2)) if shifts > 1 else np.zeros((1, 2), np.int64),
        float(rng.uniform(0.1, 2)),
    )


def _spans(rng: np.random.Generator, count: int) -> Spans:
    """Silhouettes, some of them empty, as libraries store them and as they are made."""
    masks = [rng.random(_SIZE) < rng.random() for _ in range(count)]
    spans = Spans.from_masks(np.array(masks, np.bool_).reshape(count, *_SIZE))
    runs: Any = spans.rows, spans.starts, spans.ends
    rows, starts, ends = (array.astype(np.int16 if count % 2 else np.int32) for array in runs)
    return Spans(rows, starts, ends, spans.offsets)


def _meshes(rng: np.random.Generator, *shape: int) -> FloatArray:
    """Triangles (..., 30, 3) before a camera, some of them cut by its near plane."""
    return rng.normal(size=(*shape, 30, 3)) * (0.5, 0.5, 0.6) + (0, 0, 1.2)


def _scene(corners: Any, faces: Any) -> tuple[FloatArray, IntArray]:
    """A mesh (1, V, 3) whose corners are given in pixels and metres, and its faces."""
    vertices = np.array(corners, np.float64)
    vertices[:, :2] *= vertices[:, 2:]
    return vertices[None], np.array(faces)


def _placements(rng: np.random.Generator, count: int) -> tuple[FloatArray, FloatArray]:
    turns = [Rotation.from_rotvec(rng.normal(size=3)).as_matrix() for _ in range(count)]
    return np.reshape(turns, (-1, 3, 3)), rng.normal(size=(count, 3))


def _views(*arrays: FloatArray) -> SimpleNamespace:
    """Cameras by their intrinsics, rotations and translations, which are all that counts."""
    names = "intrinsics", "rotation", "translation_m"
    return SimpleNamespace(**dict(zip(names, arrays, strict=True)))


def _strided(given: Any) -> Any:
    """The same numbers, not contiguous."""
    if isinstance(given, list):
        return [_strided(one) for one in given]
    return np.repeat(given, 2, axis=-1)[..., ::2] if isinstance(given, np.ndarray) else given


def _listed(result: Any) -> tuple[NDArray[Any], ...]:
    return result if isinstance(result, tuple) else (result,)
