"""Build of a large library: every view is a task of its own, for as many workers as there are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.image.spans import Rectangle, Spans
from silhouette_core.monocular.making.base_poses import BasePoses
from silhouette_core.monocular.making.checkpoint import Arrays, Checkpoint
from silhouette_core.monocular.occlusion import occluded_parts, usual_areas
from silhouette_core.monocular.tree.pose_library import Level, LibrarySettings, PoseLibrary
from silhouette_core.monocular.tree.rendering import (
    WINDOW_PX,
    halve_silhouette,
    join_spans,
    pose_surfaces,
    render_views,
    select_spans,
    spans_of,
)
from silhouette_core.monocular.tree.view_neighbours import neighbour_tasks, view_neighbours
from silhouette_core.monocular.tree.view_tree import divide_view
from silhouette_core.progress import Reporter
from silhouette_core.workers import OwnProcess, Workers

_REDUCTION = 2  # of the finest silhouettes: 160 x 120
_FINE_PX = WINDOW_PX[0] // 2, WINDOW_PX[1] // 2
_COARSE_PX = WINDOW_PX[0] // 4, WINDOW_PX[1] // 4
_AT_ONCE = 480  # poses drawn together
_NEIGHBOUR_BLOCKS = 32
_RUNS = ("rows", "starts", "ends", "offsets")


@dataclass(frozen=True, eq=False)
class ViewTask:
    """One view of all base poses.

    Attributes:
        model: the body.
        angles: (B, D) float32, joint angles, radians.
        quaternion: (B, 4) float32, orientations of the pelvis, heading removed.
        view: (2,) float64, yaw and pitch, radians.
    """

    model: BodyModel
    angles: NDArray[np.float32]
    quaternion: NDArray[np.float32]
    view: NDArray[np.float64]


def build_view(task: ViewTask) -> dict[str, NDArray]:
    """Silhouettes and nodes of one view, see `view_tree.divide_view`.

    Args:
        task: the view of B base poses.

    Returns:
        order (B,) int32, base poses in the order of the leaves; first (K,), second (L,) and parent
        (L,) int32, offsets (L + 1,) int64 and radius (2,) float64, as in `ViewNodes`; level0,
        level1 and level2 with `.rows`, `.starts`, `.ends` uint8 and `.offsets` int64, silhouettes
        of the nodes and of the base poses in the order of the leaves; areas (B, 27) uint16,
        pelvis_px (B, 2) float32, cut (B,) bool and heights (B,) float32, m, by base pose.
    """
    fine, coarse, facts = [], [], {"areas": [], "pelvis_px": [], "cut": [], "heights": []}
    for start in range(0, len(task.angles), _AT_ONCE):
        some = slice(start, start + _AT_ONCE)
        surfaces, heights = pose_surfaces(task.model, task.quaternion[some], task.angles[some])
        count = len(surfaces)
        views = np.tile(task.view, (count, 1))
        seen = render_views(task.model, surfaces, np.arange(count), views, _REDUCTION)
        masks = seen.windows > 0
        fine.append(_narrow(spans_of(masks)))
        coarse.append(_narrow(spans_of(halve_silhouette(masks))))
        facts["areas"].append(seen.areas)
        facts["pelvis_px"].append(seen.pelvis_px)
        facts["cut"].append(seen.cut > 0)
        facts["heights"].append(heights.astype(np.float32))
    large, small = join_spans(fine), join_spans(coarse)
    nodes = divide_view(small, _COARSE_PX)
    result = {name: np.concatenate(parts) for name, parts in facts.items()}
    for name in ("order", "first", "second", "parent", "offsets"):
        result[name] = getattr(nodes, name)
    result["radius"] = np.array(nodes.radius)
    levels = ((small, nodes.first), (small, nodes.second), (large, nodes.order))
    for number, (spans, chosen) in enumerate(levels):
        selected = select_spans(spans, chosen)
        result |= {f"level{number}.{name}": getattr(selected, name) for name in _RUNS}
    return result


def build_views(
    bases: BasePoses,
    model: BodyModel,
    settings: LibrarySettings,
    checkpoint: Checkpoint,
    reporter: Reporter,
    workers: Workers | None = None,
) -> PoseLibrary:
    """Library with a tree for every view, whose leaves are searched at 160 x 120.

    Args:
        bases: B base poses.
        model: the body.
        settings: settings of the library.
        checkpoint: keeps every finished view.
        reporter: informed of every stage.
        workers: who carries out the tasks; None: this process.

    Returns:
        The library, the same whoever built it. Every sample has a silhouette of its own.
    """
    workers = workers or OwnProcess()
    views = settings.views()
    tasks = [ViewTask(model, bases.angles, bases.quaternion, view) for view in views]
    reporter.stage("views", len(views))
    parts = _finished("view", build_view, tasks, checkpoint, reporter, workers)
    library = _joined(parts, bases, model, settings, views)
    shared: dict[str, Any] = {
        "angles": bases.angles,
        "quaternion": bases.quaternion,
        "views": views,
        "dof_part": model.dof_part,
        "sigma_rad": bases.sigma_rad,
        "root_sigma_rad": bases.root_sigma_rad,
    }
    rows = neighbour_tasks(len(bases.angles), _NEIGHBOUR_BLOCKS, library.occluded, **shared)
    reporter.stage("motion models", len(rows))
    found = _finished("neighbours", view_neighbours, rows, checkpoint, reporter, workers)
    neighbours = {name: np.concatenate([one[name] for one in found]) for name in found[0]}
    return replace(library, neighbours=neighbours)


def _finished(
    name: str,
    work: Callable[[Any], dict[str, NDArray]],
    tasks: Sequence[Any],
    checkpoint: Checkpoint,
    reporter: Reporter,
    workers: Workers,
) -> list[Arrays]:
    """Results of all tasks; those of an interrupted build are read."""
    results: list[Arrays | None] = [checkpoint.load(f"{name}{k}") for k in range(len(tasks))]
    missing = [k for k, result in enumerate(results) if result is None]
    reporter.advance(len(tasks) - len(missing))
    for number, result in workers.run(work, [tasks[k] for k in missing]):
        checkpoint.save(f"{name}{missing[number]}", result)
        results[missing[number]] = result
        reporter.advance()
    return [result for result in results if result is not None]


def _joined(
    parts: Sequence[Arrays],
    bases: BasePoses,
    model: BodyModel,
    settings: LibrarySettings,
    views: NDArray[np.float64],
) -> PoseLibrary:
    """Library of the views, without neighbours."""
    count, across = len(bases.angles), len(views)
    samples = np.concatenate([part["order"] * across + v for v, part in enumerate(parts)])
    firsts = np.cumsum([0] + [len(part["first"]) for part in parts])
    seconds = [np.diff(part["offsets"]) for part in parts]
    per_leaf = np.concatenate(seconds)
    representatives = [
        np.concatenate([part[name] * across + v for v, part in enumerate(parts)])
        for name in ("first", "second")
    ]
    parents = [
        np.zeros(firsts[-1], np.int32),
        np.concatenate(
            [part["parent"] + first for part, first in zip(parts, firsts, strict=False)]
        ),
        np.repeat(np.arange(len(per_leaf)), per_leaf),
    ]
    spans = [
        join_spans([Spans(*(part[f"level{number}.{name}"] for name in _RUNS)) for part in parts])
        for number in range(3)
    ]
    radius = np.max([part["radius"] for part in parts], axis=0)
    levels = [
        Level(representative.astype(np.int32), parent.astype(np.int32), runs, size, float(within))
        for representative, parent, runs, size, within in zip(
            (*representatives, samples),
            parents,
            spans,
            (_COARSE_PX, _COARSE_PX, _FINE_PX),
            (*radius, 0.0),
            strict=True,
        )
    ]
    by_sample = {
        name: np.stack([part[name] for part in parts], axis=1).reshape(
            count * across, *parts[0][name].shape[1:]
        )
        for name in ("areas", "pelvis_px", "cut")
    }
    return PoseLibrary(
        model=model,
        settings=settings,
        base_angles=bases.angles,
        base_quaternion=bases.quaternion,
        base_height_m=parts[0]["heights"],
        base_source=bases.source,
        base_mirrored=bases.mirrored,
        clips=bases.clips,
        views=views,
        sample_base=np.repeat(np.arange(count, dtype=np.int32), across),
        sample_view=np.tile(np.arange(across, dtype=np.int16), count),
        occluded=occluded_parts(by_sample["areas"], usual_areas(by_sample["areas"])),
        levels=tuple(levels),
        leaf_offsets=np.arange(count * across + 1, dtype=np.int64),
        leaf_samples=samples.astype(np.int32),
        sigma_rad=bases.sigma_rad,
        root_sigma_rad=bases.root_sigma_rad,
        bounds_px=_bounds(spans[-1]),
        areas=by_sample["areas"],
        pelvis_px=by_sample["pelvis_px"],
        cut=by_sample["cut"],
    )


def _narrow(spans: Spans) -> Spans:
    """Runs in 8 bits, which are enough for images of at most 255 x 255."""
    runs = (getattr(spans, name).astype(np.uint8) for name in _RUNS[:3])
    return Spans(*runs, spans.offsets)  # type: ignore[arg-type]


def _bounds(spans: Spans) -> Rectangle:
    """Rectangle of all silhouettes in the window of 320 x 240."""
    left, top, right, bottom = (_REDUCTION * edge for edge in spans.bounds)
    return left, top, right, bottom
