"""One camera on recordings that nobody tuned on.

    python -m benchmarks.unseen LIB RECORDING ... [--facing]

Tracks the only camera of every RECORDING (a folder with truth.json) with the pose library LIB, with
the proposal that comes with the program if LIB is `program`, or as `track --method paper` if it is
`paper`; with the true stature and no assumption about the start, or with --facing as `track` begins
unless told. Prints a row each, the median and the 90th percentile, and how often hypotheses of a
probability are right: within 100 mm of the truth, relative to the pelvis. "uncovered" is the share
of frames in which something of the true silhouette lies 100 mm or more from the drawn body, such as
a hand that the pose has elsewhere. Results are kept in out/unseen, by the names of the library, the
recording and its parent folder, and are not made again.
"""

import csv
import json
import sys
from collections import defaultdict
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.estimator import Settings
from silhouette_core.image.raster import render_parts
from silhouette_core.image.silhouettes import UndistortedView
from silhouette_core.motion.joint_files import read_joints
from silhouette_core.motion.kinematics import rotation_matrices
from silhouette_core.motion.motion_file import read_motion
from silhouette_core.motion.pose import Pose
from silhouette_core.scoring.silhouette_error import posed_mesh
from voxelpose.evaluation import score_motion
from voxelpose.fitting import Output, fit
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import read_truth

OUT = Path(__file__).resolve().parents[1] / "out" / "unseen"
UNCOVERED_M = 0.10
COLUMNS = ("mpjpe_mm", "root_mm", "pa_mm", "flips", "lost")
EDGES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0001)
RIGHT_M = 0.10


def track(library: Path, folder: Path, start: str) -> Path:
    """Result of a recording, made if it is not there."""
    kept = library.stem if start == "any" else f"{library.stem}_{start}"
    result = OUT / kept / f"{folder.parent.name}_{folder.name}"
    if not (result / "joints.csv").exists():
        stature_m = json.loads((folder / "truth.json").read_text())["stature"]
        options: dict[str, bool | int | float | str] = {"start": start}
        settings, estimator = Settings(stature_m=stature_m, threads=1), "monocular"
        if str(library) == "paper":
            estimator = "tree"
        elif str(library) != "program":
            options["library"] = str(library)
        settings = replace(settings, options=options)
        fit(Recording.open(folder), Output(result, overwrite=True), settings, estimator)
    return result


def hypotheses(result: Path, truth: np.ndarray) -> list[tuple[float, bool]]:
    """Probability of every hypothesis, and whether it is right."""
    poses: dict[tuple[int, int], dict[str, list[float]]] = defaultdict(dict)
    probability: dict[tuple[int, int], float] = {}
    with (result / "hypotheses.csv").open(newline="") as lines:
        for row in csv.DictReader(lines):
            key = int(row["frame"]), int(row["rank"])
            probability[key] = float(row["probability"])
            poses[key][row["joint"]] = [float(row[f"{axis}_m"]) for axis in "xyz"]
    found = []
    for (frame, number), joints in poses.items():
        pose = np.array([joints[name] for name in LANDMARK_NAMES])
        error = (pose - pose[0]) - (truth[frame] - truth[frame, 0])
        right = bool(np.linalg.norm(error, axis=-1).mean() < RIGHT_M)
        found.append((probability[frame, number], right))
    return found


def uncovered(result: Path, recording: Recording) -> float:
    """Share of frames with something uncovered, of a result with a pose for each frame."""
    motion = read_motion(result / "motion.safetensors")
    (camera,) = recording.rig
    lens = UndistortedView.from_camera(camera, None)
    view = lens.pinhole
    with np.load(recording.folder / "masks" / "masks.npz") as file:
        packed, width = file[camera.name], int(file["width"])
    rotations, found = rotation_matrices(motion.root_quaternion), []
    for bits, *pose in zip(packed, motion.root_m, rotations, motion.angles_rad, strict=True):
        true = lens.undistort(np.unpackbits(bits, axis=1, count=width).view(np.bool_))
        vertices = posed_mesh(motion.model, Pose(*pose)) @ view.rotation.T + view.translation
        parts, _ = render_parts(
            vertices, motion.model.faces, motion.model.face_part, view.matrix, view.size
        )
        away_px = cv2.distanceTransform((parts == 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
        depth_m = (view.rotation @ pose[0] + view.translation)[2]
        found.append(away_px[true].max(initial=0) * depth_m / view.matrix[0, 0] >= UNCOVERED_M)
    return float(np.mean(found))


def main(arguments: list[str]) -> int:
    """Tracks and scores the recordings."""
    if len(arguments) < 2:
        print(__doc__, file=sys.stderr)
        return 2
    start = "facing" if "--facing" in arguments else "any"
    library, *folders = (Path(name) for name in arguments if name != "--facing")
    print(
        f"{'recording':<14}"
        + "".join(f"{column:>10}" for column in COLUMNS)
        + "  |XOR|/|OR|  uncovered"
    )
    rows: list[list[float]] = []
    answers: list[tuple[float, bool]] = []
    for folder in folders:
        result, truth = track(library, folder, start), read_truth(folder / "truth.json")
        score = score_motion(truth, read_joints(result / "joints.csv", len(truth)))
        quality = json.loads((result / "summary.json").read_text())["quality"]
        error = 1 - quality["outline_agreement"]["median"]
        shares = [error, uncovered(result, Recording.open(folder))]
        rows.append([*(getattr(score, column) for column in COLUMNS), *shares])
        answers += hypotheses(result, truth)
        print(f"{folder.name:<14}" + "".join(f"{value:>10.2f}" for value in rows[-1]), flush=True)
    for name, share in (("median", 50), ("90 %", 90)):
        values = np.percentile(np.array(rows), share, axis=0)
        print(f"{name:<14}" + "".join(f"{value:>10.2f}" for value in values))
    print("means         " + "".join(f"{value:>10.2f}" for value in np.mean(rows, axis=0)))
    said, right = np.array(answers).T
    print("probability from .. to, its mean, share right, hypotheses")
    for low, high in pairwise(EDGES):
        own = (said >= low) & (said < high)
        if own.any():
            span = f"{low:.1f} to {min(high, 1):.1f}"
            print(f"{span}  {said[own].mean():.2f}  {right[own].mean():.2f}  {own.sum()}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
