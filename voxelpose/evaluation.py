"""Errors of an estimated motion against known joint positions, as papers report them.

Source: joints and root-relative error as in Sigal, Balan and Black, "HumanEva" (IJCV 2010).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from calib.checks import check_array
from calib.errors import InputError
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.joint_files import (
    FARTHEST_M,
    JOINTS,
    POSE2SIM_AXES,
    column_names,
    list_joints,
    read_joints,
)
from silhouette_core.motion.motion import Motion
from voxelpose.recording.truth import (
    TRUE_MOTION,
    TRUTH,
    KnownJoints,
    load_truth,
    read_people_truth,
    truth_of,
)
from voxelpose.results import Result, is_result, open_people

_LOST_MM = 300
_CORRECT_MM = 150
_FLIP_MM = 30
_LIMB_BONES = ("{}_hip {}_knee", "{}_knee {}_ankle", "{}_shoulder {}_elbow", "{}_elbow {}_wrist")
_BONE_ENDS = [bone.format(side, side) for bone in _LIMB_BONES for side in ("left", "right")]
_BONE_ENDS += ["pelvis neck", "neck head_top"]
_BONES = np.array([[*map(LANDMARK_NAMES.index, ends.split())] for ends in _BONE_ENDS])


@dataclass(frozen=True)
class Score:
    """Errors of an estimate; means are over the frames that have a pose."""

    frames: int  #: number of frames whose truth is known.
    lost: float  #: fraction of frames without a pose or with a root-relative error over 300 mm.
    mpjpe_mm: float = float("nan")  #: mean distance of the joints in the world, mm.
    root_mm: float = float("nan")
    """Mean distance of the joints relative to the first one (the pelvis), mm."""
    pa_mm: float = float("nan")
    """Mean distance of the joints after the best similarity transform of each frame, mm."""
    pck150: float = float("nan")  #: fraction of joints within 150 mm, relative to the first one.
    flips: float = float("nan")
    """Fraction of frames that are nearer by over 30 mm with left and right exchanged; NaN of a body
    whose joints have no sides."""
    jitter_mm: float = float("nan")  #: mean third difference of the joint positions over time, mm.
    jitter_truth_mm: float = float("nan")  #: mean third difference of the true positions, mm.
    angle_deg: float = float("nan")
    """Mean angle between the directions of the bones (a person's ten), degrees."""
    joint_root_mm: tuple[float, ...] = ()  #: root_mm of every joint, in the order of `joints`.
    joints: tuple[str, ...] = LANDMARK_NAMES  #: names of the joints; of a person LANDMARK_NAMES.
    joint_angle_deg: float = float("nan")
    """Mean error of the joint angles, degrees; NaN unless both are known as motions of one body."""
    each_joint_angle_deg: Mapping[str, float] = field(default_factory=dict)
    """Mean error of every joint angle that is estimated, by its name."""
    corrections: tuple[str, ...] = ()  #: what of the estimate was corrected by hand.


def evaluate(
    result: Result | Path | str,
    truth: Path | str | None = None,
    offset: int = 0,
    markers: Mapping[str, str] | None = None,
    axes: str = POSE2SIM_AXES,
) -> Score:
    """Scores a result against known joint positions.

    Args:
        result: a result, its folder, or a joints.csv.
        truth: a person's truth.json or TRC, see `read_truth`; or of any body its true motion
            (.safetensors) or a joints.csv; None: truth.json or truth.safetensors of the recording
            from which the result was made.
        offset: number added to the result's frame numbers before the comparison.
        markers: for a TRC, as for `read_trc`.
        axes: for a TRC, as for `read_trc`.

    Raises:
        InputError: a file cannot be read, there is no truth, or it is another body's.
    """
    path = result.folder if isinstance(result, Result) else Path(result)
    truth_file = _truth_of(path) if truth is None else Path(truth)
    known = load_truth(truth_file, markers, axes)
    count = len(known.joints_m)
    if not is_result(path):
        joints = path / JOINTS if path.is_dir() else path
        _check_names(joints, list_joints(joints)[0], truth_file, known)
        estimate_m = read_joints(joints, count, offset, known.names)
        return score_motion(known.joints_m, estimate_m, known.names, _bones(known))
    motion = Result.open(path).motion
    names = column_names(motion.model.tree.landmark_names)
    _check_names(path, names, truth_file, known)
    estimate_m = _joints_m(motion, count, offset)[:, [names.index(name) for name in known.names]]
    score = score_motion(known.joints_m, estimate_m, known.names, _bones(known))
    errors = {} if known.motion is None else _angle_errors(known.motion, motion, offset)
    return replace(score, corrections=motion.corrections, **errors)


def evaluate_people(
    folder: Path | str, truth: Path | str | None = None, offset: int = 0
) -> dict[str, Score]:
    """Scores the results of several people against the known joint positions of several.

    Who is who is decided once for the whole recording, so that the joints are nearest in all.
    A person without a result has a score, too: every frame is lost.

    Args:
        folder: of `fit_people`.
        truth: see `read_people_truth`; None: truth.json of the recording.
        offset: as of `evaluate`.

    Returns:
        By `person_1` and so on as in the folder, then `nobody_1` and so on of people without one.

    Raises:
        InputError: a file cannot be read, or there are more results than people.
    """
    results = open_people(folder)
    known_m = read_people_truth(_truth_of(results[0].folder) if truth is None else Path(truth))
    if len(results) > len(known_m):
        raise InputError(f"{folder} holds {len(results)} people, and the truth {len(known_m)}")
    joints_m = [_joints_m(result.motion, len(known_m[0]), offset) for result in results]
    cost = np.array([[_distance_m(true, joints) for true in known_m] for joints in joints_m])
    pairs = dict(zip(*(side.tolist() for side in linear_sum_assignment(cost)), strict=True))
    scores = {
        results[k].folder.name: replace(
            score_motion(known_m[person], joints_m[k]), corrections=results[k].motion.corrections
        )
        for k, person in pairs.items()
    }
    missed = sorted({*range(len(known_m))} - {*pairs.values()})
    return scores | {
        f"nobody_{n}": score_motion(known_m[k], np.full_like(known_m[k], np.nan))
        for n, k in enumerate(missed, 1)
    }


def _joints_m(motion: Motion, count: int, offset: int) -> NDArray[np.float64]:
    """Joints (count, L, 3) of the first frames, world, m; NaN without a pose."""
    joints_m = np.full((count, len(motion.model.landmarks_m), 3), np.nan)
    frames = motion.frames + offset
    within = (frames >= 0) & (frames < count)
    joints_m[frames[within]] = motion.landmarks()[within]
    return joints_m


def _distance_m(true_m: NDArray[np.float64], estimate_m: NDArray[np.float64]) -> float:
    """Mean distance of the joints (T, J, 3) in frames in which both are known; as far as can be
    where there is none.
    """
    distance_m = np.linalg.norm(true_m - estimate_m, axis=2)
    known = distance_m[np.isfinite(distance_m)]
    return float(known.mean()) if len(known) else FARTHEST_M


def _truth_of(result: Path) -> Path:
    if not is_result(result):
        raise InputError(f"{result} does not say which recording it is of: give --truth FILE")
    recording = (result / str(Result.open(result).settings.get("recording", ""))).resolve()
    truth = truth_of(recording)
    if truth is None:
        raise InputError(f"there is no {TRUTH} or {TRUE_MOTION} in {recording}: give --truth FILE")
    return truth


def _check_names(joints: Path, names: Sequence[str], truth_file: Path, known: KnownJoints) -> None:
    """Refuses a truth with joints that the estimate lacks; one without a row has no pose."""
    missing = [name for name in known.names if name not in names]
    if names and missing:
        raise InputError(
            f"{truth_file} has the joint {missing[0][:80]!r}, and {joints} has"
            f" {', '.join(names)[:200]}: give the truth of the same body"
        )


def _bones(known: KnownJoints) -> NDArray[np.int64]:
    """Pairs (B, 2) of the joints between which there is a bone, as far as they are known."""
    if known.names == LANDMARK_NAMES:
        return _BONES
    if known.motion is None:
        return np.zeros((0, 2), np.int64)
    return np.asarray(known.motion.model.tree.landmark_bones, np.int64).reshape(-1, 2)


def _angle_errors(truth: Motion, estimate: Motion, offset: int) -> dict[str, Any]:
    """`joint_angle_deg` and `each_joint_angle_deg` over the frames that both have; none where the
    bodies have other joint angles.
    """
    names, free = truth.model.tree.dof_names, ~truth.model.tree.dof_fixed
    _, true_rows, rows = np.intersect1d(truth.frames, estimate.frames + offset, return_indices=True)
    if names != estimate.model.tree.dof_names or not len(rows) or not free.any():
        return {}
    error_rad = estimate.angles_rad[rows] - truth.angles_rad[true_rows]
    degrees = np.abs((np.degrees(error_rad) + 180) % 360 - 180).mean(axis=0)
    each = {name: float(degrees[k]) for k, name in enumerate(names) if free[k]}
    return {"joint_angle_deg": float(degrees[free].mean()), "each_joint_angle_deg": each}


def score_motion(
    truth_m: NDArray[np.float64],
    estimate_m: NDArray[np.float64],
    names: Sequence[str] = LANDMARK_NAMES,
    bones: NDArray[np.int64] = _BONES,
) -> Score:
    """Scores joint positions.

    Args:
        truth_m: (T, L, 3) float64, world, metres; what is NaN is not scored.
        estimate_m: likewise; NaN in frames without a pose.
        names: of the L joints, the first of which is the root's.
        bones: (B, 2) int, joints between which there is a bone.

    Raises:
        ValueError: the shapes differ, or nothing of the truth is known.
    """
    check_array("truth_m", truth_m, ("T", len(names), 3))
    check_array("estimate_m", estimate_m, truth_m.shape)
    known = np.array([bool(np.isfinite(joints).all(axis=1).any()) for joints in truth_m])
    if not known.any():
        raise ValueError("no frame of the truth has a joint")
    truth_m, estimate_m = truth_m[known], estimate_m[known]
    count = len(truth_m)
    posed = np.isfinite(estimate_m).all(axis=(1, 2))
    if not posed.any():
        return Score(frames=count, lost=1.0, joints=tuple(names))
    truth, estimate = 1000 * truth_m[posed], 1000 * estimate_m[posed]
    local_truth, local = truth - truth[:, :1], estimate - estimate[:, :1]
    error = np.linalg.norm(local - local_truth, axis=2)
    per_frame = _mean(error, 1)
    mirror = _mirrored(names)
    exchanged = _mean(np.linalg.norm(local[:, mirror] - local_truth, axis=2), 1)
    has_sides = mirror != list(range(len(names)))
    return Score(
        frames=count,
        lost=float((count - posed.sum() + (per_frame > _LOST_MM).sum()) / count),
        mpjpe_mm=float(_mean(np.linalg.norm(estimate - truth, axis=2))),
        root_mm=float(_mean(per_frame)),
        pa_mm=float(_mean(np.linalg.norm(_aligned(estimate, truth), axis=2))),
        pck150=float(_mean(np.where(np.isfinite(error), error < _CORRECT_MM, np.nan))),
        flips=float((per_frame - exchanged > _FLIP_MM).mean()) if has_sides else float("nan"),
        jitter_mm=_jitter(np.where(np.isfinite(truth), estimate, np.nan)),
        jitter_truth_mm=_jitter(truth),
        angle_deg=_bone_angle(truth, estimate, bones),
        joint_root_mm=tuple(float(mm) for mm in _mean(error, 0)),
        joints=tuple(names),
    )


def _mean(values: NDArray[np.float64], axis: int | None = None) -> NDArray[np.float64]:
    """Mean of what is not NaN; NaN where there is nothing."""
    return np.ma.filled(np.ma.masked_invalid(values).mean(axis), np.nan)


def _mirrored(names: Sequence[str]) -> list[int]:
    """Index of each joint's counterpart on the other side, or of itself."""
    number = {name: k for k, name in enumerate(names)}
    other = {"left": "right", "right": "left"}
    parts = [name.partition("_") for name in names]
    others = [f"{other.get(side, side)}{mark}{rest}" for side, mark, rest in parts]
    return [number.get(name, k) for k, name in enumerate(others)]


def markdown_table(scores: Mapping[str, Score]) -> str:
    """Returns scores as a Markdown table, with their unweighted mean where there are several."""
    columns = "mpjpe_mm root_mm pa_mm pck150 angle_deg jitter_mm jitter_truth_mm flips lost".split()
    if any(score.each_joint_angle_deg for score in scores.values()):
        columns.insert(0, "joint_angle_deg")
    table = np.array([[getattr(score, column) for column in columns] for score in scores.values()])
    rows = [
        (name, score.frames, values)
        for (name, score), values in zip(scores.items(), table, strict=True)
    ]
    if len(scores) > 1:
        rows.append(
            ("**mean**", sum(score.frames for score in scores.values()), table.mean(axis=0))
        )
    digits = [3 if column in ("pck150", "flips", "lost") else 1 for column in columns]
    lines = [["recording", "frames", *columns]]
    for name, frames, values in rows:
        cells = (
            f"{value:.{places}f}" if np.isfinite(value) else "–"
            for value, places in zip(values, digits, strict=True)
        )
        lines.append([name, str(frames), *cells])
    return markdown_rows(lines)


def markdown_rows(lines: Sequence[Sequence[str]]) -> str:
    """A Markdown table of cells, the first line of which is its head."""
    rows = ([cell.replace("|", "\\|") for cell in line] for line in lines)
    head, *body = [f"| {' | '.join(row)} |\n" for row in rows]
    return "".join([head, "|---" * len(lines[0]) + "|\n", *body])


def _aligned(moving: NDArray[np.float64], fixed: NDArray[np.float64]) -> NDArray[np.float64]:
    """What is left (T, J, 3) between points, (T, J, 3) float64 both, after the similarity transform
    of `moving` that fits best in each frame; NaN in frames with less than four points of `fixed`
    that are not NaN.

    Source: Umeyama, "Least-squares estimation of transformation parameters" (PAMI 1991), (40)-(43).
    """
    known = np.isfinite(fixed)
    a, b = (
        np.where(known, points - _mean(np.where(known, points, np.nan), 1)[:, None], 0.0)
        for points in (moving, fixed)
    )
    u, s, vt = np.linalg.svd(np.swapaxes(b, 1, 2) @ a)
    sign = np.ones_like(s)
    sign[:, 2] = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    rotation = (u * sign[:, None]) @ vt
    scale = (s * sign).sum(axis=1) / np.maximum((a**2).sum(axis=(1, 2)), 1e-12)
    residual_m = scale[:, None, None] * a @ np.swapaxes(rotation, 1, 2) - b
    return np.where(known & (known.sum(axis=1, keepdims=True) > 3), residual_m, np.nan)


def _jitter(positions: NDArray[np.float64]) -> float:
    if len(positions) < 4:
        return float("nan")
    return float(_mean(np.linalg.norm(np.diff(positions, 3, axis=0), axis=2)))


def _bone_angle(
    truth: NDArray[np.float64], estimate: NDArray[np.float64], bones: NDArray[np.int64]
) -> float:
    if not len(bones):
        return float("nan")
    directions = []
    for joints in (truth, estimate):
        along = joints[:, bones[:, 1]] - joints[:, bones[:, 0]]
        directions.append(along / np.maximum(np.linalg.norm(along, axis=2, keepdims=True), 1e-9))
    return float(
        _mean(np.degrees(np.arccos(np.clip((directions[0] * directions[1]).sum(axis=2), -1, 1))))
    )
