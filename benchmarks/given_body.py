"""Fits shared recordings with the body that they show: python -m benchmarks.given_body [NAME ...]

The bodies are MakeHuman's, by the parameters with which ../shared/data was rendered as far as the
truth tells them: stature and lengths of the limbs agree to 0.02 mm. They do not tell weight and
muscle, which are taken as average. Every recording is fitted without a body (row NAME:estimated),
with the given one on the human tree (NAME:human) and with the given one on MakeHuman's own rig
(NAME:cmu_mb). body_mm is the mean error of the lengths of ten bones of the limbs and hips of the
body that was fitted, and so no error of the pose. Results in out/given_body/ROW.
"""

import json
import os
import sys
import time
from pathlib import Path

import numpy as np

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.body.rigs.makehuman import MakeHumanPerson, read_makehuman
from silhouette_core.estimator import Settings
from silhouette_core.motion.joint_files import read_joints
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import write_motion
from voxelpose.evaluation import score_motion
from voxelpose.fitting import Output, fit
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import read_truth

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "out" / "given_body"
SHARED = Path(os.environ.get("VOXELPOSE_SHARED", ROOT.parent / "shared"))
PEOPLE = {
    "walk4": MakeHumanPerson("male"),
    "dance8": MakeHumanPerson("female", height=-0.2),
    "traffic4": MakeHumanPerson("male", height=0.15),
}
BODIES = "estimated", "human", "cmu_mb"
LIMBS = [
    (f"{side}_{first}", f"{side}_{second}")
    for side in ("left", "right")
    for first, second in (
        ("hip", "knee"),
        ("knee", "ankle"),
        ("shoulder", "elbow"),
        ("elbow", "wrist"),
    )
] + [("left_hip", "pelvis"), ("right_hip", "pelvis")]


def body_error_mm(joints_m: np.ndarray, truth_m: np.ndarray) -> float:
    """Mean absolute error of the lengths of the limb bones, medians over the frames.

    Args:
        joints_m: (T, 15, 3) found, NaN where there is no pose.
        truth_m: (T, 15, 3).
    """
    ends = np.array([[LANDMARK_NAMES.index(name) for name in bone] for bone in LIMBS])
    found, true = (
        np.nanmedian(np.linalg.norm(np.diff(x[:, ends], axis=2)[:, :, 0], axis=-1), axis=0)
        for x in (joints_m, truth_m)
    )
    return 1000 * float(np.abs(found - true).mean())


def given(body: BodyModel, path: Path) -> Path:
    """A motion file of one pose that holds the body."""
    path.parent.mkdir(parents=True, exist_ok=True)
    still = Motion(
        30.0,
        body,
        np.zeros((1, 3)),
        np.array([[1.0, 0.0, 0.0, 0.0]]),
        np.zeros((1, body.dof_count)),
        np.zeros(1, np.int64),
        np.zeros(1),
    )
    write_motion(still, path)
    return path


def main(rows: list[str]) -> int:
    """Fits and scores rows."""
    data = SHARED / "data"
    if not (data / "makehuman").is_dir():
        print(f"{data / 'makehuman'} is absent: nothing to fit", file=sys.stderr)
        return 2
    print(
        f"{'row':<20}{'frames':>7}{'root_mm':>9}{'mpjpe_mm':>9}{'pa_mm':>8}{'body_mm':>8}", end=""
    )
    print(f"{'angle_deg':>10}{'flips':>6}{'lost':>6}{'s/frame':>8}", flush=True)
    for row in rows or PEOPLE:
        name, _, only = row.partition(":")
        for kind in (only,) if only else BODIES:
            recording = Recording.open(data / name)
            truth_file = recording.folder / "truth.json"
            stature_m = json.loads(truth_file.read_text())["stature"]
            options = {}
            if kind != "estimated":
                body = read_makehuman(data / "makehuman", PEOPLE[name], human=kind == "human")
                options = {"body": str(given(body, OUT / f"{name}_{kind}.safetensors"))}
                stature_m = None
            result = OUT / f"{name}_{kind}"
            started = time.perf_counter()
            settings = Settings(stature_m=stature_m, options=options)
            output = Output(result, overwrite=True, pictures=kind != "estimated")
            fit(recording, output, settings, "multiview")
            per_frame_s = (time.perf_counter() - started) / recording.frame_count
            truth = read_truth(truth_file)
            joints = read_joints(result / "joints.csv", len(truth))
            s = score_motion(truth, joints)
            print(
                f"{name + ':' + kind:<20}{s.frames:>7}{s.root_mm:>9.2f}{s.mpjpe_mm:>9.2f}"
                f"{s.pa_mm:>8.2f}{body_error_mm(joints, truth):>8.2f}{s.angle_deg:>10.2f}"
                f"{s.flips:>6.2f}{s.lost:>6.2f}{per_frame_s:>8.2f}",
                flush=True,
            )
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
