"""The live follower's accuracy without a clock: `python -m benchmarks.follower RECORDING ...
[--side 480] [--starts 0 4 8 12] [--every 1] [--late FACTOR | --first]`.

Every frame is followed, or every so many-th, and searches end before the next one, as on a machine
fast enough. With --late the recording is played forth and back for 18 s, and what a search finds is
handed over as late as the search takes here, times the factor: as on a slow one. Then the mean of
the last 5 s is printed. Printed is the mean error of the joints relative to the pelvis, mm, begun
at several frames. With --first nothing is followed, and each of these frames has its first pose.
"""

from __future__ import annotations

import argparse
import json
import time
from concurrent.futures import Executor, Future
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.estimator import Settings
from silhouette_core.image.silhouettes import Silhouettes, UndistortedView
from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.motion.pose import Pose, PoseArrays
from voxelpose.multiview.matching.pose_search import FEW_PLACEMENTS
from voxelpose.multiview.tracking.body_track import Moment
from voxelpose.multiview.tracking.follower import PoseFollower, search
from voxelpose.recording.folder import Recording

_PLAYED_S, _COUNTED_S = 18.0, 5.0


class AtOnce(Executor):
    """Does what is submitted before it returns."""

    def submit(self, fn, /, *args, **kwargs):
        future: Future = Future()
        future.set_result(fn(*args, **kwargs))
        return future


class Late(Executor):
    """Does what is submitted at once, and hands it over as late as it took, times a factor.

    Attributes:
        now_s: the present, to be set.
    """

    def __init__(self, factor: float):
        self.now_s = 0.0
        self._factor = factor
        self._waiting: list[tuple[float, Future, object]] = []

    def submit(self, fn, /, *args, **kwargs):
        begun_s, future = time.perf_counter(), Future()
        result = fn(*args, **kwargs)
        took_s = self._factor * (time.perf_counter() - begun_s)
        self._waiting.append((self.now_s + took_s, future, result))
        return future

    def hand_over(self, now_s: float) -> None:
        """Sets the present, and completes what is due."""
        self.now_s = now_s
        for due_s, future, result in self._waiting:
            if due_s <= now_s:
                future.set_result(result)
        self._waiting = [one for one in self._waiting if one[0] > now_s]


def silhouettes(recording: Recording, side_px: int) -> tuple[Rig, list[dict[str, NDArray]]]:
    """Pinhole cameras, and the silhouettes of every frame by camera name."""
    lenses = [UndistortedView.from_camera(camera, side_px) for camera in recording.rig]
    subtraction = Silhouettes(recording, "auto", side_px)
    masks = []
    for _, _, frames in recording:
        seen = subtraction.of(frames)
        names = zip(lenses, recording.rig, strict=True)
        masks.append({camera.name: lens.undistort(seen[camera.name]) for lens, camera in names})
    return Rig(tuple(lens.pinhole for lens in lenses)), masks


def off_mm(model: BodyModel, pose: Pose, joints_m: NDArray) -> float:
    """Mean error of a pose's joints relative to the pelvis."""
    found = landmarks(model, *place(model, *PoseArrays.from_poses([pose]).arrays))[0]
    off = (found - found[0]) - (joints_m - joints_m[0])
    return 1000 * float(np.linalg.norm(off, axis=1).mean())


def first_pose_mm(rig: Rig, settings: Settings, masks: dict, joints_m: NDArray) -> float:
    """Error of the pose that a search finds in a frame; nan where it finds none."""
    track = search(rig, settings, None, Moment.of(0.0, masks), FEW_PLACEMENTS)
    return np.nan if track is None else off_mm(track.body.model, track.fit.pose, joints_m)


def main() -> None:
    """Follows the recordings."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("recordings", type=Path, nargs="+")
    words.add_argument("--side", type=int, default=480)
    words.add_argument("--starts", type=int, nargs="+", default=[0, 4, 8, 12])
    words.add_argument("--every", type=int, default=1)
    words.add_argument("--late", type=float)
    words.add_argument("--first", action="store_true")
    given = words.parse_args()
    for folder in given.recordings:
        recording = Recording.open(folder)
        truth = json.loads((folder / "truth.json").read_text())
        joints = np.stack([np.array(truth["joints"][name]) for name in LANDMARK_NAMES], axis=1)
        rig, masks = silhouettes(recording, given.side)
        rows, settings = list(range(len(masks))), Settings(stature_m=truth["stature"])
        if given.first:
            searched = rows[:: given.every]
            off = [first_pose_mm(rig, settings, masks[k], joints[k]) for k in searched]
            print(folder.name, " ".join(f"{one:.0f}" for one in off), flush=True)
            continue
        counted = len(rows)
        if given.late is not None:
            counted = round(_COUNTED_S * recording.fps)
            there_and_back = rows + rows[-2:0:-1]
            rows = [
                there_and_back[k % len(there_and_back)]
                for k in range(round(_PLAYED_S * recording.fps))
            ]
        means = []
        for start in given.starts:
            executor = AtOnce() if given.late is None else Late(given.late)
            follower, errors = PoseFollower(rig, settings, executor), []
            for k in range(start, len(rows), given.every):
                if isinstance(executor, Late):
                    executor.hand_over(k / recording.fps)
                fit, body = follower.step(k / recording.fps, masks[rows[k]]), follower.body
                if fit is None or body is None or k < len(rows) - counted:
                    continue
                errors.append(off_mm(body.model, fit.pose, joints[rows[k]]))
            means.append(np.mean(errors) if errors else np.nan)
        print(folder.name, " ".join(f"{mean:.1f}" for mean in means), flush=True)


if __name__ == "__main__":
    main()
