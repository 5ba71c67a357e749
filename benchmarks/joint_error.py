"""Checks the errors that `track` says are to be expected, and estimates their weights.

`python -m benchmarks.joint_error LIB RECORDING ...` tracks the only camera of every RECORDING as
`benchmarks.unseen` does (results that are there are kept) and prints what was said beside what was:
probabilities of joints to be within 30 mm, errors below the median that was said, and verdicts by
the true error. With `--fit`, the weights of
`silhouette_core.monocular.tracking.joint_error` are estimated from these recordings and written
into its file, with a statement of how.
"""

import argparse
import json
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.expected_error import recordings_used, reliability
from benchmarks.unseen import track
from benchmarks.weights_file import write_weights
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.monocular.tracking.joint_error import (
    ADDED_MM,
    FILE,
    NEAR_MM,
    error_evidence,
    hypothesis_spread,
    joint_errors,
)
from silhouette_core.motion.joint_files import read_joints
from silhouette_core.motion.motion_file import read_motion
from voxelpose.recording.truth import read_truth
from voxelpose.reliability import verdict_of

_COMMAND = "python -m benchmarks.joint_error LIB RECORDING ... --fit"
EDGES = (0, 60, 100, 150, np.inf)


def spreads(result: Path, frames: np.ndarray) -> np.ndarray:
    """Spread (T, 15) of the hypotheses of frames (T,), m."""
    rows = np.genfromtxt(result / "hypotheses.csv", delimiter=",", names=True, dtype=None)
    names = {name: k for k, name in enumerate(LANDMARK_NAMES)}
    found = []
    for frame in frames:
        one = rows[rows["frame"] == frame]
        ranks, rank = np.unique(one["rank"], return_inverse=True)
        joints, probability = np.empty((len(ranks), len(names), 3)), np.empty(len(ranks))
        column = [names[name] for name in one["joint"]]
        joints[rank, column] = np.stack([one["x_m"], one["y_m"], one["z_m"]], axis=1)
        probability[rank] = one["probability"]
        found.append(hypothesis_spread(probability, joints))
    return np.array(found)


def sample(library: Path, recording: Path) -> dict[str, np.ndarray]:
    """Evidence and true errors of the frames of a recording, and its verdict."""
    result = track(library, recording)
    motion, truth = read_motion(result / "motion.safetensors"), read_truth(recording / "truth.json")
    estimate = read_joints(result / "joints.csv", len(truth))[motion.frames]
    true = truth[motion.frames]
    occluded = motion.quality["occluded"][:, motion.model.tree.landmark_part]
    agreement = np.asarray(motion.quality["outline_agreement"])
    relative = (estimate - estimate[:, :1]) - (true - true[:, :1])
    evidence = spreads(result, motion.frames), agreement, occluded
    said = joint_errors(*evidence)
    summary = json.loads((result / "summary.json").read_text())
    summary["quality"]["pose_error_mm"] = {"mean": float(np.mean(said.pose_mm))}
    return {
        "inputs": error_evidence(*evidence).reshape(estimate.shape[0] * estimate.shape[1], -1),
        "world": 1000 * np.linalg.norm(estimate - true, axis=2).ravel(),
        "pose": 1000 * np.linalg.norm(relative, axis=2).ravel(),
        "said_mm": said.joint_mm.ravel(),
        "near": said.near_probability.ravel(),
        "doubtful": np.array([verdict_of(summary).level != "reliable"]),
        "root_mm": np.array([1000 * np.linalg.norm(relative, axis=2).mean()]),
    }


def main() -> None:
    """Tracks, and prints tables or weights."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("library", type=Path)
    words.add_argument("recordings", nargs="+", type=Path)
    words.add_argument("--fit", action="store_true")
    given = words.parse_args()
    samples = [sample(given.library, recording) for recording in given.recordings]
    joined = {name: np.concatenate([one[name] for one in samples]) for name in samples[0]}
    if given.fit:
        fitted = {}
        for name in ("world", "pose"):
            wanted = np.log(joined[name] + ADDED_MM)
            fitted[name] = np.linalg.lstsq(joined["inputs"], wanted, rcond=None)[0]
            left = np.std(wanted - joined["inputs"] @ fitted[name])
            print(f"{name}: {left:.3f} is left")
            if name == "world":
                fitted["world_deviation"] = np.array([left])
        write_weights(FILE, fitted, recordings_used(given.recordings), _COMMAND)
        return
    reliability("Joints within 30 mm", joined["near"], joined["world"] <= NEAR_MM)
    print(f"\nErrors below the median said: {(joined['world'] < joined['said_mm']).mean():.3f}")
    print("\n| root_mm | recordings | doubtful |\n|---|---|---|")
    for low, high in pairwise(EDGES):
        chosen = (joined["root_mm"] >= low) & (joined["root_mm"] < high)
        print(f"| {low} to {high} | {chosen.sum()} | {joined['doubtful'][chosen].sum()} |")


if __name__ == "__main__":
    main()
