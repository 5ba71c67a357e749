"""Fits and checks the errors that results say are to be expected.

`python -m benchmarks.expected_error OUT RECORDING ...` fits each recording into OUT (those that are
there are kept; the truth is read from truth.json) and prints what was said beside what was: a
reliability table over the joints and one over the frames, and a line per recording. With `--fit
[near] [error] [right]`, these weights of `voxelpose.multiview.quality.quality` (by default
all) are estimated anew from these recordings, written into its file with a statement of how, and
judged on recordings left out (each seventh).
"""

import argparse
import json
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.weights_file import write_weights
from calib.errors import InputError
from voxelpose.fitting import Output, fit
from voxelpose.multiview.quality.quality import (
    ADDED_MM,
    FILE,
    NEAR_MM,
    RIGHT_MM,
    MotionEvidence,
    logistic,
    regressors,
)
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import TRUTH, read_truth
from voxelpose.reliability import verdict_of
from voxelpose.results import Result

_REGRESSIONS = ("near", "error", "right")
_COMMAND = "python -m benchmarks.expected_error OUT RECORDING ... --fit"
_FOLDS = 7
_BINS = (0.0, 0.3, 0.6, 0.8, 0.88, 0.92, 0.96, 1.0 + 1e-9)


def result_of(recording: Path, out: Path) -> Path | None:
    """Result of a recording, made if it is not there; None where it cannot be fitted."""
    folder = out / f"{recording.parent.name}_{recording.name}"
    if not (folder / "summary.json").exists():
        try:
            fit(Recording.open(recording), Output(folder, pictures=False))
        except InputError as error:
            print(f"{folder.name}: no result ({str(error)[:60]} ...)", flush=True)
            return None
    return folder


def sample(recording: Path, folder: Path) -> dict[str, np.ndarray]:
    """Regressors, what is said, and true errors of the frames of a recording's result."""
    result, truth = Result.open(folder), read_truth(recording / TRUTH)
    motion, quality = result.motion, result.motion.quality
    summary = json.loads((folder / "summary.json").read_text())
    joints, frames = regressors(
        MotionEvidence.from_motion(motion, summary["facts"]["half_turn_ratio"])
    )
    estimate, true = motion.landmarks(), truth[motion.frames]
    error = 1000 * np.linalg.norm(estimate - true, axis=2)
    relative = (estimate - estimate[:, :1]) - (true - true[:, :1])
    root = 1000 * np.linalg.norm(relative, axis=2).mean(axis=1)
    verdict = verdict_of(summary)
    known = np.isfinite(frames).all(axis=1)
    print(
        f"{folder.name}: root_mm {root.mean():.0f}, said"
        f" {np.nanmean(quality['joint_error_mm']):.0f} mm, right with"
        f" {np.median(quality['right_probability']):.2f}, {len(motion)} of {len(truth)} frames,"
        f" half turn {summary['facts']['half_turn_ratio']}: {verdict.level}",
        flush=True,
    )
    return {
        "joints": joints[known],
        "frames": frames[known],
        "said": quality["landmark_confidence"][known],
        "said_right": quality["right_probability"][known],
        "said_mm": quality["joint_error_mm"][known],
        "error": error[known],
        "root": root[known],
    }


def logistic_regression(inputs: np.ndarray, outcome: np.ndarray, ridge: float) -> np.ndarray:
    """Weights by Newton's method, with a penalty ridge / 2 * |weights|^2."""
    weights = np.zeros(inputs.shape[1])
    for _ in range(50):
        probability = logistic(inputs @ weights)
        gradient = inputs.T @ (probability - outcome) + ridge * weights
        curvature = (inputs.T * (probability * (1 - probability))) @ inputs
        weights -= np.linalg.solve(curvature + ridge * np.eye(len(weights)), gradient)
    return weights


def reliability_rows(said: np.ndarray, was: np.ndarray) -> list[list[str]]:
    """What was said beside what was: range, number, mean of what was said, share that was."""
    rows = []
    for low, high in pairwise(_BINS):
        chosen = (said >= low) & (said < high)
        if chosen.any():
            means = f"{said[chosen].mean():.3f}", f"{was[chosen].mean():.3f}"
            rows.append([f"{low:.2f} to {min(high, 1):.2f}", str(chosen.sum()), *means])
    return rows


def reliability(title: str, said: np.ndarray, was: np.ndarray) -> None:
    """Prints what was said beside what was."""
    print(f"\n{title}\n\n| said | of | mean of what was said | was |\n|---|---|---|---|")
    for row in reliability_rows(said, was):
        print(f"| {' | '.join(row)} |")


def recordings_used(recordings: Sequence[Path]) -> str:
    """What a file of weights states as its data."""
    return ", ".join(f"{recording.parent.name}/{recording.name}" for recording in recordings)


def main() -> None:
    """Runs the fits and prints the tables."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("out", type=Path)
    words.add_argument("recordings", nargs="+", type=Path)
    words.add_argument("--fit", nargs="*", choices=_REGRESSIONS)
    given = words.parse_args()
    results = [(recording, result_of(recording, given.out)) for recording in given.recordings]
    samples = [sample(recording, folder) for recording, folder in results if folder is not None]
    owner = np.repeat(np.arange(len(samples)), [len(one["frames"]) for one in samples])
    joints, frames, error, root, said_near, said_right, said_mm = (
        np.concatenate([one[name] for one in samples])
        for name in ("joints", "frames", "error", "root", "said", "said_right", "said_mm")
    )
    near, right = (error < NEAR_MM).astype(float), (root < RIGHT_MM).astype(float)
    if given.fit is not None:
        rows = joints.reshape(-1, joints.shape[2])
        target = np.log(error + ADDED_MM).ravel()
        ridge = 0.1 * np.eye(rows.shape[1])
        fitted = {
            "near": logistic_regression(rows, near.ravel(), 1.0),
            "error": np.linalg.solve(rows.T @ rows + ridge, rows.T @ target),
            "right": logistic_regression(frames, right, 0.3),
        }
        chosen = {name: fitted[name] for name in given.fit or _REGRESSIONS}
        write_weights(FILE, chosen, recordings_used(given.recordings), _COMMAND)
        for fold in range(_FOLDS):
            left = owner % _FOLDS == fold
            used = ~np.repeat(left, 15)
            weights = logistic_regression(rows[used], near.ravel()[used], 1.0)
            said_near[left] = logistic(joints[left] @ weights)
            weights = logistic_regression(frames[~left], right[~left], 0.3)
            said_right[left] = logistic(frames[left] @ weights)
            curvature = rows[used].T @ rows[used] + ridge
            weights = np.linalg.solve(curvature, rows[used].T @ target[used])
            said_mm[left] = np.maximum(np.exp(joints[left] @ weights) - ADDED_MM, 1.0)
    reliability(f"joints within {NEAR_MM:.0f} mm", said_near.ravel(), near.ravel())
    reliability(f"frames with a mean error below {RIGHT_MM:.0f} mm", said_right, right)
    below = error < said_mm
    print(f"\nerrors below the median that was said: {below.mean():.3f}")


if __name__ == "__main__":
    main()
