"""Long recordings in pieces that overlap, estimated side by side and joined."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from silhouette_core.estimator import Estimate
from silhouette_core.motion.motion import Motion
from voxelpose.batch.jobs import Job
from voxelpose.fitting import Output, write_estimate
from voxelpose.results import Result

PIECES = "pieces"
"""Folder beside the results in which those of the pieces are until they are joined."""


def pieces_of(job: Job, piece_s: float, out: Path) -> list[Job]:
    """Jobs of a long recording's pieces; none where it is short, or has one camera.

    Those after the first keep the body that the first one finds.

    Raises:
        InputError: the recording cannot be used.
    """
    if job.command != "fit":
        return []
    recording = job.open()
    total, length = recording.frame_count, max(round(piece_s * recording.fps), 1)
    count = round(total / length)
    if count < 2:  # the whole is nearer to a piece than two halves are
        return []
    bounds = np.linspace(0, total, count + 1).round().astype(int)
    overlap = max(round(recording.fps / 2), 1)  # of either piece: they share a second
    pieces = []
    for number, (start, stop) in enumerate(pairwise(bounds.tolist())):
        first, end = (
            recording.first + k for k in (max(start - overlap, 0), min(stop + overlap, total))
        )
        settings = dict(job.settings) | {"frames": f"{first}:{end}"}
        if pieces and job.estimator == "multiview" and "body" not in settings:
            settings["body"] = str((out / PIECES / pieces[0].name).resolve())
        pieces.append(replace(job, name=f"{job.name}.{number:03d}", settings=settings))
    return pieces


def join_pieces(job: Job, folders: Sequence[Path], output: Output) -> Result:
    """Writes the result of a recording from those of its pieces, which are blended where they
    overlap.

    Args:
        folders: results of its pieces, in their order.

    Raises:
        InputError: a result is damaged, or the output cannot be used.
    """
    results = [Result.open(folder) for folder in folders]
    motion, seams_mm = joined([result.motion for result in results])
    summaries: list[Any] = [result.summary for result in results]
    spent = [summary["seconds"]["stages"] for summary in summaries]
    seconds = {
        name: np.array([float(stages.get(name, {}).get("sum", 0.0)) for stages in spent])
        for name in sorted(set().union(*spent))
    }
    facts = dict(summaries[0].get("facts", {})) | {
        "pieces": [summary["frames"]["last"] + 1 for summary in summaries],
        "seams_mm": np.round(seams_mm, 1).tolist(),
    }
    ratios = [summary["facts"].get("half_turn_ratio", np.inf) for summary in summaries]
    if np.isfinite(min(ratios)):
        facts["half_turn_ratio"] = min(ratios)
    estimate = Estimate(motion, seconds, facts, rig=results[0].rig)
    settings = job.estimator_settings(None)
    spent_s = sum(float(summary["seconds"]["total"]) for summary in summaries)
    return write_estimate(job.open(), output, estimate, settings, job.estimator, spent_s)


def joined(motions: Sequence[Motion]) -> tuple[Motion, list[float]]:
    """Motions of pieces of one body, in the order of their frames, as one, and how far apart they
    are at each seam; each overlaps its neighbours at most.

    Where two have the same frames, positions and angles pass from one to the other, linearly
    over those frames; the quality is that of the nearer one.

    Returns:
        The motion, and the mean distance of the joints in the frames that two pieces share, mm;
        NaN where they share none.
    """
    whole, seams_mm = _joined([replace(motion, unfiltered=None) for motion in motions])
    if all(motion.unfiltered is None for motion in motions):
        return whole, seams_mm
    # A piece that has no others is as it was estimated.
    before = [replace(motion.unfiltered or motion, quality={}) for motion in motions]
    return replace(whole, unfiltered=_joined(before)[0]), seams_mm


def _joined(motions: Sequence[Motion]) -> tuple[Motion, list[float]]:
    whole, seams_mm = motions[0], list[float]()
    for after in motions[1:]:
        shared, before_rows, after_rows = np.intersect1d(
            whole.frames, after.frames, return_indices=True
        )
        first = whole.select(np.flatnonzero(~np.isin(whole.frames, shared)))
        last = after.select(np.flatnonzero(~np.isin(after.frames, shared)))
        if not len(shared):
            seams_mm.append(float("nan"))
            whole = _chained([first, last])
            continue
        old, new = whole.select(before_rows), after.select(after_rows)
        apart = np.linalg.norm(old.landmarks() - new.landmarks(), axis=2)
        seams_mm.append(1000 * float(apart.mean()))
        whole = _chained([first, _blended(old, new), last])
    return whole, seams_mm


def _blended(old: Motion, new: Motion) -> Motion:
    """A motion that passes over into another of the same frames."""
    weight = (np.arange(len(old)) + 1.0) / (len(old) + 1)
    column, late = weight[:, None], weight >= 0.5

    def mixed(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (1 - column) * a + column * b

    names = set(old.quality) & set(new.quality)
    return replace(
        old,
        root_m=mixed(old.root_m, new.root_m),
        root_quaternion=_turned(old.root_quaternion, new.root_quaternion, column),
        angles_rad=mixed(old.angles_rad, new.angles_rad),
        filled=old.filled & new.filled,
        quality={
            name: np.concatenate([old.quality[name][~late], new.quality[name][late]])
            for name in names
        },
    )


def _turned(old: np.ndarray, new: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Quaternions (T, 4) a share `weight` (T, 1) of the way from some to others."""
    start, end = (Rotation.from_quat(four, scalar_first=True) for four in (old, new))
    part = Rotation.from_rotvec(weight * (start.inv() * end).as_rotvec())
    return (start * part).as_quat(canonical=True, scalar_first=True)


def _chained(motions: Sequence[Motion]) -> Motion:
    """Motions of different frames as one, in the order of the frames."""
    # Frames that one piece has lost lie between those of another.
    order = np.argsort(np.concatenate([motion.frames for motion in motions]))

    def chained(arrays: Iterable[np.ndarray]) -> np.ndarray:
        return np.concatenate(list(arrays))[order]

    each = ("root_m", "root_quaternion", "angles_rad", "frames", "time_s", "filled")
    quality = set.intersection(*(set(motion.quality) for motion in motions))
    return replace(
        motions[0],
        **{name: chained(getattr(motion, name) for motion in motions) for name in each},
        quality={name: chained(motion.quality[name] for motion in motions) for name in quality},
    )
