"""Quality of fitted poses: agreement with the hull, part by part, and errors to be expected.

A frame's evidence are the shares of the silhouettes that body and silhouettes do not have in common
(the mean and the median over the cameras), the same near every joint, how uncertain the outlines
leave the joint, the body's part outside the hull, how many of its angles are at their limits, how
much worse the recording is explained by bodies turned half round, how thick the clothes are, and
how many cameras there are. Logistic regression on it gives probabilities, and linear regression of
log(error + 3 mm) the median error:

.. math::

    P = \\frac{1}{1 + \\exp(-(w_j + \\sum_k w_k x_k))}

with a constant :math:`w_j` for every joint. The weights stand in expected_error.toml, which
`python -m benchmarks.expected_error ... --fit` writes. Where a limb could be elsewhere, both get
worse, see `open_joints`.

Source: textbook (logistic regression); the evidence is this project's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import maximum_filter

from silhouette_core.body.sizes import IS_CLOTHING
from silhouette_core.fitted_weights import fitted_weights
from silhouette_core.motion.kinematics import joints_of, place, rotation_matrices
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.posterior import landmark_sigma_m
from silhouette_core.refinement.refine import RefineStart
from silhouette_core.scoring.silhouette_error import body_masks
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.body_volume import BodyVolume, VoxelSet
from voxelpose.multiview.matching.matcher import MatchSettings, match
from voxelpose.multiview.proposers.limb_search import place_limb
from voxelpose.multiview.proposers.pose_search import SEARCHED, STEP, BodyGeometry, refine_fits
from voxelpose.multiview.tracking.tracking import PoseTracker
from voxelpose.multiview.tuning import MATCHING, OFF_LINE, QUALITY

_TOGETHER = 8  # frames
_TURNED = 5  # frames in which the body is turned half round

NEAR_MM = 30
"""Error for which the probability of a joint is stated."""
RIGHT_MM = 80
"""Mean error of the joints relative to the pelvis up to which a frame counts as right."""
ADDED_MM = 3
"""Added to errors before their logarithm is taken."""

# Constants of the 15 joints, then the weights of: log of the share near the joint, log of its
# standard deviation over a centimetre, log of the mean share, log of the median one, log of the
# half-turn ratio, share of the body outside the hull, share of the angles at their limits,
# thickness of the clothes in per cent of the stature, log of the number of cameras over four.
# Of right frames: a constant, then the same without those of the joint.
FILE = Path(__file__).with_name("expected_error.toml")
"""Weights of these regressors, written by the benchmark."""


def frame_evidence(
    body: BodyGeometry, pose: Pose, joints_m: np.ndarray, frame: FrameObservation
) -> dict[str, np.ndarray]:
    """What speaks for and against one frame's pose, by the names of `Motion.quality`.

    Args:
        joints_m: (15, 3) float64, joints of the posed body.

    Returns:
        Float64 arrays.

        - camera_agreement: (C,), 1 - |XOR| / |OR| of body and silhouette in each camera; what is
          unknown does not count, and a camera in which all of it is has the others' mean.
        - joint_disagreement: (15,), |XOR| in a square of 0.24 m around each joint as a share of the
          square, the mean over the cameras that have the joint before them and know some of it.
        - joint_sigma_mm: (15,), standard deviations of the joints by the outlines.
    """
    errors, near = [], []
    bodies = body_masks(body.model, pose, frame.views, body.body_volume.backend)
    seen_by = zip(frame.views.rig, frame.masks, frame.views.without_unknown(bodies), strict=True)
    for c, (camera, mask, drawn) in enumerate(seen_by):
        unknown = None if frame.views.unknown is None else frame.views.unknown[c]
        apart = drawn ^ mask
        either = np.count_nonzero(drawn | mask)
        hidden = unknown is not None and not either
        errors.append(np.nan if hidden else np.count_nonzero(apart) / max(either, 1))
        pixels, depth_m = camera.project(joints_m)
        shares = np.full(len(joints_m), np.nan)
        for k in np.flatnonzero(np.isfinite(pixels).all(axis=1)):
            reach = QUALITY.square_m * camera.matrix[0, 0] / max(float(depth_m[k]), 0.3)
            low = np.maximum((pixels[k] - reach).astype(int), 0)
            high = np.maximum((pixels[k] + reach).astype(int) + 1, 0)
            square, area = (slice(low[1], high[1]), slice(low[0], high[0])), (2 * reach) ** 2
            seen = area if unknown is None else area - np.count_nonzero(unknown[square])
            if seen >= QUALITY.least_seen * area:
                shares[k] = np.count_nonzero(apart[square]) / seen
        near.append(shares)
    known = np.isfinite(near)
    sums = np.where(known, near, 0.0).sum(axis=0)
    camera_error = np.array(errors)
    if np.isnan(camera_error).any() and not np.isnan(camera_error).all():
        camera_error[np.isnan(camera_error)] = np.nanmean(camera_error)
    return {
        "camera_agreement": 1 - camera_error,
        "joint_disagreement": sums / np.maximum(known.sum(axis=0), 1),
        "joint_sigma_mm": 1000 * landmark_sigma_m(body.surface, frame.observation, pose),
    }


def half_turn_ratio(
    body: BodyGeometry, pose: Pose, frame: FrameObservation, settings: MatchSettings
) -> float:
    """How much worse the body turned half round, its limbs matched again, explains a frame."""
    turned = Pose(
        pose.root_m, pose.root_rotation @ np.diag([-1.0, -1.0, 1.0]), np.zeros_like(pose.angles_rad)
    )
    matched = match(body.body_volume, frame.grid, frame.occupancy, turned, settings)
    other, unturned = refine_fits(
        body, frame.observation, [RefineStart(matched.pose, SEARCHED), RefineStart(pose, STEP)]
    )
    return other.error / max(unturned.error, 1e-6)


def open_joints(
    body: BodyGeometry, pose: Pose, frame: FrameObservation
) -> tuple[np.ndarray, np.ndarray]:
    """What a frame leaves open of a person's arms and legs: each is placed elsewhere, which is the
    less probable, the less it explains.

    Returns:
        Probabilities (15,) float64 that a joint is where such a placement has it, 30 mm or more
        away; and how far away it is, times its probability, (15,) float64, mm.
    """
    volume, seen = body.body_volume, frame.observation
    other = [place_limb(volume, seen, pose, chain, MATCHING.apart_m) for chain in volume.chains]
    fits = refine_fits(body, seen, [RefineStart(one, STEP) for one in (pose, *other)])
    errors = np.maximum([fit.error for fit in fits], 1e-6)
    # One of two candidates for the frame: their costs are logarithms of the errors.
    chance = 1 / (1 + (errors[1:, None] / errors[0]) ** OFF_LINE.frame_residuals)
    joints_m = joints_of(body.model, [fit.pose for fit in fits])
    away_mm = 1000 * np.linalg.norm(joints_m[1:] - joints_m[0], axis=2)
    return (chance * (away_mm >= NEAR_MM)).max(axis=0), (chance * away_mm).max(axis=0)


@dataclass(frozen=True, eq=False)
class MotionEvidence:
    """What speaks for and against the T poses of a motion."""

    camera_error: np.ndarray
    """(T, C) float64, 1 less `camera_agreement` of `frame_evidence`; rows of NaN where there is
    none."""
    joint_error: np.ndarray  #: (T, 15) float64, its `joint_disagreement`.
    joint_sigma_m: np.ndarray  #: (T, 15) float64, its `joint_sigma_mm` in metres.
    outside: np.ndarray  #: (T,) float64, share of the body's volume outside the hull.
    at_limits: np.ndarray
    """(T,) float64, share of the joint angles that are at an end of their range."""
    half_turn: float  #: median half-turn ratio of the recording.
    clothes: float  #: thickness of the body's clothes, as fractions of the stature, summed.

    @classmethod
    def from_motion(cls, motion: Motion, half_turn: float) -> MotionEvidence:
        """Evidence of a motion with its quality."""
        quality = motion.quality
        low, high = motion.model.tree.dof_limits_rad.T
        angles, free = motion.angles_rad, high > low
        at_end = (angles <= low + QUALITY.at_limit_rad) | (angles >= high - QUALITY.at_limit_rad)
        at_limits = (at_end & free).mean(axis=1)
        clothes = float(motion.model.shape[IS_CLOTHING].sum())
        return cls(
            1 - quality["camera_agreement"],
            quality["joint_disagreement"],
            quality["joint_sigma_mm"] / 1000,
            quality["outside"],
            at_limits,
            half_turn,
            clothes,
        )


def expected_errors(evidence: MotionEvidence) -> dict[str, np.ndarray]:
    """Errors of T poses by regression on their evidence, by the names of `Motion.quality`.

    Returns:
        Float64 arrays.

        - right_probability: (T,), that the joints' mean error relative to the pelvis is below
          80 mm.
        - joint_error_mm: (T, 15), median error of each joint.
        - landmark_confidence: (T, 15), probability that a joint is within 30 mm of the truth.
    """
    joints, frames = regressors(evidence)
    weights = fitted_weights(FILE)
    return {
        "right_probability": logistic(frames @ weights["right"]),
        "joint_error_mm": np.maximum(np.exp(joints @ weights["error"]) - ADDED_MM, 1.0),
        "landmark_confidence": logistic(joints @ weights["near"]),
    }


def regressors(evidence: MotionEvidence) -> tuple[np.ndarray, np.ndarray]:
    """Regressors of the joints (T, 15, 24) and of the frames (T, 8), in the weights' order."""
    camera_error = np.maximum(evidence.camera_error, 1e-3)
    mean = np.log(camera_error.mean(axis=1))
    middle = np.log(np.median(camera_error, axis=1))
    turn = np.full(len(mean), np.log(np.clip(evidence.half_turn, 1.0, QUALITY.most_turned)))
    clothes = np.full(len(mean), 100 * evidence.clothes)
    cameras = np.full(len(mean), np.log(camera_error.shape[1] / 4))
    shared = [mean, middle, turn, evidence.outside, evidence.at_limits, clothes, cameras]
    frames = np.stack([np.ones(len(mean)), *shared], axis=1)
    near = np.log(evidence.joint_error + QUALITY.least)
    sigma = np.log(evidence.joint_sigma_m / 0.01)
    constants = np.repeat(np.eye(15)[None], len(mean), axis=0)
    of_frame = np.repeat(frames[:, None, 1:], 15, axis=1)
    of_joint = np.stack([near, sigma], axis=2)
    return np.concatenate([constants, of_joint, of_frame], axis=2), frames


