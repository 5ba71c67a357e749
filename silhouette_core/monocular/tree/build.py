"""Build of a library from base poses: views from all sides, and the tree."""

import hashlib
import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from calib.checks import FloatArray
from calib.errors import InputError
from calib.storage.atomic import write_whole
from silhouette_core.body.body_arrays import body_arrays
from silhouette_core.body.model import BodyModel
from silhouette_core.image.spans import Spans
from silhouette_core.monocular.occlusion import occluded_parts, usual_areas
from silhouette_core.monocular.tree.pose_library import (
    BasePoses,
    Level,
    LibrarySettings,
    PoseLibrary,
)
from silhouette_core.monocular.tree.rendering import (
    SIZES_PX,
    join_spans,
    pose_surfaces,
    render_views,
    select_spans,
    silhouette_levels,
)
from silhouette_core.monocular.tree.store import VERSION
from silhouette_core.monocular.tree.transitions import find_neighbours, view_orientations
from silhouette_core.monocular.tree.tree import Nodes, PoseSpace, Scorer, divide
from silhouette_core.progress import Reporter, SilentReporter

Arrays = Mapping[str, NDArray]
_AT_ONCE = 480  # views held in memory together
_PER_STEP = 4800  # views between two checkpoints
_RUNS = ("rows", "starts", "ends", "offsets")
_FACTS = ("areas", "pelvis_px", "cut")
_INPUTS = "inputs.json"
_INPUTS_OF_STEP = "inputs"


class Checkpoint:
    """Folder of the finished steps of a build; steps of other inputs do not count."""

    def __init__(self, folder: Path | None, inputs: str) -> None:
        """Opens or creates the folder. Raises InputError where the folder cannot be made, or holds
        other files.

        Args:
            folder: the folder; None: no checkpoints.
            inputs: digest of everything that determines the result.
        """
        self.folder = folder
        self._inputs = np.frombuffer(inputs.encode(), np.uint8)
        if folder is None:
            return
        try:
            if folder.exists() and _inputs(folder) != inputs:
                if _inputs(folder) is None and any(folder.iterdir()):
                    raise InputError(
                        f"{folder} exists and is not half-done work of ours: remove it, or give"
                        " --out another name"
                    )
                shutil.rmtree(folder)
            folder.mkdir(parents=True, exist_ok=True)
            (folder / _INPUTS).write_text(json.dumps({"inputs": inputs}), encoding="utf-8")
        except OSError as error:
            raise InputError(f"{folder} cannot be made: {error.strerror or error}") from error

    def step(self, name: str, make: Callable[[], Arrays]) -> Arrays:
        """Arrays of a step, computed by `make` and saved, atomically, if it is not finished."""
        if self.folder is None:
            return make()
        path = self.folder / f"{name}.safetensors"
        try:
            arrays = load(path.read_bytes())
        except (OSError, SafetensorError):
            arrays = {}
        if np.array_equal(arrays.pop(_INPUTS_OF_STEP, []), self._inputs):
            return arrays
        made = make()
        contiguous = {key: np.ascontiguousarray(array) for key, array in made.items()}
        write_whole(path, save(contiguous | {_INPUTS_OF_STEP: self._inputs}))
        return made

    @staticmethod
    def remove(folder: Path) -> None:
        """Deletes the folder of a finished build."""
        shutil.rmtree(folder, ignore_errors=True)


def _inputs(folder: Path) -> str | None:
    try:
        return json.loads((folder / _INPUTS).read_text(encoding="utf-8"))["inputs"]
    except (OSError, ValueError, KeyError, TypeError):
        return None


def build_library(
    bases: BasePoses,
    model: BodyModel,
    settings: LibrarySettings,
    reporter: Reporter | None = None,
    kept_in: Path | None = None,
) -> PoseLibrary:
    """Library of base poses seen from all sides. Raises InputError where `kept_in` cannot be
    written.

    Args:
        kept_in: folder for checkpoints, from which an interrupted build resumes; the caller removes
            it once the library is written.

    Returns:
        The library. The same inputs give the same library, for any threads, interrupted or not.

    Source: Okada and Stenger, sections 3 and 7.
    """
    reporter = reporter or SilentReporter()
    checkpoint, views = Checkpoint(kept_in, _digest(bases, model, settings)), settings.views()
    base = np.repeat(np.arange(len(bases.angles), dtype=np.int32), len(views))
    view = np.tile(np.arange(len(views), dtype=np.int16), len(bases.angles))
    rendered = _render_all(bases, model, views, checkpoint, reporter)
    spans = [_spans(rendered, number) for number in range(len(SIZES_PX))]
    poses = PoseSpace(bases.angles, base, view_orientations(bases.quaternion[base], views[view]))
    nodes, thresholds = _nodes(poses, settings, spans, checkpoint, reporter)
    library = PoseLibrary(
        model=model,
        settings=settings,
        bases=bases,
        views=views,
        sample_base=base,
        sample_view=view,
        pelvis_px=rendered["pelvis_px"],
        areas=rendered["areas"],
        occluded=occluded_parts(rendered["areas"], usual_areas(rendered["areas"])),
        cut=rendered["cut"] > 0,
        levels=tuple(
            Level(
                one.representative,
                one.parent,
                select_spans(runs, one.representative),
                size,
                threshold,
            )
            for one, runs, size, threshold in zip(nodes, spans, SIZES_PX, thresholds, strict=True)
        ),
        leaf_offsets=nodes[-1].offsets,
        leaf_samples=nodes[-1].members,
        bounds_px=spans[-1].bounds,
    )
    if model.person is None:
        return library  # nobody knows how it moves
    neighbours = checkpoint.step("neighbours", lambda: find_neighbours(library, reporter=reporter))
    return replace(library, neighbours=neighbours)


