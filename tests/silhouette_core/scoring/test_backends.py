"""The program's own scoring backend and that of the examples conform to the protocol, and what does
not is noticed.
"""

import gc
import weakref
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from calib.errors import InputError
from examples.backend_conformance import BackendConformance
from examples.numpy_backend import NumpyBackend, ResidentCopies
from silhouette_core.image.spans import Spans
from silhouette_core.jit import set_threads
from silhouette_core.scoring.backend import Target, load_backend
from silhouette_core.scoring.cpu import CpuBackend
from tests.outside import METHODS, install_backends


class TestNumpyBackend(BackendConformance):
    backend = NumpyBackend()


@pytest.mark.parametrize("threads", [1, 2])
class TestCpuBackend(BackendConformance):
    backend = CpuBackend()

    @pytest.fixture(autouse=True)
    def threaded(self, threads):
        set_threads(threads)
        yield
        set_threads()


def wrong(method, change):
    """A backend whose method does not keep a rule: its arguments, or its result, are changed."""

    class Wrong(CpuBackend):
        pass

    setattr(Wrong, method, lambda self, *given: change(getattr(CpuBackend(), method), *given))
    return Wrong()


def unculled(draw, *given):
    return draw(*given[:5], False)


def moved(draw, meshes, faces, parts, matrix, *view):
    return draw(meshes, faces, parts, matrix + np.eye(3, k=2) * 0.4 / 256, *view)


def last_first(draw, meshes, faces, parts, *view):
    return draw(meshes, faces[::-1], parts[::-1], *view)


def floored(score, views, *given):
    low = SimpleNamespace(**{**vars(views), "intrinsics": views.intrinsics - [0, 0, 0.5, 0.5]})
    return score(low, *given)


def ends_at_the_border(score, target, *given):
    weights = tuple(np.pad(one, 9) for one in target.weights)
    masks = tuple(np.pad(one, 9) for one in target.masks)
    (spans, *rest) = given
    moved = Spans(spans.rows + 9, spans.starts + 9, spans.ends + 9, spans.offsets)
    return score(Target(masks, weights, target.shifts_px, target.scale), moved, *rest)


def without_unknown(score, masks, matrices, meshes, faces, unknown=None):
    return score(masks, matrices, meshes, faces)


def in_whole_cells(score, grid, *given):
    return score(SimpleNamespace(**{**vars(grid), "origin_m": grid.origin_m - 0.01}), *given)


@pytest.mark.parametrize(
    ("method", "change"),
    [
        ("part_images", unculled),
        ("part_images", moved),
        ("part_images", last_first),
        ("part_images", lambda draw, *given: draw(*given).astype(np.int32)),
        ("drawn_weights", lambda draw, *given: draw(*given).astype(np.float32)),
        ("drawn_weights", lambda draw, weights, *given: draw(np.abs(weights), *given)),
        ("silhouette_errors", without_unknown),
        ("silhouette_errors", lambda score, *given: 0.5 * score(*given)),
        ("pixel_scores", floored),
        ("span_distances", ends_at_the_border),
        ("span_distances", lambda score, *given: score(*given[:2], np.sort(given[2]))),
        ("voxel_overlap", in_whole_cells),
        ("voxel_overlap", lambda score, *given: score(*given)[::-1]),
        ("voxel_cover", in_whole_cells),
    ],
)
def test_a_backend_that_does_not_keep_a_rule_is_noticed(method, change):
    with pytest.raises(AssertionError):
        BackendConformance.run(wrong(method, change))


@pytest.mark.parametrize("method", METHODS)
def test_a_backend_that_writes_to_what_it_is_given_is_noticed(method):
    def writing(score, *given):
        result = score(*given)
        for one in given:
            if isinstance(one, np.ndarray) and one.size:
                one[...] = one.flat[0] + 1 - 2 * (one.flat[0] > 0)
        return result

    if method != "span_distances":  # it is given no arrays but in objects
        with pytest.raises(AssertionError):
            BackendConformance.run(wrong(method, writing))


def test_copies_are_kept_as_long_as_what_they_are_of():
    made, kept = [], np.ones(3)
    copies = ResidentCopies(lambda array: made.append(1) or array.sum())
    assert [copies(kept), copies(kept), copies(np.ones(3))] == [3, 3, 3] and len(made) == 2
    gone = weakref.ref(kept)
    del kept
    gc.collect()
    assert gone() is None and not copies._made


def test_what_is_registered_is_checked_and_made_once(tmp_path, monkeypatch):
    install_backends(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    assert isinstance(load_backend("numpy"), NumpyBackend)
    assert load_backend("numpy") is load_backend("numpy")
    with pytest.raises(InputError, match=r"no backend is called 'gpu'.*counted.*cpu.*numpy"):
        load_backend("gpu")
    with pytest.raises(TypeError, match="types:SimpleNamespace is registered as backend 'nothing'"):
        load_backend("nothing")


@pytest.mark.parametrize("backend", [NumpyBackend(), CpuBackend()])
def test_arrays_that_do_not_belong_together_are_refused(backend):
    rng = np.random.default_rng(0)
    points, rotations, translations_m = rng.random((5, 3)), np.eye(3)[None], np.zeros((1, 3))
    grid, numbers = SimpleNamespace(origin_m=np.zeros(3), voxel_size_m=1.0), np.zeros((2, 2, 2))
    for given, message in [
        ((points[:, :2], rotations, translations_m), r"points must be \(P, 3\), got \(5, 2\)"),
        ((points, rotations[0], translations_m), r"rotations must be \(K, 3, 3\)"),
        ((points, rotations, translations_m[:0]), r"translations_m must be \(1, 3\)"),
    ]:
        with pytest.raises(ValueError, match=message):
            backend.voxel_cover(grid, numbers.astype(np.int32), 1, *given)


def test_scoring_kernels_and_the_programs_own_backend_are_named_where_they_belong():
    root = Path(__file__).resolve().parents[3]
    files = {
        path.relative_to(root).as_posix(): path.read_text(encoding="utf-8")
        for name in ("calib", "silhouette_core", "voxelpose")
        for path in root.glob(f"{name}/**/*.py")
    }
    kernels = {name.rsplit("/", 1)[0] for name, text in files.items() if "scoring.kernels" in text}
    assert kernels == {"silhouette_core/scoring"}
    # A library of poses is the same whatever scores with it.
    assert {name for name, text in files.items() if "CpuBackend" in text} == {
        "silhouette_core/monocular/tree/tree.py",
        *(f"silhouette_core/scoring/{name}.py" for name in ("backend", "cpu")),
    }