def logistic(value: np.ndarray) -> np.ndarray:
    """1 / (1 + exp(-value))."""
    return 1.0 / (1.0 + np.exp(-np.clip(value, -30.0, 30.0)))


@dataclass(frozen=True, eq=False)
class Quality:
    """Agreement of one frame's pose with the hull.

    A hull of few cameras is larger than the body in it.
    """

    part_overlap: np.ndarray
    """(27,) float64, fraction of each part's volume inside the hull; NaN for a part smaller than a
    voxel."""
    unexplained: float
    """Fraction of the hull's voxels that no part covers, nor a neighbour of which: a part's points
    leave gaps of a voxel."""


def assess(body_volume: BodyVolume, pose: Pose, frame: FrameObservation) -> Quality:
    """Agreement of a posed body with a frame's hull."""
    voxel_set = VoxelSet(frame.grid, frame.occupancy, body_volume.backend)
    (rotation,), (origin,) = place(body_volume.model, *PoseArrays.from_poses([pose]).arrays)
    overlap = np.full(len(body_volume.model.names), np.nan)
    union = np.zeros(voxel_set.words, np.uint64)
    for part, points in enumerate(body_volume.part_points):
        if len(points):
            bits, empty, _ = voxel_set.cover(points, rotation[part][None], origin[part][None])
            overlap[part] = 1 - empty[0] / len(points)
            union |= bits[0]
    covered = np.zeros(frame.occupancy.shape, bool)
    covered[tuple(voxel_set.voxels(union).T)] = True
    near = np.asarray(maximum_filter(covered, 3), np.bool_)
    unexplained = np.count_nonzero(frame.occupancy & ~near)
    return Quality(overlap, unexplained / max(len(voxel_set), 1))


