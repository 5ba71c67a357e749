"""Estimates the motion of the shared recordings and scores it: python -m benchmarks.accuracy [ROW
...]

A row is a recording, fitted from all its cameras (walk4), or RECORDING:CAMERA, tracked from that
one (turn1:cam_0), or RECORDING:CAMERA:default, likewise with the default library; left out: all of
`ROWS`. Where no library is named, tracking uses one of the shared motion without the clips of these
recordings, made once in out/accuracy (about ten minutes). A line per row on stdout; results under
out/accuracy/ROW. The recordings are in ../shared/data, or in $VOXELPOSE_SHARED/data.
"""

import json
import os
import sys
import time
from pathlib import Path

from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.estimator import Settings
from silhouette_core.library.from_motion import make_library, read_clips
from silhouette_core.library.pose_library import LibrarySettings
from voxelpose.evaluation import read_joints, read_truth, score_motion
from voxelpose.fitting import Output, fit
from voxelpose.recording.folder import Recording

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "out" / "accuracy"
SHARED = Path(os.environ.get("VOXELPOSE_SHARED", ROOT.parent / "shared"))
ONE_CAMERA = ("swing1:cam_0", "turn1:cam_0", "traffic4:cam_0", "walk4:cam_1")
ROWS = (
    "walk4",
    "traffic4",
    "dance8",
    "balancing4",
    *ONE_CAMERA,
    *(f"{row}:default" for row in ONE_CAMERA),
)
LEFT_OUT = ("007_01", "005_06", "directing_traffic_1")
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


def held_out_library() -> Path:
    """Returns the library of the shared motion that does not hold the recorded movements."""
    path = OUT / "held_out.vplib"
    if not path.exists():
        print(f"making {path} once ...", file=sys.stderr, flush=True)
        path.parent.mkdir(parents=True, exist_ok=True)
        model = BodyModel.from_sizes(BodySizes(1.75))
        make_library(
            read_clips([SHARED / "data" / "mocap"], model, leave_out=LEFT_OUT),
            model,
            path,
            LibrarySettings(),
        )
    return path


def main(rows: list[str]) -> int:
    """Estimates and scores every row."""
    if not (SHARED / "data").is_dir():
        print(f"no recordings in {SHARED / 'data'}: set VOXELPOSE_SHARED", file=sys.stderr)
        return 2
    print(
        f"{'row':<24}{'frames':>7}"
        + "".join(f"{column:>16}" for column in COLUMNS)
        + f"{'s/frame':>9}",
        flush=True,
    )
    for row in rows or ROWS:
        name, camera, library = (*row.split(":"), "", "")[:3]
        folder = SHARED / "data" / name
        stature_m = json.loads((folder / "truth.json").read_text()).get("stature")
        recording = Recording.open(folder, cameras=(camera,) if camera else None)
        options = {"library": str(held_out_library())} if camera and library != "default" else {}
        result = OUT / row.replace(":", "_")
        started = time.perf_counter()
        settings = Settings(stature_m=stature_m, options=options)
        fit(
            recording,
            Output(result, overwrite=True),
            settings,
            "monocular" if camera else "multiview",
        )
        per_frame_s = (time.perf_counter() - started) / recording.frame_count
        truth = read_truth(folder / "truth.json")
        score = score_motion(truth, read_joints(result / "joints.csv", len(truth)))
        print(
            f"{row:<24}{score.frames:>7}"
            + "".join(f"{getattr(score, column):>16.2f}" for column in COLUMNS)
            + f"{per_frame_s:>9.2f}",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
