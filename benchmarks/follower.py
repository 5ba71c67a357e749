"""The live follower's accuracy without a clock: `python -m benchmarks.follower RECORDING ...
[--side 480] [--starts 0 4 8 12] [--every 1]`.

Every frame is followed, or every so many-th, and searches end before the next one, as on a machine
fast enough. Printed
is the mean error of the joints relative to the pelvis, mm, begun at several frames.
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import Executor, Future
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.image.silhouettes import Silhouettes, UndistortedView
from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.motion.pose import PoseArrays
from voxelpose.matching.follower import PoseFollower
from voxelpose.matching.track_jobs import FollowSettings
from voxelpose.recording.folder import Recording


class AtOnce(Executor):
    """Does what is submitted before it returns."""

    def submit(self, fn, /, *args, **kwargs):
        future: Future = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def silhouettes(recording: Recording, side_px: int) -> tuple[Rig, list[dict[str, NDArray]]]:
    """Pinhole cameras, and the silhouettes of every frame by camera name."""
    lenses = [UndistortedView.from_camera(camera, side_px) for camera in recording.rig]
    subtraction = Silhouettes(recording, "refined", side_px)
    masks = []
    for _, _, frames in recording:
        seen = subtraction.of(frames)
        names = zip(lenses, recording.rig, strict=True)
        masks.append({camera.name: lens.undistort(seen[camera.name]) for lens, camera in names})
    return Rig(tuple(lens.pinhole for lens in lenses)), masks


def main() -> None:
    """Follows the recordings."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("recordings", type=Path, nargs="+")
    words.add_argument("--side", type=int, default=480)
    words.add_argument("--starts", type=int, nargs="+", default=[0, 4, 8, 12])
    words.add_argument("--every", type=int, default=1)
    given = words.parse_args()
    for folder in given.recordings:
        recording = Recording.open(folder)
        truth = json.loads((folder / "truth.json").read_text())
        joints = np.stack([np.array(truth["joints"][name]) for name in LANDMARK_NAMES], axis=1)
        rig, masks = silhouettes(recording, given.side)
        means = []
        for start in given.starts:
            follower, errors = PoseFollower(rig, FollowSettings(truth["stature"]), AtOnce()), []
            for row in range(start, len(masks), given.every):
                fit, body = follower.step(row / recording.fps, masks[row]), follower.body
                if fit is None or body is None:
                    continue
                placed = place(body.model, *PoseArrays.from_poses([fit.pose]).arrays)
                found = landmarks(body.model, *placed)[0]
                off = (found - found[0]) - (joints[row] - joints[row][0])
                errors.append(1000 * np.linalg.norm(off, axis=1).mean())
            means.append(np.mean(errors))
        print(folder.name, " ".join(f"{mean:.1f}" for mean in means), flush=True)


if __name__ == "__main__":
    main()
