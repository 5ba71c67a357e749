"""One frame of the paper's filter, silhouette to posterior, against the same search pixel by pixel:
`python -m benchmarks.filter`.

As a program it follows a whole clip and prints what a frame takes, as Okada and Stenger's Fig. 6
(d) does. As cases of `make bench` one
frame is searched in runs, in images with NumPy, and in images with numba: the same windows, scales,
shifts and nodes, in one run. Without a library in $VOXELPOSE_LIBRARY one of 60,000 samples is made
from the program's own motions, once, in out/.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
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
from silhouette_core.image.distance import Weighting
from silhouette_core.image.raster import render_parts
from silhouette_core.image.spans import Spans
from silhouette_core.jit import set_threads
from silhouette_core.monocular.making.from_motion import make_library
from silhouette_core.monocular.person import find_person
from silhouette_core.monocular.silhouette_weights import relative_weights
from silhouette_core.monocular.tree.evidence import SHIFTS_PX, Alignment, Evidence
from silhouette_core.monocular.tree.forward import FilterFrame, ForwardFilter
from silhouette_core.monocular.tree.pose_library import LibrarySettings
from silhouette_core.monocular.tree.rendering import STATURE_PX, masks_of
from silhouette_core.monocular.tree.store import read_library
from silhouette_core.monocular.tree.transitions import transitions
from silhouette_core.monocular.tree.tree_filter import Posterior, TreeFilter
from silhouette_core.monocular.window import look_at
from silhouette_core.motion import kinematics
from silhouette_core.motion.keyposes import keypose_motions
from silhouette_core.scoring.cpu import CpuBackend

_MADE = Path(__file__).resolve().parents[1] / "out" / "benchmarks" / "filter.vplib"
_SETTINGS = LibrarySettings(poses=60_000)
_FRAMES = 60
_MOVEMENT, _SHAPE_SEED, _STATURE_M = "walk", 5, 1.75
_WEIGHTING: Weighting = "balanced"

Score = Callable[[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.float32]], NDArray[np.float64]]


def numpy_distances(
    mask: NDArray[np.bool_], silhouettes: NDArray[np.bool_], weights: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Does what `dense_distances` does, as eq. (7) is written."""
    return np.array([weights[mask ^ one].sum(dtype=np.float64) for one in silhouettes]) / mask.size


class DenseEvidence(Evidence):
    """The same evidence, weighed pixel by pixel; the nodes' images are drawn outside of the time.

    Args:
        evidence: whose windows are taken.
        score: of many images.
        drawn: nodes' images, by the level's reduction and their number; what is missing is drawn
            and kept.
    """

    def __init__(
        self, evidence: Evidence, score: Score, drawn: dict[tuple[int, int], NDArray[np.bool_]]
    ):
        super().__init__(evidence.windows, CpuBackend(), evidence.weighting)
        self.score, self.drawn = score, drawn

    def _images(
        self, spans: Spans, nodes: NDArray[np.integer], reduction: int
    ) -> NDArray[np.bool_]:
        if (reduction, len(nodes)) not in self.drawn:
            size = self.windows[0].mask.shape
            self.drawn[reduction, len(nodes)] = masks_of(
                spans, nodes, (size[1] // reduction, size[0] // reduction)
            )
        return self.drawn[reduction, len(nodes)]

    def distances(
        self,
        spans: Spans,
        nodes: NDArray[np.integer],
        reduction: int,
        shifts_px: NDArray[np.integer] = SHIFTS_PX,
    ) -> Alignment:
        images, result = self._images(spans, nodes, reduction), []
        for window in self.windows:
            picture, weights = relative_weights(window, self.weighting, reduction)
            height, width = picture.shape
            wide, margins = np.pad(picture, 1), np.pad(weights, 1, mode="edge").astype(np.float32)
            for dx, dy in shifts_px:
                part = slice(1 + dy, 1 + dy + height), slice(1 + dx, 1 + dx + width)
                own = np.ascontiguousarray(wide[part])
                outside = float(margins[wide].sum() - margins[part][own].sum())
                result.append(
                    self.score(own, images, np.ascontiguousarray(margins[part])) * picture.size
                    + outside
                )
        flat = np.stack(result)
        best = flat.argmin(axis=0)
        scale, move = np.divmod(best, len(shifts_px))
        return Alignment(flat[best, np.arange(len(nodes))], scale, shifts_px[move] * reduction)


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
def _tree() -> TreeFilter:
    library = read_library(library_file())
    return TreeFilter(library, transitions(library, occlusion_aware=True), CpuBackend())


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


@cache
def _follow(tree: TreeFilter, count: int) -> tuple[list[FilterFrame], list[float]]:
    """Filters the clip's first frames; returns what is believed and the seconds that each took."""
    camera, masks = clip()
    forward, beliefs, seconds = ForwardFilter(tree, camera, weighting=_WEIGHTING), [], []
    for number, mask in enumerate(masks[:count]):
        person = find_person(mask)
        if person is None:
            raise RuntimeError(f"frame {number} shows nobody")
        started = time.perf_counter()
        beliefs.append(forward.step(number / 30, person.mask))
        seconds.append(time.perf_counter() - started)
    return beliefs, seconds


def _against(score: Score, name: str, goal: str) -> Case:
    tree, (camera, masks) = _tree(), clip()
    beliefs, _ = _follow(tree, _FRAMES)
    by_work = (
        np.argsort([sum(belief.posterior.scored) for belief in beliefs[1:]], kind="stable") + 1
    )
    chosen = int(
        by_work[len(by_work) // 2]
    )  # the frame for which as many nodes are scored as for the median one
    before, belief = beliefs[chosen - 1 : chosen + 1]
    metre_px = STATURE_PX / tree.library.model.sizes.stature_m
    drawn: dict[tuple[int, int], NDArray[np.bool_]] = {}

    def frame(dense: bool) -> Posterior:
        windows = [
            look_at(camera, masks[chosen], window.distance_m, metre_px) for window in belief.windows
        ]
        evidence = Evidence(windows, CpuBackend(), _WEIGHTING)
        return tree.update(
            tree.predict(before.posterior),
            DenseEvidence(evidence, score, drawn) if dense else evidence,
        )

    def check(ours: Posterior, theirs: Posterior) -> str:
        same = ours.scored == theirs.scored and np.allclose(
            ours.distance, theirs.distance, atol=1e-6
        )
        return (
            ""
            if same
            else f"other nodes were scored or other distances found: {ours.scored}, {theirs.scored}"
        )

    return Case(
        Timed(lambda _: frame(False), repeats=10),
        Timed(lambda _: frame(True)),
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
    tree = _tree()
    threads = set_threads()
    _follow(tree, 3)
    beliefs, seconds = _follow(tree, _FRAMES)
    levels = " / ".join(f"{len(level):,}" for level in tree.library.levels)
    scored = " / ".join(
        f"{n:,.0f}" for n in np.median([belief.posterior.scored for belief in beliefs], axis=0)
    )
    print(
        f"{len(tree.library):,} samples, {levels} nodes, of which {scored} were scored (median);"
        f" {threads} threads"
    )
    first, later = 1000 * seconds[0], 1000 * np.array(seconds[1:])
    spread = f"min {later.min():.1f}, median {np.median(later):.1f}, max {later.max():.1f}"
    print(f"ms a frame over {len(later)} frames: {spread}; the first {first:.1f}")


if __name__ == "__main__":
    main()
