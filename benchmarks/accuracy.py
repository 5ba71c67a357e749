"""Fits the shared recordings and scores them: python -m benchmarks.accuracy [NAME ...]

A line per recording on stdout; results under out/accuracy/NAME. The recordings are in ../shared/data, or in $VOXELPOSE_SHARED/data.
"""

import json
import os
import sys
import time
from pathlib import Path

from silhouette_core.estimator import Settings
from voxelpose.evaluation import read_joints, read_truth, score_motion
from voxelpose.fitting import Output, fit
from voxelpose.recording import Recording

ROOT = Path(__file__).resolve().parents[1]
SHARED = Path(os.environ.get("VOXELPOSE_SHARED", ROOT.parent / "shared"))
RECORDINGS = ("walk4", "traffic4", "dance8", "balancing4")
COLUMNS = ("mpjpe_mm", "root_mm", "pa_mm", "angle_deg", "jitter_mm", "jitter_truth_mm", "flips", "lost")


def main(names: list[str]) -> int:
    """Fits and scores every named recording."""
    if not (SHARED / "data").is_dir():
        print(f"no recordings in {SHARED / 'data'}: set VOXELPOSE_SHARED", file=sys.stderr)
        return 2
    print(f"{'recording':<12}{'frames':>7}" + "".join(f"{column:>16}" for column in COLUMNS) + f"{'s/frame':>9}", flush=True)
    for name in names or RECORDINGS:
        folder = SHARED / "data" / name
        stature_m = json.loads((folder / "truth.json").read_text()).get("stature")
        recording = Recording.open(folder)
        started = time.perf_counter()
        fit(recording, Output(ROOT / "out" / "accuracy" / name, overwrite=True), Settings(stature_m=stature_m))
        per_frame_s = (time.perf_counter() - started) / recording.frame_count
        truth = read_truth(folder / "truth.json")
        score = score_motion(truth, read_joints(ROOT / "out" / "accuracy" / name / "joints.csv", len(truth)))
        print(
            f"{name:<12}{score.frames:>7}" + "".join(f"{getattr(score, column):>16.2f}" for column in COLUMNS) + f"{per_frame_s:>9.2f}",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
