"""hypotheses.csv: the most probable poses of every frame, as joint positions."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.documents import csv_rows
from calib.errors import InputError
from silhouette_core.body.joints import HUMAN
from silhouette_core.body.kinematic_tree import KinematicTree
from voxelpose.export.tables import FARTHEST_M

HYPOTHESES = "hypotheses.csv"
_COLUMNS = ("frame", "rank", "probability", "joint", "x_m", "y_m", "z_m")
_LARGEST_BYTES = 1_000_000_000


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One of several possible poses of a frame.

    Attributes:
        rank: position in the order of probability, 1 for the most probable.
        probability: probability from 0 to 1.
        joints_m: (L, 3) float64, world, metres, in the order of the body's landmarks; NaN where
            the file has no row.
        bones: (B, 2) int, pairs of joints between which a bone is drawn.
    """

    rank: int
    probability: float
    joints_m: NDArray[np.float64]
    bones: NDArray[np.integer]


def write_hypotheses(
    hypotheses: Iterable[tuple[int, NDArray, NDArray]], path: Path, tree: KinematicTree = HUMAN
) -> None:
    """Writes one row per frame, hypothesis and joint: frame,rank,probability,joint,x_m,y_m,z_m.

    Args:
        hypotheses: frame number, probabilities (n,) in descending order, and joint positions
            (n, L, 3), world, metres, of every frame.
        tree: of the body, with L landmarks; by default a person's.
    """
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write("frame,rank,probability,joint,x_m,y_m,z_m\n")
        for frame, probability, joints in hypotheses:
            for rank, (weight, points) in enumerate(zip(probability, joints, strict=True), 1):
                for name, (x, y, z) in zip(tree.landmark_names, points, strict=True):
                    file.write(f"{frame},{rank},{weight:.4f},{name},{x:.4f},{y:.4f},{z:.4f}\n")


def read_hypotheses(path: Path, tree: KinematicTree = HUMAN) -> dict[int, tuple[Hypothesis, ...]]:
    """Reads the hypotheses of every frame number, the most probable first.

    Args:
        path: the CSV file; a missing file gives no hypotheses.
        tree: as of `write_hypotheses`.

    Raises:
        InputError: the file is damaged.
    """
    if not path.exists():
        return {}
    names = tree.landmark_names
    joints: dict[tuple[int, int], NDArray[np.float64]] = defaultdict(
        lambda: np.full((len(names), 3), np.nan)
    )
    probability: dict[tuple[int, int], float] = {}
    for line, row in enumerate(csv_rows(path, _COLUMNS, _LARGEST_BYTES), 2):
        try:
            if row["joint"] not in names:
                raise ValueError(f"there is no joint {row['joint'][:40]}")
            key = int(row["frame"]), int(row["rank"])
            position = np.array([float(row[axis]) for axis in ("x_m", "y_m", "z_m")])
            probability[key] = float(row["probability"])
            joints[key][names.index(row["joint"])] = position
            if not (0 <= probability[key] <= 1 and (np.abs(position) <= FARTHEST_M).all()):
                raise ValueError("no probability or position")
        except (KeyError, ValueError) as error:
            raise InputError(
                f"{path} line {line} is damaged ({' '.join(str(error).split())[:100]}): fit again,"
                " or remove it"
            ) from None
    hypotheses: dict[int, tuple[Hypothesis, ...]] = {}
    bones = tree.landmark_bones
    for frame, rank in sorted(joints):
        hypothesis = Hypothesis(rank, probability[frame, rank], joints[frame, rank], bones)
        hypotheses[frame] = (*hypotheses.get(frame, ()), hypothesis)
    return hypotheses
