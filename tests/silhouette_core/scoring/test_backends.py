"""One set of tests for every scoring backend: the project's own two and one registered outside."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from silhouette_core.image.raster import render_parts
from silhouette_core.image.spans import Spans
from silhouette_core.jit import set_threads
from silhouette_core.scoring.backend import load_backend
from silhouette_core.scoring.cpu import CpuBackend
from silhouette_core.scoring.target import Target
from tests.oracles.reference_backend import ReferenceBackend
from tests.outside import install_backend

REFERENCE = ReferenceBackend()


@pytest.fixture(autouse=True)
def outside(tmp_path, monkeypatch):
    install_backend(tmp_path, monkeypatch)


@pytest.fixture(params=["reference-1", "cpu-1", "cpu-2", "arrays-1", "arrays-2"])
def backend(request):
    """The reference, and every backend by its registered name, with one and with two threads."""
    name, threads = request.param.split("-")
    set_threads(int(threads))
    yield REFERENCE if name == "reference" else load_backend(name)
    set_threads()


def target_of(rng, windows, shifts, shape):
    return Target(
        tuple(rng.random(shape) > 0.5 for _ in range(windows)),
        tuple(
            rng.random(shape).astype(rng.choice([np.float32, np.float64])) for _ in range(windows)
        ),
        rng.integers(-3, 4, (shifts, 2)) if shifts > 1 else np.zeros((1, 2), np.int64),
        float(rng.uniform(0.1, 2)),
    )


def meshes_of(rng, *shape):
    """Triangles (..., 30, 3) before a camera, some of them cut by its near plane."""
    return rng.normal(size=(*shape, 30, 3)) * (0.5, 0.5, 0.6) + (0, 0, 1.2)


FACES = np.arange(30).reshape(10, 3)
MATRIX = np.array([[40.0, 0, 31.5], [0, 42.0, 23.5], [0, 0, 1]])


def placements_of(rng, count):
    rotations = Rotation.random(count, random_state=int(rng.integers(1 << 30))).as_matrix()
    return rotations.reshape(-1, 3, 3), rng.normal(size=(count, 3))


def grid_of(rng):
    return SimpleNamespace(
        origin_m=rng.normal(size=3) - 0.5, voxel_size_m=float(rng.uniform(0.05, 0.2))
    )


@pytest.mark.parametrize(("windows", "shifts"), [(1, 1), (3, 1), (1, 4), (2, 9)])
@pytest.mark.parametrize("seed", range(4))
def test_span_distance_is_the_weighted_disagreement(backend, windows, shifts, seed):
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 30, 2))
    target = target_of(rng, windows, shifts, shape)
    masks = [rng.random(shape) > rng.random() for _ in range(int(rng.integers(0, 300)))]
    spans = Spans.from_masks(masks)
    if seed % 2:
        runs = (array.astype(np.int16) for array in (spans.rows, spans.starts, spans.ends))
        spans = Spans(*runs, spans.offsets)
    result = backend.span_distances(target, spans)
    expected = REFERENCE.span_distances(target, spans)
    assert result.shape == (len(masks), windows * shifts)
    np.testing.assert_allclose(result, expected, rtol=1e-9, atol=1e-9)
    which = rng.integers(0, max(len(masks), 1), 5 if masks else 0)
    np.testing.assert_array_equal(backend.span_distances(target, spans, which), result[which])
    np.testing.assert_array_equal(backend.span_distances(target, spans, parallel=False), result)
    if shifts == 1:
        plain = [
            [weights[mask ^ other].sum(dtype=float) for mask, weights in zip(*pair, strict=True)]
            for other in masks
            for pair in [(target.masks, target.weights)]
        ]
        np.testing.assert_allclose(
            result, target.scale * np.array(plain).reshape(result.shape), atol=1e-9
        )


@pytest.mark.parametrize("cull", [False, True])
def test_part_images_are_those_of_each_mesh(backend, cull):
    meshes, parts = meshes_of(np.random.default_rng(0), 3), np.arange(10)
    result = backend.part_images(meshes, FACES, parts, MATRIX, (64, 48), cull)
    expected = REFERENCE.part_images(meshes, FACES, parts, MATRIX, (64, 48), cull)
    np.testing.assert_array_equal(result, expected)
    assert result.shape == (3, 48, 64) and len(np.unique(result)) > 5


@pytest.mark.parametrize("cull", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_drawn_weights_are_summed_under_each_mesh(backend, cull, seed):
    rng = np.random.default_rng(seed)
    weights, meshes = rng.normal(size=(48, 64)), meshes_of(rng, 7)
    result = backend.drawn_weights(weights, meshes, FACES, MATRIX, cull)
    expected = REFERENCE.drawn_weights(weights, meshes, FACES, MATRIX, cull)
    np.testing.assert_allclose(result, expected, rtol=1e-9, atol=1e-9)
    # Eq. (7), with the weights of a silhouette: the disagreement with it, pixel by pixel.
    mask, positive = rng.random(weights.shape) > 0.5, np.abs(weights)
    signed = np.where(mask, -positive, positive)
    result = positive[mask].sum() + backend.drawn_weights(signed, meshes[:1], FACES, MATRIX, cull)
    parts, _ = render_parts(meshes[0], FACES, np.zeros(10, int), MATRIX, (64, 48), cull)
    assert result[0] == pytest.approx(positive[(parts > 0) ^ mask].sum(), abs=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_silhouette_errors_are_the_references(backend, seed):
    rng = np.random.default_rng(seed)
    masks = [rng.random(shape) > 0.3 for shape in ((48, 64), (40, 80), (60, 50))]
    matrices = np.stack([MATRIX, 1.3 * MATRIX, 0.8 * MATRIX])
    matrices[:, 2, 2] = 1
    meshes = meshes_of(rng, 4, 3)
    meshes[3] -= (0, 0, 9)  # behind all cameras
    result = backend.silhouette_errors(masks, matrices, meshes, FACES)
    expected = REFERENCE.silhouette_errors(masks, matrices, meshes, FACES)
    np.testing.assert_allclose(result, expected, rtol=1e-12)
    assert result[3] == 1 and 0 < result[0] < 1
    # A camera that sees nothing and should not is left out.
    empty = [masks[0], np.zeros((20, 20), bool)]
    meshes[0, 1] -= (0, 0, 9)
    result = backend.silhouette_errors(empty, matrices[:2], meshes[:1, :2], FACES)
    assert result == backend.silhouette_errors(masks[:1], matrices[:1], meshes[:1, :1], FACES)
    none = backend.silhouette_errors(empty[1:], matrices[:1], meshes[3:, :1], FACES)
    assert none.tolist() == [1.0]


@pytest.mark.parametrize("seed", range(3))
def test_pixel_scores_are_the_references(backend, seed):
    rng = np.random.default_rng(seed)
    rotation, translation_m = placements_of(rng, 3)
    views = SimpleNamespace(
        intrinsics=rng.uniform(20, 60, (3, 4)),
        rotation=rotation,
        translation_m=translation_m + np.array([0, 0, 1]),
    )
    images = rng.integers(-3, 3, (3, 50, 70)).astype(np.int8)
    case = views, images, rng.normal(size=(40, 3)), *placements_of(rng, 20)
    result = backend.pixel_scores(*case)
    np.testing.assert_array_equal(result, REFERENCE.pixel_scores(*case))
    assert len(np.unique(result)) > 3


@pytest.mark.parametrize("seed", range(8))
def test_voxel_overlap_is_the_references(backend, seed):
    rng = np.random.default_rng(seed)
    occupancy = rng.random(tuple(rng.integers(1, 14, 3))) > 0.4
    points = rng.normal(size=(seed * 8, 3))
    weights = rng.random(len(points))
    case = grid_of(rng), occupancy, points, weights, *placements_of(rng, 12)
    result, expected = backend.voxel_overlap(*case), REFERENCE.voxel_overlap(*case)
    np.testing.assert_allclose(result, expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(expected[0] + expected[1], weights.sum(), atol=1e-12)
    if isinstance(backend, CpuBackend):
        np.testing.assert_array_equal(result, expected)


def test_a_part_overlaps_where_it_was_cut_out(backend):
    occupancy = np.zeros((10, 10, 10), bool)
    occupancy[2:5, 3:6, 4:8] = True
    grid = SimpleNamespace(origin_m=np.array([0.5, 0.0, -0.5]), voxel_size_m=0.1)
    points = (np.argwhere(occupancy) + 0.5) * 0.1
    shifts = grid.origin_m + np.array([[0, 0, 0], [0.1, 0, 0], [0, 0, 0.2], [5.0, 0, 0]])
    rotations = np.repeat(np.eye(3)[None], 4, axis=0)
    inside, outside = backend.voxel_overlap(grid, occupancy, points, np.ones(36), rotations, shifts)
    np.testing.assert_allclose(inside, [36, 24, 18, 0])
    np.testing.assert_allclose(outside, [0, 12, 18, 36])


@pytest.mark.parametrize("seed", range(4))
def test_voxel_cover_is_the_references(backend, seed):
    rng = np.random.default_rng(seed)
    numbers = np.arange(10 * 11 * 12, dtype=np.int32).reshape(10, 11, 12)
    numbers[rng.random(numbers.shape) < 0.4] = -1
    numbers[rng.random(numbers.shape) < 0.2] = -2
    grid = SimpleNamespace(origin_m=np.full(3, -1.0), voxel_size_m=0.2)
    case = grid, numbers, 21, rng.normal(size=(90, 3)), *placements_of(rng, 15)
    result, expected = backend.voxel_cover(*case), REFERENCE.voxel_cover(*case)
    for ours, theirs in zip(result, expected, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert result[0].dtype == np.uint64 and result[0].any() and result[1].any() and result[2].any()


@pytest.mark.parametrize("own", [REFERENCE, CpuBackend()])
def test_arrays_that_do_not_belong_together_are_refused(own):
    rng = np.random.default_rng(0)
    points, (rotations, translations) = rng.random((5, 3)), placements_of(rng, 3)
    grid, numbers = grid_of(rng), np.zeros((2, 2, 2), np.int32)
    for wrong, message in [
        ((points[:, :2], rotations, translations), r"points must be \(P, 3\), got \(5, 2\)"),
        ((points, rotations[0], translations), r"rotations must be \(K, 3, 3\)"),
        ((points, rotations, translations[1:]), r"translations_m must be \(3, 3\)"),
    ]:
        with pytest.raises(ValueError, match=message):
            own.voxel_cover(grid, numbers, 1, *wrong)
    target = Target.from_mask(np.zeros((3, 4), bool))
    with pytest.raises(ValueError, match="which must be 0 to 0, got 1 to 1"):
        own.span_distances(target, Spans.from_masks([np.ones((3, 4), bool)]), np.array([1]))


def test_what_is_registered_is_checked():
    with pytest.raises(InputError, match=r"no backend is called 'gpu'.*arrays.*cpu"):
        load_backend("gpu")
    with pytest.raises(TypeError, match="types:SimpleNamespace is registered as backend 'nothing'"):
        load_backend("nothing")


def test_scoring_kernels_are_known_to_the_scoring_room_alone():
    root = Path(__file__).resolve().parents[3]
    files = [
        p
        for name in ("calib", "silhouette_core", "voxelpose")
        for p in root.glob(f"{name}/**/*.py")
    ]
    users = {
        path.relative_to(root).parts[:2]
        for path in files
        if "scoring.kernels" in path.read_text(encoding="utf-8")
    }
    assert users == {("silhouette_core", "scoring")}


@pytest.mark.parametrize("seed", range(3))
def test_unknown_pixels_do_not_count_as_silhouette_errors(backend, seed):
    rng = np.random.default_rng(seed)
    unknown = [rng.random(shape) > 0.6 for shape in ((48, 64), (40, 80))]
    masks = [(rng.random(where.shape) > 0.3) & ~where for where in unknown]
    matrices, meshes = np.stack([MATRIX, MATRIX]), meshes_of(rng, 3, 2)
    result = backend.silhouette_errors(masks, matrices, meshes, FACES, unknown)
    for k, error in enumerate(result):
        ratios = []
        for mask, where, mesh in zip(masks, unknown, meshes[k], strict=True):
            size = mask.shape[::-1]
            drawn = render_parts(mesh, FACES, np.zeros(10, int), MATRIX, size, True)[0] > 0
            drawn &= ~where
            ratios.append((drawn ^ mask).sum() / (drawn | mask).sum())
        assert error == pytest.approx(np.mean(ratios), abs=1e-12)
