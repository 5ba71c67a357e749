"""Build of a library from base poses: views from all sides, thresholds, and the tree."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.body_arrays import body_arrays
from silhouette_core.body.model import BodyModel
from silhouette_core.image.spans import Spans
from silhouette_core.monocular.making.base_poses import BasePoses
from silhouette_core.monocular.making.checkpoint import Arrays, Checkpoint
from silhouette_core.monocular.making.thresholds import first_threshold, next_threshold
from silhouette_core.monocular.occlusion import occluded_parts, usual_areas
from silhouette_core.monocular.tree.pose_library import Level, LibrarySettings, PoseLibrary
from silhouette_core.monocular.tree.rendering import (
    SIZES_PX,
    RenderedViews,
    join_spans,
    pose_surfaces,
    render_views,
    select_spans,
    silhouette_levels,
    spans_of,
)
from silhouette_core.monocular.tree.store import VERSION
from silhouette_core.monocular.tree.transitions import find_neighbours, view_orientations
from silhouette_core.monocular.tree.tree import Nodes, PoseSpace, Scorer, Split, divide
from silhouette_core.progress import Reporter, SilentReporter

_AT_ONCE = 480  # views held in memory together
_PER_STEP = 4800  # views between two checkpoints
_SAVE_EVERY = 400  # representatives of the first level between two checkpoints
_RUNS = ("rows", "starts", "ends", "offsets")


def build_library(
    bases: BasePoses,
    model: BodyModel,
    settings: LibrarySettings,
    reporter: Reporter | None = None,
    partial: Path | None = None,
) -> PoseLibrary:
    """Library of base poses seen from all sides.

    Args:
        bases: the base poses.
        model: the body.
        settings: settings of the library.
        reporter: informed of every stage.
        partial: folder for checkpoints, from which an interrupted build resumes; the caller removes
            it once the library is written.

    Returns:
        The library. The same inputs give the same library, for any number of threads, interrupted
        or not.

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
    rendered = _render_all(bases, model, views, checkpoint, reporter)
    spans = [
        Spans(*(rendered[f"level{number}.{name}"] for name in _RUNS))
        for number in range(len(SIZES_PX))
    ]
    poses = PoseSpace(bases.angles, base, view_orientations(bases.quaternion[base], views[view]))
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
    library = PoseLibrary(
        model=model,
        settings=settings,
        base_angles=bases.angles,
        base_quaternion=bases.quaternion,
        base_height_m=rendered["heights"],
        base_source=bases.source,
        base_mirrored=bases.mirrored,
        clips=bases.clips,
        views=views,
        sample_base=base,
        sample_view=view,
        pelvis_px=rendered["pelvis_px"],
        areas=rendered["areas"],
        occluded=occluded_parts(rendered["areas"], usual_areas(rendered["areas"])),
        cut=rendered["cut"] > 0,
        levels=levels,
        leaf_offsets=nodes[-1].offsets,
        leaf_samples=nodes[-1].members,
        sigma_rad=bases.sigma_rad,
        root_sigma_rad=bases.root_sigma_rad,
        bounds_px=spans[-1].bounds,
    )
    return replace(
        library,
        neighbours=checkpoint.step(
            "neighbours", lambda: find_neighbours(library, reporter=reporter)
        ),
    )


def _measures(model: BodyModel) -> object:
    """What describes a body beside its arrays."""
    return body_arrays(model)[1] if model.person is None else asdict(model.person)


