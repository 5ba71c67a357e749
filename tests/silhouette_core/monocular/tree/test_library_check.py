"""A library with right checksums and wrong content is refused before a kernel sees it."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.monocular.tree.store import read_library, write_library
from tests.silhouette_core.monocular.tree.small_library import small_library

ONE_WRONG = {
    "base_angles": np.nan,
    "base_quaternion": 5.0,
    "base_source": 99,
    "views": 1e308,
    "sample_base": -1,
    "sample_view": 32_000,
    "pelvis_px": -1e30,
    "leaf_samples": 2**30,
    "leaf_offsets": 2**62,
    "sigma_rad": 0.0,
}
RUNS = {"rows": 60, "starts": -1, "ends": 81, "offsets": -5}
SETTINGS_WRONG = {"poses": 1e300, "thresholds": (1.0,), "mirror": 2, "weighting": "ssd"}


@pytest.fixture(scope="module")
def made():
    return small_library(poses=60)


def refusal(library, path) -> str:
    write_library(library, path)
    with pytest.raises(
        InputError, match=r"me\.vplib is damaged .*voxelpose library build"
    ) as error:
        read_library(path)
    return str(error.value)


def with_one(array, value, place=-1):
    array = array.copy()
    array.reshape(-1)[place] = value
    return array


def array_of(library, name):
    return getattr(library if hasattr(library, name) else library.bases, name.removeprefix("base_"))


def with_array(library, name, array):
    if hasattr(library, name):
        return replace(library, **{name: array})
    return replace(library, bases=replace(library.bases, **{name.removeprefix("base_"): array}))


@pytest.mark.parametrize("name", ONE_WRONG)
def test_one_wrong_number_is_named(made, tmp_path, name):
    place = 3 if name == "leaf_offsets" else 0 if name == "base_source" else -1
    wrong = with_array(made, name, with_one(array_of(made, name), ONE_WRONG[name], place))
    assert name in refusal(wrong, tmp_path / "me.vplib")


@pytest.mark.parametrize("name", [*ONE_WRONG, "areas", "occluded", "cut", "base_mirrored"])
def test_other_shapes_and_types_are_named(made, tmp_path, name):
    array = array_of(made, name)
    path = tmp_path / "me.vplib"
    if name not in ("base_angles", "sample_base"):  # whose lengths the others must have
        assert name in refusal(with_array(made, name, array[:-1]), path)
    assert name in refusal(with_array(made, name, array[..., None]), path)
    other = np.float64 if array.dtype != np.float64 else np.float32
    assert name in refusal(with_array(made, name, array.astype(other)), path)


@pytest.mark.parametrize("name", RUNS)
def test_runs_beyond_their_picture_are_refused(made, tmp_path, name):
    level = made.levels[0]
    runs = {key: getattr(level.spans, key).copy() for key in RUNS}
    spans = replace(level.spans)
    object.__setattr__(spans, name, with_one(runs[name], RUNS[name], 1))
    wrong = replace(made, levels=(replace(level, spans=spans), *made.levels[1:]))
    assert "level0" in refusal(wrong, tmp_path / "me.vplib") or name == "offsets"


def test_a_tree_that_is_none_is_refused(made, tmp_path):
    first, *others = made.levels
    path = tmp_path / "me.vplib"
    for change in (
        {"parent": with_one(first.parent, 1)},
        {"representative": with_one(first.representative, len(made))},
        {"threshold": float("nan")},
    ):
        wrong = replace(made, levels=(replace(first, **change), *others))
        assert "level0" in refusal(wrong, path)
    wrong = replace(made, levels=(replace(first, size_px=(160, 120)), *others))
    assert "sizes [(160, 120), (160, 120), (320, 240)]" in refusal(wrong, path)
    parent = with_one(others[0].parent, 0)
    wrong = replace(made, levels=(first, replace(others[0], parent=parent), *others[1:]))
    assert "level1.parent" in refusal(wrong, path)
    twice = with_one(made.leaf_samples, made.leaf_samples[0])
    assert "leaf_samples do not hold every sample once" in refusal(
        replace(made, leaf_samples=twice), path
    )


def test_neighbours_that_are_none_are_refused(made, tmp_path):
    for key, value in (("dm2.index", -1), ("dm2.index", 10**6), ("dm2.square", np.nan)):
        wrong = {**made.neighbours, key: with_one(made.neighbours[key], value)}
        assert key in refusal(replace(made, neighbours=wrong), tmp_path / "me.vplib")
    none = {key: array[:, :0] for key, array in made.neighbours.items()}
    assert "neighbours" in refusal(replace(made, neighbours=none), tmp_path / "me.vplib")


@pytest.mark.parametrize("name", SETTINGS_WRONG)
def test_settings_that_make_no_library_are_refused(made, tmp_path, name):
    settings = replace(made.settings)
    object.__setattr__(settings, name, SETTINGS_WRONG[name])
    assert name in refusal(replace(made, settings=settings), tmp_path / "me.vplib")