def motion_quality(
    tracker: PoseTracker, motion: Motion, steps: list[int], clock: StageClock, reporter: Reporter
) -> tuple[dict[str, np.ndarray], float]:
    """Assesses a motion.

    Args:
        motion: T poses in the tracker's world.
        steps: T time steps of the poses.

    Returns:
        Arrays of T rows by name, as of `Motion.quality`; and the median ratio by which bodies
        turned half round explain the silhouettes worse, 1: as well, NaN where no frame shows the
        person.
    """
    body, joints_m = tracker.body, motion.landmarks()
    points = np.array([len(part) for part in body.body_volume.part_points])
    rotation = rotation_matrices(motion.root_quaternion)
    marks = np.full(len(body.model.landmarks_m), np.nan)
    nothing = {
        "part_overlap": np.full(len(points), np.nan),
        "unexplained": np.array(np.nan),
        "outside": np.array(np.nan),
        "camera_agreement": np.full(len(tracker.observations.observer.views.rig), np.nan),
        "joint_disagreement": marks,
        "joint_sigma_mm": marks,
    }

    def pose_of(row: int) -> Pose:
        return Pose(motion.root_m[row], rotation[row], motion.angles_rad[row])

    def assessed(row: int) -> dict[str, np.ndarray]:
        frame = tracker.observe(steps[row])
        if frame is None:
            return nothing
        pose = pose_of(row)
        quality = assess(body.body_volume, pose, frame)
        outside = 1 - float(np.nansum(quality.part_overlap * points)) / points.sum()
        return {
            "part_overlap": quality.part_overlap,
            "unexplained": np.array(quality.unexplained),
            "outside": np.array(outside),
        } | frame_evidence(body, pose, joints_m[row], frame)

    frame_quality: list[dict[str, np.ndarray]] = []
    for first in range(0, len(motion), _TOGETHER):
        rows = range(first, min(first + _TOGETHER, len(motion)))
        with clock("quality"):
            frame_quality += side_by_side(assessed, rows)
        for _ in rows:
            reporter.advance()
    ratio = np.nan
    if body.model.person is not None:
        with clock("half turn"):
            ratio = _half_turn(tracker, pose_of, steps)
    arrays = {name: np.stack([frame[name] for frame in frame_quality]) for name in nothing}
    arrays["part_unsupported"] = arrays["part_overlap"] < QUALITY.unsupported
    arrays["outline_agreement"] = arrays["camera_agreement"].mean(axis=1)
    if body.model.person is None:  # the regression is of people
        return arrays, ratio
    evidence = MotionEvidence.from_motion(replace(motion, quality=arrays), ratio)
    arrays |= expected_errors(evidence)
    with clock("open limbs"):
        chance, away_mm = _open_joints(tracker, pose_of, steps)
    arrays["landmark_confidence"] *= 1 - chance
    arrays["joint_error_mm"] += away_mm
    for name in ("right_probability", "landmark_confidence"):
        arrays[name] = np.nan_to_num(arrays[name])
    return arrays, ratio