def _digest(bases: BasePoses, model: BodyModel, settings: LibrarySettings) -> str:
    """Digest of everything that determines the result."""
    digest = hashlib.sha256(
        json.dumps([VERSION, asdict(settings), _measures(model), bases.root_sigma_rad]).encode()
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


def _render_all(
    bases: BasePoses,
    model: BodyModel,
    views: NDArray[np.float64],
    checkpoint: Checkpoint,
    reporter: Reporter,
) -> dict[str, NDArray]:
    """Arrays of all samples: silhouettes at every level, areas, pelvis_px and cut, and the heights
    of the base poses.
    """
    per_step = max(1, _PER_STEP // len(views))
    starts = range(0, len(bases.angles), per_step)
    reporter.stage("taking pictures", len(bases.angles) * len(views))
    parts: list[Arrays] = []
    for number, start in enumerate(starts):
        which = slice(start, min(start + per_step, len(bases.angles)))
        parts.append(
            checkpoint.step(
                f"pictures{number}", lambda which=which: _render_some(bases, model, views, which)
            )
        )
        reporter.advance((which.stop - which.start) * len(views))
    joined = {
        name: np.concatenate([part[name] for part in parts])
        for name in ("areas", "pelvis_px", "cut", "heights")
    }
    for number in range(len(SIZES_PX)):
        runs = join_spans(
            [Spans(*(part[f"level{number}.{name}"] for name in _RUNS)) for part in parts]
        )
        joined |= {f"level{number}.{name}": getattr(runs, name) for name in _RUNS}
    return joined


def _render_some(
    bases: BasePoses, model: BodyModel, views: NDArray[np.float64], which: slice
) -> Arrays:
    """Arrays of some of the base poses, from all views, see `_render_all`."""
    surfaces, heights = pose_surfaces(model, bases.quaternion[which], bases.angles[which])
    rendered: list[RenderedViews] = []
    runs: list[list[Spans]] = [[] for _ in SIZES_PX]
    at_once = max(1, _AT_ONCE // len(views))
    for start in range(0, len(surfaces), at_once):
        block = surfaces[start : start + at_once]
        base = np.repeat(np.arange(len(block)), len(views))
        seen = render_views(model, block, base, np.tile(views, (len(block), 1)))
        for kept, masks in zip(runs, silhouette_levels(seen.windows > 0), strict=True):
            kept.append(spans_of(masks))
        rendered.append(seen)
    arrays = {
        name: np.concatenate([getattr(seen, name) for seen in rendered])
        for name in ("areas", "pelvis_px", "cut")
    }
    for number, parts in enumerate(runs):
        joined = join_spans(parts)
        arrays |= {f"level{number}.{name}": getattr(joined, name) for name in _RUNS}
    return arrays | {"heights": heights.astype(np.float32)}


def _tree(
    count: int,
    spans: list[Spans],
    poses: PoseSpace,
    settings: LibrarySettings,
    checkpoint: Checkpoint,
    reporter: Reporter,
) -> tuple[list[Nodes], list[float]]:
    """Nodes and thresholds of all levels."""
    sets = [np.arange(count, dtype=np.int64)]
    nodes: list[Nodes] = []
    thresholds: list[float] = []
    for number, (runs, size) in enumerate(zip(spans, SIZES_PX, strict=True)):
        score = Scorer(runs, size)
        finished = checkpoint.load(f"tree{number}")
        if finished is None:
            target = round(settings.node_shares[number] * count)
            chosen = checkpoint.load(f"threshold{number}")
            if settings.thresholds is not None:
                threshold = settings.thresholds[number]
            elif chosen is not None:
                threshold = float(chosen["threshold"][0])
            elif number == 0:
                threshold = first_threshold(count, target, poses, score, reporter)
            else:
                threshold = next_threshold(sets, target, poses, score)
            checkpoint.save(f"threshold{number}", {"threshold": np.array([threshold])})
            if number == 0:
                groups = [_first_level(count, poses, score, threshold, checkpoint, reporter)]
            else:
                reporter.stage(f"tree, level {number + 1}", len(sets))
                groups = divide(sets, poses, score, threshold, reporter)
            level = Nodes.from_groups(groups, poses)
            finished = {
                name: getattr(level, name)
                for name in ("representative", "parent", "offsets", "members")
            }
            finished["threshold"] = np.array([threshold])
            checkpoint.save(f"tree{number}", finished)
        thresholds.append(float(finished.pop("threshold")[0]))
        nodes.append(Nodes(**finished))
        sets = nodes[-1].sets()
    return nodes, thresholds


def _first_level(
    count: int,
    poses: PoseSpace,
    score: Scorer,
    threshold: float,
    checkpoint: Checkpoint,
    reporter: Reporter,
) -> list[NDArray[np.int64]]:
    """Samples of the nodes of the first level, with checkpoints."""
    reporter.stage("tree, level 1")
    samples = np.arange(count, dtype=np.int64)
    saved = checkpoint.load("split")
    if saved is None:
        split = Split.start(samples, poses)
    else:
        split = Split(
            samples,
            saved["chosen"].tolist(),
            saved["total"],
            saved["nearest"],
            saved["nearest_node"],
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