def _digest(bases: BasePoses, model: BodyModel, settings: LibrarySettings) -> str:
    """Digest of everything that determines the result."""
    measures = body_arrays(model)[1] if model.person is None else asdict(model.person)
    facts = [VERSION, asdict(settings), measures, bases.root_sigma_rad]
    digest = hashlib.sha256(json.dumps(facts).encode())
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


def _spans(arrays: Arrays, number: int) -> Spans:
    """Silhouettes of one level from arrays of all."""
    return Spans(*(arrays[f"level{number}.{name}"] for name in _RUNS))


def _joined(parts: Sequence[Arrays]) -> dict[str, NDArray]:
    """Arrays of several sequences of samples as those of one."""
    joined = {name: np.concatenate([part[name] for part in parts]) for name in _FACTS}
    for number in range(len(SIZES_PX)):
        runs = join_spans([_spans(part, number) for part in parts])
        joined |= {f"level{number}.{name}": getattr(runs, name) for name in _RUNS}
    return joined


def _render_all(
    bases: BasePoses,
    model: BodyModel,
    views: FloatArray,
    checkpoint: Checkpoint,
    reporter: Reporter,
) -> Arrays:
    """Arrays of all samples: silhouettes at every level, areas, pelvis_px and cut."""
    per_step = max(1, _PER_STEP // len(views))
    reporter.stage("taking pictures", len(bases.angles) * len(views))
    parts: list[Arrays] = []
    for number, start in enumerate(range(0, len(bases.angles), per_step)):
        which = slice(start, start + per_step)
        render = partial(_render_some, bases, model, views, which)
        parts.append(checkpoint.step(f"pictures{number}", render))
        reporter.advance(len(parts[-1]["cut"]))
    return _joined(parts)


def _render_some(bases: BasePoses, model: BodyModel, views: FloatArray, which: slice) -> Arrays:
    """Arrays of some of the base poses, from all views, see `_render_all`."""
    surfaces = pose_surfaces(model, bases.quaternion[which], bases.angles[which])
    parts: list[Arrays] = []
    at_once = max(1, _AT_ONCE // len(views))
    for start in range(0, len(surfaces), at_once):
        block = surfaces[start : start + at_once]
        base = np.repeat(np.arange(len(block)), len(views))
        seen = render_views(model, block, base, np.tile(views, (len(block), 1)))
        arrays = {name: getattr(seen, name) for name in _FACTS}
        for number, masks in enumerate(silhouette_levels(seen.windows > 0)):
            runs = Spans.from_masks(masks)
            arrays |= {f"level{number}.{name}": getattr(runs, name) for name in _RUNS}
        parts.append(arrays)
    return _joined(parts)


def _nodes(
    poses: PoseSpace,
    settings: LibrarySettings,
    spans: Sequence[Spans],
    checkpoint: Checkpoint,
    reporter: Reporter,
) -> tuple[list[Nodes], list[float]]:
    """Nodes and thresholds of all levels."""
    scorers = [
        Scorer(runs, size, settings, spans[-1].bounds)
        for runs, size in zip(spans, SIZES_PX, strict=True)
    ]
    thresholds = [
        score.threshold(by_xor) for score, by_xor in zip(scorers, settings.thresholds, strict=True)
    ]
    sets = [np.arange(len(poses.base), dtype=np.int64)]
    nodes: list[Nodes] = []

    def divided() -> Arrays:
        number = len(nodes)
        reporter.stage(f"tree, level {number + 1}", len(sets) if number else None)
        groups = divide(sets, poses, scorers[number], thresholds[number], reporter)
        return vars(Nodes.from_groups(groups, poses))

    for number in range(len(spans)):
        nodes.append(Nodes(**checkpoint.step(f"tree{number}", divided)))
        sets = nodes[-1].sets()
    return nodes, thresholds
