"""One frame of the paper's filter, silhouette to posterior, against the same search pixel by pixel:
`python -m benchmarks.filter`.

As a program it follows a whole clip and prints what a frame takes, as Okada and Stenger's Fig. 6
(d) does. As cases of `make bench` one
frame is searched in runs, in images with NumPy, and in images with numba: the same positions and
nodes, in one run. Without a library in $VOXELPOSE_LIBRARY one of 60,000 samples is made
from the program's own motions, once, in out/.
"""

import os
import sys
import time
from collections.abc import Callable
from copy import copy
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.cases import Case, Timed, case
from benchmarks.library import dense_distances
from benchmarks.scene import ring
from calib.camera import Camera
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import SHAPE_SIGMA, BodySizes
from silhouette_core.image.raster import render_parts
from silhouette_core.jit import set_threads
from silhouette_core.monocular.making.from_motion import make_library
from silhouette_core.monocular.person import find_person, upright_distance
from silhouette_core.monocular.tree.descent import Posterior
from silhouette_core.monocular.tree.paper_filter import PaperFilter, initial_prior
from silhouette_core.monocular.tree.pose_library import LibrarySettings, PoseLibrary
from silhouette_core.monocular.tree.rendering import masks_of
from silhouette_core.monocular.tree.store import read_library
from silhouette_core.monocular.tree.transitions import transitions
from silhouette_core.motion import kinematics
from silhouette_core.motion.keyposes import keypose_motions
from silhouette_core.scoring.cpu import CpuBackend

_MADE = Path(__file__).resolve().parents[1] / "out" / "benchmarks" / "filter.vplib"
_SETTINGS = LibrarySettings(poses=60_000)
_FRAMES = 60
_MOVEMENT, _SHAPE_SEED, _STATURE_M = "walk", 5, 1.75

Score = Callable[[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.float32]], NDArray[np.float64]]


