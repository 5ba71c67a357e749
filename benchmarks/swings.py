"""Swings of the right arm in results of `voxelpose track`, counted as in the arm-swing experiment.

`python -m benchmarks.swings RECORDING RESULT...`: RECORDING holds truth.json. One line per result.
"""

import sys
from pathlib import Path

import numpy as np

from papers.swings import arm_angles, count, split_swings
from silhouette_core.motion.joint_files import read_joints
from voxelpose.recording.truth import read_truth


def main(arguments: list[str]) -> int:
    """Prints verdicts and the mean error of the angle."""
    recording, *results = map(Path, arguments)
    truth = arm_angles(read_truth(recording / "truth.json"))
    for result in results:
        found = arm_angles(read_joints(result / "joints.csv", len(truth)))
        error = float(np.nanmean(np.abs(found - truth)))
        print(result.name, count(truth, found, split_swings(truth)), f"{error:.1f} degrees")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
