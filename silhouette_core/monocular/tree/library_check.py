"""Checks of a pose library's arrays when it is read: kernels trust indices and counts blindly.

Right checksums say that a file is as it was written, not that a library was written.
"""

from collections.abc import Iterable
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.checks import check_array
from silhouette_core.monocular.tree.pose_library import Level, LibrarySettings, PoseLibrary
from silhouette_core.monocular.tree.rendering import SIZES_PX, WINDOW_PX

_LARGEST_ANGLE = 20  # radians, of joints and views
_LARGEST_PX = 10_000
_WEIGHTINGS = "xor", "wxor", "nwxor", "balanced"  # of which there was a choice once


def check_library(library: PoseLibrary) -> None:
    """Checks counts, shapes, dtypes, ranges of indices and finiteness of all arrays. Raises
    TypeError where an array has another dtype than `PoseLibrary` states; ValueError where an array,
    which the message names, has another shape, or holds what it cannot.
    """
    bases, samples, views = library.bases, len(library), len(library.views)
    poses, dofs, parts = len(bases.angles), library.model.dof_count, len(library.model.names)
    if views != library.settings.views_count:
        raise ValueError(f"views are {views}, its settings make {library.settings.views_count}")
    angle, px = (-_LARGEST_ANGLE, _LARGEST_ANGLE), (-_LARGEST_PX, _LARGEST_PX)
    _check("base_angles", bases.angles, (poses, dofs), np.float32, angle)
    _check("base_quaternion", bases.quaternion, (poses, 4), np.float32)
    _check("base_source", bases.source, (poses, 2), np.int32, (0, np.iinfo(np.int32).max))
    _check("base_mirrored", bases.mirrored, (poses,), np.bool_)
    _check("sigma_rad", bases.sigma_rad, (dofs,), np.float32, (1e-6, _LARGEST_ANGLE))
    _check("views", library.views, (views, 2), np.float64, angle)
    _check("sample_base", library.sample_base, (samples,), np.int32, (0, poses - 1))
    _check("sample_view", library.sample_view, (samples,), np.int16, (0, views - 1))
    _check("pelvis_px", library.pelvis_px, (samples, 2), np.float32, px)
    _check("areas", library.areas, (samples, parts), np.uint16)
    _check("occluded", library.occluded, (samples, parts), np.bool_)
    _check("cut", library.cut, (samples,), np.bool_)
    _check("leaf_samples", library.leaf_samples, (samples,), np.int32, (0, samples - 1))
    _within("root_sigma_rad", np.array([bases.root_sigma_rad]), 1e-6, _LARGEST_ANGLE)
    norms = np.linalg.norm(bases.quaternion.astype(np.float64), axis=1)
    _within("lengths of base_quaternion", norms, 0.99, 1.01)
    _within("base_source", bases.source[:, 0], 0, len(bases.clips) - 1)
    left, top, right, bottom = library.bounds_px
    if not (0 <= left <= right <= WINDOW_PX[0] and 0 <= top <= bottom <= WINDOW_PX[1]):
        raise ValueError(f"bounds_px {library.bounds_px} are not in the window")
    _check_tree(library)
    _check_neighbours(library)


def check_library_settings(settings: LibrarySettings) -> None:
    """Checks types and values that `LibrarySettings` itself takes for granted. Raises ValueError
    where a setting has another type or an impossible value.
    """
    good = {
        "poses": isinstance(settings.poses, int) and settings.poses <= 10**9,
        "pitches_deg": len(settings.pitches_deg) <= 100,
        "mirror": isinstance(settings.mirror, bool),
        "thresholds": len(settings.thresholds) == len(SIZES_PX) and _real(*settings.thresholds),
        "tolerance_deg": _real(settings.tolerance_deg),
        "weighting": settings.weighting in _WEIGHTINGS,
    }
    if wrong := [name for name, is_good in good.items() if not is_good]:
        raise ValueError(f"its settings have an impossible {wrong[0]}")