def numpy_distances(
    mask: NDArray[np.bool_], silhouettes: NDArray[np.bool_], weights: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Does what `dense_distances` does, as eq. (7) is written."""
    return np.array([weights[mask ^ one].sum(dtype=np.float64) for one in silhouettes]) / mask.size


class DenseBackend(CpuBackend):
    """Weighs silhouettes pixel by pixel; their images are drawn outside of the time.

    Args:
        score: of many images.
    """

    def __init__(self, score: Score):
        self.score, self.drawn = score, {}  # by the images' height and their number

    def span_distances(self, target, spans, which, parallel=True):
        """See `Backend.span_distances`."""
        (height, width), margin, result = target.masks[0].shape, target.margin_px, []
        if (height, len(which)) not in self.drawn:
            self.drawn[height, len(which)] = masks_of(spans, which, (width, height))
        images = self.drawn[height, len(which)]
        for mask, weights in zip(target.masks, target.weights, strict=True):
            wide = np.pad(mask, margin)
            margins = np.pad(weights, margin, mode="edge").astype(np.float32)
            for right, down in target.shifts_px + margin:
                part = slice(down, down + height), slice(right, right + width)
                own, weighed = (np.ascontiguousarray(one[part]) for one in (wide, margins))
                outside = float(margins[wide].sum() - weighed[own].sum())
                result.append(self.score(own, images, weighed) * mask.size + outside)
        return target.scale * np.stack(result, axis=1)


def library_file() -> Path:
    """Returns $VOXELPOSE_LIBRARY, or a library made from the program's own motions."""
    given = os.environ.get("VOXELPOSE_LIBRARY", "")
    if given:
        return Path(given)
    if not _MADE.exists():
        print(f"making {_MADE} once, which takes some minutes ...", file=sys.stderr, flush=True)
        _MADE.parent.mkdir(parents=True, exist_ok=True)
        model = BodyModel.from_sizes(BodySizes(_STATURE_M))
        make_library(keypose_motions(model), model, _MADE, _SETTINGS, learning=None)
    return _MADE


@cache
def _library() -> PoseLibrary:
    return read_library(library_file())


@cache
def clip() -> tuple[Camera, list[NDArray[np.bool_]]]:
    """Returns a camera and the silhouettes of somebody else's body that it sees."""
    camera = ring(1).cameras[0]
    random = np.random.default_rng(_SHAPE_SEED)
    model = BodyModel.from_sizes(BodySizes(_STATURE_M)).reshaped(
        0.7 * SHAPE_SIGMA * random.standard_normal(len(SHAPE_SIGMA))
    )
    clips = keypose_motions(model, variants=1, seed=99)
    motion = clips[next(name for name in clips if _MOVEMENT in name)]
    rotation, origin = motion.parts()
    origin = origin - [*motion.root_m[0, :2], 0.0]
    masks = []
    for row in range(min(_FRAMES, len(motion))):
        seen = (
            kinematics.skin(model, rotation[row], origin[row]) @ camera.rotation.T
            + camera.translation
        )
        masks.append(
            render_parts(seen, model.faces, model.face_part, camera.matrix, camera.size)[0] > 0
        )
    return camera, masks


def _tracker() -> PaperFilter:
    """The filter before the clip's first frame."""
    library, (camera, masks) = _library(), clip()
    matrix = transitions(library, True, normalised=False)
    distance_m = upright_distance(camera, masks[0], library.model.length_m)
    return PaperFilter(library, matrix, camera, distance_m, initial_prior(library), CpuBackend())


def _follow(tracker: PaperFilter, count: int) -> list[float]:
    """Filters the clip's first frames; returns the seconds that each took."""
    seconds = []
    for number, mask in enumerate(clip()[1][:count]):
        person = find_person(mask)
        if person is None:
            raise RuntimeError(f"frame {number} shows nobody")
        started = time.perf_counter()
        tracker.step(number / 30, person.mask)
        seconds.append(time.perf_counter() - started)
    return seconds


def _against(score: Score, name: str, goal: str) -> Case:
    """The frame in the middle of the clip."""
    tracker, dense, number = _tracker(), DenseBackend(score), _FRAMES // 2
    _follow(tracker, number)

    def frame(before: PaperFilter) -> Posterior:
        return before.step(number / 30, clip()[1][number])

    def pixel_by_pixel() -> PaperFilter:
        other = copy(tracker)
        other._backend = dense
        return other

    def check(ours: Posterior, theirs: Posterior) -> str:
        posteriors = np.zeros((2, len(_library()), ours.probability.shape[1]))
        for one, found in zip(posteriors, (ours, theirs), strict=True):
            one[found.samples] = found.probability
        same = np.allclose(*posteriors, atol=1e-4)
        return "" if same else "the posteriors differ"

    return Case(
        Timed(frame, lambda: copy(tracker), repeats=10),
        Timed(frame, pixel_by_pixel),
        name,
        check,
        rounds=3,
        goal=goal,
    )


@case("track a frame, 3 levels, NumPy")
def against_numpy() -> Case:
    return _against(numpy_distances, "the same nodes as images, NumPy", ">= 50")


@case("track a frame, 3 levels, dense")
def against_dense() -> Case:
    return _against(dense_distances, "the same nodes as images, compiled", ">= 10")


def main() -> None:
    """Follows the clip and prints what its frames took."""
    library, threads = _library(), set_threads()
    _follow(_tracker(), 3)
    seconds = _follow(_tracker(), _FRAMES)
    levels = " / ".join(f"{len(level):,}" for level in library.levels)
    print(f"{len(library):,} samples, {levels} nodes; {threads} threads")
    first, later = 1000 * seconds[0], 1000 * np.array(seconds[1:])
    spread = f"min {later.min():.1f}, median {np.median(later):.1f}, max {later.max():.1f}"
    print(f"ms a frame over {len(later)} frames: {spread}; the first {first:.1f}")


if __name__ == "__main__":
    main()
