"""From base poses to a library: pictures from all sides, thresholds, three levels."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.image.spans import Spans
from silhouette_core.library.base_poses import BasePoses
from silhouette_core.library.checkpoint import Arrays, Checkpoint
from silhouette_core.library.pose_library import Level, LibrarySettings, PoseLibrary
from silhouette_core.library.rendering import (
    SIZES_PX,
    Pictures,
    join_spans,
    pose_surfaces,
    select_spans,
    silhouette_levels,
    spans_of,
    take_pictures,
)
from silhouette_core.library.store import VERSION
from silhouette_core.library.thresholds import first_threshold, next_threshold
from silhouette_core.library.transitions import find_neighbours, turned_orientations
from silhouette_core.library.tree import Nodes, Poses, Scorer, Split, divide
from silhouette_core.progress import Reporter, SilentReporter

OCCLUDED_SHARE = 0.15
"""T_A of eq. (3): a part is hidden where it shows less than this share of its usual largest area
(the 99th percentile over the library).
"""
_AT_ONCE = 480  # pictures held in memory together
_PER_STEP = 4800  # pictures between two savings
_SAVE_EVERY = 400  # representatives of the first level between two savings
_RUNS = ("rows", "starts", "ends", "offsets")


def build_library(
    bases: BasePoses,
    model: BodyModel,
    settings: LibrarySettings,
    reporter: Reporter | None = None,
    partial: Path | None = None,
) -> PoseLibrary:
    """Makes a library.

    Args: bases: the poses. model: the body. settings: see LibrarySettings. reporter: told of every
        stage. partial: folder for half-done work, which is gone on with if it is there; the caller
        removes it once the library is written.

    Returns: The library. The same inputs give the same library, for any number of threads,
        interrupted or not.

    Raises:
        InputError: `partial` cannot be written.

    Source: Okada and Stenger, sections 3 and 7.
    """
    reporter = reporter or SilentReporter()
    checkpoint = Checkpoint(partial, _digest(bases, model, settings))
    views = settings.views()
    count = len(bases.angles) * len(views)
    base = np.repeat(np.arange(len(bases.angles), dtype=np.int32), len(views))
    view = np.tile(np.arange(len(views), dtype=np.int16), len(bases.angles))
    taken = _all_pictures(bases, model, views, checkpoint, reporter)
    spans = [
        Spans(*(taken[f"level{number}.{name}"] for name in _RUNS))
        for number in range(len(SIZES_PX))
    ]
    poses = Poses(bases.angles, base, turned_orientations(bases.quaternion[base], views[view]))
    nodes, thresholds = _tree(count, spans, poses, settings, checkpoint, reporter)
    levels = tuple(
        Level(
            level.representative,
            level.parent,
            select_spans(runs, level.representative),
            size,
            threshold,
        )
        for level, runs, size, threshold in zip(nodes, spans, SIZES_PX, thresholds, strict=True)
    )
    usual = np.percentile(taken["areas"], 99, axis=0)
    made = PoseLibrary(
        model=model,
        settings=settings,
        base_angles=bases.angles,
        base_quaternion=bases.quaternion,
        base_height_m=taken["heights"],
        base_source=bases.source,
        base_mirrored=bases.mirrored,
        clips=bases.clips,
        views=views,
        sample_base=base,
        sample_view=view,
        pelvis_px=taken["pelvis_px"],
        areas=taken["areas"],
        occluded=taken["areas"] < OCCLUDED_SHARE * usual,
        cut=taken["cut"] > 0,
        levels=levels,
        leaf_offsets=nodes[-1].offsets,
        leaf_samples=nodes[-1].members,
        sigma_rad=bases.sigma_rad,
        root_sigma_rad=bases.root_sigma_rad,
    )
    return replace(
        made,
        neighbours=checkpoint.step("neighbours", lambda: find_neighbours(made, reporter=reporter)),
    )


def _digest(bases: BasePoses, model: BodyModel, settings: LibrarySettings) -> str:
    """Names all that decides the result."""
    digest = hashlib.sha256(
        json.dumps([VERSION, asdict(settings), asdict(model.sizes), bases.root_sigma_rad]).encode()
    )
    for array in (
        bases.angles,
        bases.quaternion,
        bases.source,
        bases.mirrored,
        bases.sigma_rad,
        model.vertices_m,
        model.joints_m,
    ):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _all_pictures(
    bases: BasePoses,
    model: BodyModel,
    views: NDArray[np.float64],
    checkpoint: Checkpoint,
    reporter: Reporter,
) -> dict[str, NDArray]:
    """Takes all samples' pictures; returns their runs at every level, areas, pelvis_px, cut, and
    the heights of the base poses.
    """
    per_step = max(1, _PER_STEP // len(views))
    starts = range(0, len(bases.angles), per_step)
    reporter.stage("taking pictures", len(bases.angles) * len(views))
    found: list[Arrays] = []
    for number, start in enumerate(starts):
        which = slice(start, min(start + per_step, len(bases.angles)))
        found.append(
            checkpoint.step(
                f"pictures{number}", lambda which=which: _some_pictures(bases, model, views, which)
            )
        )
        reporter.advance((which.stop - which.start) * len(views))
    joined = {
        name: np.concatenate([part[name] for part in found])
        for name in ("areas", "pelvis_px", "cut", "heights")
    }
    for number in range(len(SIZES_PX)):
        runs = join_spans(
            [Spans(*(part[f"level{number}.{name}"] for name in _RUNS)) for part in found]
        )
        joined |= {f"level{number}.{name}": getattr(runs, name) for name in _RUNS}
    return joined


def _some_pictures(
    bases: BasePoses, model: BodyModel, views: NDArray[np.float64], which: slice
) -> Arrays:
    """Takes the pictures of some of the base poses, from all views."""
    surfaces, heights = pose_surfaces(model, bases.quaternion[which], bases.angles[which])
    taken: list[Pictures] = []
    runs: list[list[Spans]] = [[] for _ in SIZES_PX]
    at_once = max(1, _AT_ONCE // len(views))
    for start in range(0, len(surfaces), at_once):
        some = surfaces[start : start + at_once]
        base = np.repeat(np.arange(len(some)), len(views))
        pictures = take_pictures(model, some, base, np.tile(views, (len(some), 1)))
        for kept, masks in zip(runs, silhouette_levels(pictures.windows > 0), strict=True):
            kept.append(spans_of(masks))
        taken.append(pictures)
    arrays = {
        name: np.concatenate([getattr(pictures, name) for pictures in taken])
        for name in ("areas", "pelvis_px", "cut")
    }
    for number, parts in enumerate(runs):
        joined = join_spans(parts)
        arrays |= {f"level{number}.{name}": getattr(joined, name) for name in _RUNS}
    return arrays | {"heights": heights.astype(np.float32)}


def _tree(
    count: int,
    spans: list[Spans],
    poses: Poses,
    settings: LibrarySettings,
    checkpoint: Checkpoint,
    reporter: Reporter,
) -> tuple[list[Nodes], list[float]]:
    """Divides the whole library level by level."""
    sets = [np.arange(count, dtype=np.int64)]
    nodes: list[Nodes] = []
    thresholds: list[float] = []
    for number, (runs, size) in enumerate(zip(spans, SIZES_PX, strict=True)):
        score = Scorer(runs, size, settings.weighting)
        done = checkpoint.load(f"tree{number}")
        if done is None:
            wanted = round(settings.node_shares[number] * count)
            known = checkpoint.load(f"threshold{number}")
            if settings.thresholds is not None:
                threshold = settings.thresholds[number]
            elif known is not None:
                threshold = float(known["threshold"][0])
            elif number == 0:
                threshold = first_threshold(count, wanted, poses, score, reporter)
            else:
                threshold = next_threshold(sets, wanted, poses, score)
            checkpoint.save(f"threshold{number}", {"threshold": np.array([threshold])})
            if number == 0:
                groups = [_first_level(count, poses, score, threshold, checkpoint, reporter)]
            else:
                reporter.stage(f"tree, level {number + 1}", len(sets))
                groups = divide(sets, poses, score, threshold, reporter)
            level = Nodes.of(groups, poses)
            done = {
                name: getattr(level, name)
                for name in ("representative", "parent", "offsets", "members")
            }
            done["threshold"] = np.array([threshold])
            checkpoint.save(f"tree{number}", done)
        thresholds.append(float(done.pop("threshold")[0]))
        nodes.append(Nodes(**done))
        sets = nodes[-1].sets()
    return nodes, thresholds


def _first_level(
    count: int,
    poses: Poses,
    score: Scorer,
    threshold: float,
    checkpoint: Checkpoint,
    reporter: Reporter,
) -> list[NDArray[np.int64]]:
    """Divides the whole library, keeping the state now and then."""
    reporter.stage("tree, level 1")
    samples = np.arange(count, dtype=np.int64)
    kept = checkpoint.load("split")
    if kept is None:
        split = Split.start(samples, poses)
    else:
        split = Split(
            samples, kept["chosen"].tolist(), kept["total"], kept["nearest"], kept["nearest_node"]
        )
        reporter.advance(len(split.chosen) - 1)

    def after(split: Split) -> None:
        reporter.advance()
        if len(split.chosen) % _SAVE_EVERY == 0:
            checkpoint.save(
                "split",
                {
                    "chosen": np.array(split.chosen, np.int64),
                    "total": split.total,
                    "nearest": split.nearest,
                    "nearest_node": split.nearest_node,
                },
            )

    split.run(score, threshold, after, threads=True)
    return split.groups()