def _real(*values: object) -> bool:
    return all(isinstance(one, int | float) and abs(one) < 1e9 for one in values)


def _check_tree(library: PoseLibrary) -> None:
    """Checks levels and leaves."""
    samples, levels = len(library), library.levels
    offsets = library.leaf_offsets
    check_array("leaf_offsets", offsets, (len(levels[-1]) + 1,), np.int64)
    if offsets[0] != 0 or offsets[-1] != samples or (np.diff(offsets) < 1).any():
        raise ValueError(f"leaf_offsets do not rise from 0 to {samples}")
    if (np.bincount(library.leaf_samples, minlength=samples) != 1).any():
        raise ValueError("leaf_samples do not hold every sample once")
    if tuple(level.size_px for level in levels) != SIZES_PX:
        raise ValueError(f"its levels have the sizes {[level.size_px for level in levels]}")
    for number, level in enumerate(levels):
        _check_level(f"level{number}", level, samples)
    if levels[0].parent.any():
        raise ValueError("level0.parent is not zero")
    for number, (above, below) in enumerate(pairwise(levels), 1):
        counts = np.bincount(below.parent, minlength=len(above))
        if len(counts) != len(above) or not counts.all() or (np.diff(below.parent) < 0).any():
            raise ValueError(f"level{number}.parent does not count the nodes above one by one")


def _check_level(name: str, level: Level, samples: int) -> None:
    """Checks one level by itself."""
    spans, nodes = level.spans, len(level)
    _check(f"{name}.representative", level.representative, (nodes,), np.int32, (0, samples - 1))
    _check(f"{name}.parent", level.parent, (nodes,), np.int32, (0, samples - 1))
    if not nodes:
        raise ValueError(f"{name} has no nodes")
    if not _real(level.threshold) or level.threshold < 0:
        raise ValueError(f"{name} has the threshold {level.threshold}")
    width, height = level.size_px
    _check(f"{name}.offsets", spans.offsets, (nodes + 1,), np.int64)
    for key, most in (("rows", height - 1), ("ends", width), ("starts", width)):
        _check(f"{name}.{key}", getattr(spans, key), (len(spans.rows),), np.int16, (0, most))
    if (spans.starts >= spans.ends).any():
        raise ValueError(f"{name}.starts are not before {name}.ends")


def _check_neighbours(library: PoseLibrary) -> None:
    """Checks the nearest samples, of which the first is the sample itself."""
    for model in {name.partition(".")[0] for name in library.neighbours}:
        index, square = (library.neighbours[f"{model}.{name}"] for name in ("index", "square"))
        count = index.shape[1] if index.ndim == 2 else 0
        name = f"neighbours.{model}"
        _check(f"{name}.index", index, (len(library), count), np.int32, (0, len(library) - 1))
        check_array(f"{name}.square", square, (len(library), count), np.float32)
        if not count:
            raise ValueError(f"{name}.index is empty")
        # Infinite where there were too few candidates, but not of all: weights are divided by
        # their sum.
        if not (square >= 0).all() or not (square[:, 0] <= 1).all():
            raise ValueError(f"{name}.square holds what is no squared distance")


def _check(
    name: str,
    array: NDArray[Any],
    shape: Iterable[int | str],
    dtype: type[np.generic],
    limits: tuple[float, float] = (-np.inf, np.inf),
) -> None:
    """Checks shape, dtype and range; truth values must be 0 or 1."""
    check_array(name, array, shape, dtype)
    if array.dtype == np.bool_ and array.size and array.view(np.uint8).max() > 1:
        raise ValueError(f"{name} holds what is neither true nor false")
    _within(name, array, *limits)


def _within(name: str, array: NDArray[Any], least: float, most: float) -> None:
    """Checks that all numbers are in a range; NaN is in none."""
    if array.size and not (array.min() >= least and array.max() <= most):
        raise ValueError(
            f"{name} holds numbers from {array.min():g} to {array.max():g}, beyond {least:g} to"
            f" {most:g}"
        )
