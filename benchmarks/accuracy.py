"""Scores estimates against recordings with a truth: python -m benchmarks.accuracy [ROW ...]

A row is a recording fitted from all its cameras (walk4); RECORDING:CAMERA, tracked from that one
(turn1:cam_0); or made:NAME, a recording that datasets/made/recipes.toml describes, rendered once
into out/made. The program's proposal has not learned the motion of the rows with one camera. Left
out: all rows whose recordings are there. The shared recordings are in ../shared/data, or in
$VOXELPOSE_SHARED/data; the made ones need nothing. One line per row on stdout; results in
out/accuracy/ROW.
"""

import json
import os
import sys
import time
from pathlib import Path

from benchmarks.recipes import read_recipes
from silhouette_core.estimator import Settings
from silhouette_core.motion.joint_files import read_joints
from voxelpose.evaluation import score_motion
from voxelpose.fitting import Output, fit
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import read_truth

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "out" / "accuracy"
SHARED = Path(os.environ.get("VOXELPOSE_SHARED", ROOT.parent / "shared"))
ONE_CAMERA = (
    *("swing1:cam_0", "turn1:cam_0", "traffic4:cam_0", "walk4:cam_1"),
    *(f"balancing4:cam_{number}" for number in (1, 2, 3, 4)),
)
SHARED_ROWS = ("walk4", "traffic4", "dance8", "balancing4", *ONE_CAMERA)
RECIPES = read_recipes(ROOT / "datasets" / "made" / "recipes.toml")
MADE_ROWS = tuple(f"made:{name}" for name in RECIPES)
COLUMNS = (
    "mpjpe_mm",
    "root_mm",
    "pa_mm",
    "angle_deg",
    "jitter_mm",
    "jitter_truth_mm",
    "flips",
    "lost",
)


def all_rows() -> tuple[str, ...]:
    """Rows whose recordings are there."""
    return (*(SHARED_ROWS if (SHARED / "data").is_dir() else ()), *MADE_ROWS)


def _is_there(row: str) -> bool:
    return row in MADE_ROWS or (SHARED / "data" / row.split(":")[0] / "truth.json").is_file()


def open_row(row: str) -> Recording:
    """The recording of a row, with the cameras that are used."""
    name, _, camera = row.partition(":")
    if name == "made":
        return Recording.open(RECIPES[camera].render(ROOT / "out" / "made" / camera))
    return Recording.open(SHARED / "data" / name, cameras=(camera,) if camera else None)


def main(rows: list[str]) -> int:
    """Estimates and scores rows."""
    unknown = [row for row in rows if not _is_there(row)]
    if unknown:
        there = ", ".join(all_rows())
        print(f"no recording of {', '.join(unknown)}; there are {there}", file=sys.stderr)
        return 2
    header = "".join(f"{column:>16}" for column in COLUMNS)
    print(f"{'row':<29}{'frames':>7}{header}{'s/frame':>9}", flush=True)
    for row in rows or all_rows():
        recording = open_row(row)
        truth_file = recording.folder / "truth.json"
        stature_m = json.loads(truth_file.read_text()).get("stature")
        result = OUT / row.replace(":", "_")
        started = time.perf_counter()
        fit(
            recording,
            Output(result, overwrite=True),
            Settings(stature_m=stature_m),
            "monocular" if len(recording.rig) == 1 else "multiview",
        )
        per_frame_s = (time.perf_counter() - started) / recording.frame_count
        truth = read_truth(truth_file)
        score = score_motion(truth, read_joints(result / "joints.csv", len(truth)))
        values = "".join(f"{getattr(score, column):>16.2f}" for column in COLUMNS)
        print(f"{row:<29}{score.frames:>7}{values}{per_frame_s:>9.2f}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
