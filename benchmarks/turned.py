"""Fits in worlds of other axes: `python -m benchmarks.turned RECORDING [-z y x first ...]`.

The calibration is given other axes (the named one becomes what z was; `first`: the frame of the
first camera), its origin is moved, and the recording fitted. A line each: up as found, its error in
degrees, the floor's error in metres, and the mean error of the joints relative to the pelvis, mm.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from calib.camera import Rig
from calib.upright import AXES, Z_UP, UprightFrame, axis_name
from voxelpose.evaluation import score_motion
from voxelpose.fitting import Output, fit
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import TRUTH, read_truth

_MOVED_M = np.array([0.3, -0.2, 0.5])  # the origin, for the named axes


def turned(rig: Rig, axes: str) -> tuple[Rig, np.ndarray, np.ndarray]:
    """The cameras in a world of other axes, and rotation and origin of that world."""
    if axes == "first":
        first = rig.cameras[0]
        rotation, origin_m = first.rotation, first.center_m
    else:
        rotation, origin_m = UprightFrame.from_up(AXES[axes]).rotation.T, _MOVED_M
    cameras = [
        replace(
            camera,
            rotation=camera.rotation @ rotation.T,
            translation=camera.translation + camera.rotation @ origin_m,
        )
        for camera in rig
    ]
    return Rig(tuple(cameras)), rotation, origin_m


def main(folder: Path, worlds: list[str]) -> None:
    """Fits a recording in each world."""
    recording, truth = Recording.open(folder), read_truth(folder / TRUTH)
    for axes in worlds:
        rig, rotation, origin_m = turned(recording.rig, axes)
        with tempfile.TemporaryDirectory() as out:
            output = Output(Path(out) / "fit", pictures=False)
            motion = fit(replace(recording, rig=rig, up=None), output).motion
        joints = motion.landmarks() @ rotation + origin_m
        score = score_motion(truth[motion.frames], joints)
        angle = np.degrees(np.arccos(np.clip(motion.up @ rotation @ Z_UP, -1, 1)))
        floor_m = motion.floor_m + origin_m @ rotation.T @ motion.up
        print(
            f"{axes:>5}: up {axis_name(motion.up)}, {angle:.2f} degrees off; floor"
            f" {floor_m:+.3f} m; root_mm {score.root_mm:.1f}",
            flush=True,
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:] or ["z", "-z", "y", "first"])
