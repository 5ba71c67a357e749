"""Search of large libraries: `python -m benchmarks.large_library [--make] [57k] [250k] [1m]`.

A library with a tree for every view is searched frame by frame in clips of recorded motion, from
any side, by somebody else's body. Printed for each size: milliseconds a frame, of the search alone
(median), which share of the best hundred samples of the exhaustive search it finds, under the prior
of the tracked frame and under an even prior (mean), and the memory.

Libraries are made of the shared motion ($VOXELPOSE_SHARED/data/mocap, by default ../shared), only
if --make is given: 57k takes a minute of one core, 250k four, 1m a quarter of an hour, a
tenth of that with ten cores (`--workers N`). They stay in out/benchmarks, and an interrupted build
goes on where it stopped. Sizes that are made become cases of `make bench`.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.cases import Case, Timed, case
from benchmarks.scene import ring
from calib.camera import Camera
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import SHAPE_SIGMA, BodySizes
from silhouette_core.image.raster import render_parts
from silhouette_core.jit import set_threads
from silhouette_core.monocular.making.from_motion import make_library, read_clips
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.tree.evidence import Evidence
from silhouette_core.monocular.tree.forward import ForwardFilter
from silhouette_core.monocular.tree.pose_library import LibrarySettings, PoseLibrary
from silhouette_core.monocular.tree.store import read_library
from silhouette_core.monocular.tree.transitions import NeighbourWeights
from silhouette_core.monocular.tree.tree_filter import SIGMA_SCALE, FilterSettings, Posterior
from silhouette_core.monocular.tree.view_tree_filter import SparsePrior, ViewTreeFilter
from silhouette_core.motion import kinematics
from silhouette_core.motion.mocap.load import motion_files
from silhouette_core.workers import open_workers

_ROOT = Path(__file__).resolve().parents[1]
_FOLDER = _ROOT / "out" / "benchmarks"
_MOCAP = Path(os.environ.get("VOXELPOSE_SHARED", _ROOT.parent / "shared")) / "data" / "mocap"
_STATURE_M, _SHAPE_SEED = 1.75, 5
_CLIPS, _FRAMES, _BEST = 6, 5, 100
_KEEP_ALL = FilterSettings(survivors=0.0, most=10**9)  # that the improbable count as found, too
SIZES = {
    "57k": LibrarySettings(poses=57_136, tree="views", proposal=False),
    "250k": LibrarySettings(poses=250_000, tree="views", proposal=False),
    # All that 5 degrees leave of the shared motion, 28,790 poses, from every 10 degrees.
    "1m": LibrarySettings(poses=1_200_000, yaw_step_deg=10, tree="views", proposal=False),
}


def library_file(size: str) -> Path:
    """Where the library of a size is, or will be."""
    return _FOLDER / f"views-{size}.vplib"


def make(size: str, workers: int) -> None:
    """Makes the library of a size, if it is not there."""
    if not library_file(size).exists():
        _FOLDER.mkdir(parents=True, exist_ok=True)
        model = BodyModel.from_sizes(BodySizes(_STATURE_M))
        with open_workers(workers) as pool:
            clips = read_clips([_MOCAP], model)
            make_library(clips, model, library_file(size), SIZES[size], workers=pool)


@cache
def films() -> tuple[Camera, list[list[NDArray[np.bool_]]]]:
    """A camera, and the silhouettes that it sees of somebody else's body in some clips."""
    camera, rng = ring(1).cameras[0], np.random.default_rng(0)
    shape = 0.7 * SHAPE_SIGMA * np.random.default_rng(_SHAPE_SEED).standard_normal(len(SHAPE_SIGMA))
    model = BodyModel.from_sizes(BodySizes(_STATURE_M)).reshaped(shape)
    files = motion_files([_MOCAP])
    chosen = [files[number] for number in rng.permutation(len(files))[:_CLIPS]]
    result = []
    for motion in read_clips(chosen, model).values():
        first, yaw = int(rng.integers(len(motion) - _FRAMES)), rng.uniform(0, 2 * np.pi)
        rows = slice(first, first + _FRAMES)
        turn = np.array(
            [[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1.0]]
        )
        root = motion.root_m[rows] - [*motion.root_m[first, :2], 0.0]
        placed = kinematics.forward(
            model, root, motion.root_quaternion[rows], motion.angles_rad[rows]
        )
        masks = []
        for rotation, origin in zip(*placed, strict=True):
            surface = kinematics.skin(model, rotation, origin) @ turn.T
            seen = surface @ camera.rotation.T + camera.translation
            parts, _ = render_parts(seen, model.faces, model.face_part, camera.matrix, camera.size)
            masks.append(parts > 0)
        result.append(masks)
    return camera, result


class Watched(ViewTreeFilter):
    """Remembers what each frame was searched with and what was found.

    Attributes:
        searches: prior, evidence, posterior and seconds of every frame.
    """

    searches: list[tuple[SparsePrior | NDArray[np.float64], Evidence, Posterior, float]]

    def update(self, prior: SparsePrior | NDArray[np.float64], evidence: Evidence) -> Posterior:
        started = time.perf_counter()
        posterior = super().update(prior, evidence)
        seconds = time.perf_counter() - started
        self.searches.append((prior, evidence, posterior, seconds))
        return posterior