def _open_joints(
    tracker: PoseTracker, pose_of: Callable[[int], Pose], steps: list[int]
) -> tuple[np.ndarray, np.ndarray]:
    """`open_joints` of T frames, (T, 15) each: of some frames, and of the others as of the nearest
    of these.
    """
    apart = max(round(tracker.fps * OFF_LINE.limbs_again_s), 1)
    rows = np.arange(min(apart // 2, len(steps) - 1), len(steps), apart)

    def of(row: int) -> tuple[np.ndarray, np.ndarray]:
        frame, nothing = tracker.observe(steps[row]), np.zeros(len(tracker.body.model.landmarks_m))
        if frame is None:
            return nothing, nothing
        return open_joints(tracker.body, pose_of(row), frame)

    nearest = np.abs(np.arange(len(steps))[:, None] - rows).argmin(axis=1)
    chance, away_mm = zip(*side_by_side(of, rows.tolist()), strict=True)
    return np.array(chance)[nearest], np.array(away_mm)[nearest]


def _half_turn(tracker: PoseTracker, pose_of: Callable[[int], Pose], steps: list[int]) -> float:
    """Median half-turn ratio of a few frames, NaN where none shows the person."""
    rows = np.linspace(0, len(steps) - 1, min(len(steps), _TURNED)).round().astype(int)

    def ratio(row: int) -> float:
        frame = tracker.observe(steps[row])
        if frame is None:
            return np.nan
        return half_turn_ratio(tracker.body, pose_of(row), frame, tracker.matching)

    ratios = np.array(side_by_side(ratio, np.unique(rows).tolist()))
    return float(np.nanmedian(ratios)) if np.isfinite(ratios).any() else np.nan
