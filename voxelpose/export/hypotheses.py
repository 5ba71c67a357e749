"""hypotheses.csv: the likeliest poses of every frame, as the joints of joints.csv with their probabilities."""

from collections.abc import Iterable
from pathlib import Path

from numpy.typing import NDArray

from silhouette_core.body.joints import LANDMARK_NAMES

HYPOTHESES = "hypotheses.csv"


def write_hypotheses(hypotheses: Iterable[tuple[int, NDArray, NDArray]], path: Path) -> None:
    """Writes a row per frame, hypothesis and joint, world coordinates in metres; rank 1 is the likeliest.

    Args:
        hypotheses: frame number, probabilities (n,), falling, and joints (n, 15, 3), m.
        path: the CSV file.
    """
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write("frame,rank,probability,joint,x_m,y_m,z_m\n")
        for frame, probability, joints in hypotheses:
            for rank, (share, places) in enumerate(zip(probability, joints, strict=True), 1):
                for name, (x, y, z) in zip(LANDMARK_NAMES, places, strict=True):
                    file.write(f"{frame},{rank},{share:.4f},{name},{x:.4f},{y:.4f},{z:.4f}\n")