def follow(library: PoseLibrary, settings: FilterSettings | None = None) -> Watched:
    """Filters the films; the first frame of each has an even prior over poses and headings."""
    watched = Watched(library, NeighbourWeights(library, True, SIGMA_SCALE), settings)
    watched.searches = []
    camera, clips = films()
    for masks in clips:
        forward = ForwardFilter(watched, camera, facing=False)
        for number, mask in enumerate(masks):
            forward.step(number, number / 30, Person(mask, False))
    return watched


def exhaustive(
    tree: ViewTreeFilter, prior: SparsePrior | NDArray[np.float64], evidence: Evidence
) -> NDArray[np.int64]:
    """The best hundred of all samples by their posterior."""
    library, leaves = tree.library, tree.library.levels[-1]
    of_samples = tree.prior_of(prior, np.asarray(library.leaf_samples, np.int64))
    distance = evidence.distances(leaves.spans, np.arange(len(leaves)), 2).distance
    with np.errstate(divide="ignore"):
        score = -0.5 * (distance / tree.settings.sigma) ** 2 + np.log(of_samples)
    return library.leaf_samples[np.argpartition(-score, _BEST)[:_BEST]].astype(np.int64)


def recall(tree: Watched) -> tuple[float, float]:
    """Share of the best hundred found, of tracked frames and under an even prior."""
    shares: tuple[list[float], list[float]] = [], []
    for prior, evidence, posterior, _ in tree.searches:
        best = exhaustive(tree, prior, evidence)
        found = float(np.isin(best, posterior.samples).mean())
        shares[isinstance(prior, np.ndarray)].append(found)
    return float(np.mean(shares[0])), float(np.mean(shares[1]))


@cache
def _tracked(size: str) -> tuple[ViewTreeFilter, SparsePrior, Evidence]:
    """A filter, and the median tracked frame, by its time."""
    watched = follow(read_library(library_file(size)))
    later = [one for one in watched.searches if isinstance(one[0], SparsePrior)]
    prior, evidence, _, _ = sorted(later, key=lambda one: one[3])[len(later) // 2]
    assert isinstance(prior, SparsePrior)
    return watched, prior, evidence


def _search(size: str, exhaustively: bool = False) -> Timed:
    """Search of a frame, from its windows: what is prepared for a frame counts."""
    tree, prior, seen = _tracked(size)

    def evidence() -> Evidence:
        weighed = seen.weighting, seen.backend, seen.bounds_px, seen.drawn_small
        return Evidence(seen.windows, *weighed)

    if exhaustively:
        return Timed(lambda given: exhaustive(tree, prior, given), evidence)
    return Timed(lambda given: ViewTreeFilter.update(tree, prior, given), evidence, repeats=10)


def _register(size: str) -> None:
    """Cases of a library that is there."""

    @case(f"search by views, {size}")
    def against_exhaustive() -> Case:
        return Case(_search(size), _search(size, True), "all samples compared", rounds=2)

    if size != "57k":

        @case(f"search by views, {size} and 57k")
        def against_small() -> Case:
            goal = "<= 2" if size == "1m" else ""
            return Case(_search(size), _search("57k"), "the search of 57k", goal=goal, longer=True)


for _size in SIZES:
    if library_file(_size).exists() and library_file("57k").exists():
        _register(_size)


def main(words: list[str]) -> None:
    """Prints a line for every size; each is measured in a process of its own."""
    workers = int(words[words.index("--workers") + 1]) if "--workers" in words else 1
    sizes = [word for word in words if word in SIZES] or list(SIZES)
    if len(sizes) > 1:
        for size in sizes:
            own = [word for word in words if word not in SIZES]
            command = [sys.executable, "-m", "benchmarks.large_library", size, *own]
            subprocess.run(command, check=True)
        return
    (size,) = sizes
    if "--make" in words:
        make(size, workers)
    if not library_file(size).exists():
        print(f"{size}: not made; give --make")
        return
    threads, library = set_threads(), read_library(library_file(size))
    follow(library)  # compiles
    seconds: tuple[list[float], list[float]] = [], []
    scored = []
    for prior, _, posterior, taken in follow(library).searches:
        seconds[isinstance(prior, np.ndarray)].append(taken)
        scored.append(posterior.scored)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    found = recall(follow(library, _KEEP_ALL))
    nodes = " / ".join(f"{count:,.0f}" for count in np.median(scored, axis=0))
    tracked, first = (1000 * np.median(part) for part in seconds)
    print(
        f"{len(library):,} samples ({library_file(size).stat().st_size / 1e6:,.0f} MB):"
        f" {tracked:.1f} ms a tracked frame, {first:.1f} ms a first one; {nodes} nodes looked at"
        f" (median); of the best {_BEST}, {found[0]:.2%} found when tracking, {found[1]:.2%} under"
        f" an even prior; at most {peak:,.0f} MiB resident; {threads} threads",
        flush=True,
    )


if __name__ == "__main__":
    main(sys.argv[1:])
