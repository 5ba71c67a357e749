"""The live follower's accuracy without a clock: `python -m benchmarks.follower RECORDING ...
[--people N] [--side 480] [--starts 0 4 8 12] [--every 1] [--late SECONDS | --first]`.

Every frame is followed, or every so many-th, and searches end before the next one, as on a machine
fast enough. With --late the recording is played forth and back for 18 s, and what a search finds is
handed over so much later, as on a slow one, what catches up a sixtieth of it later for each moment.
Then the mean of the last 5 s is printed. Printed is the mean error of the joints relative to the
pelvis, mm, begun at several frames. With --first nothing is followed, and each of these frames has
its first pose. With --people nothing is told, and each number has a mean, from whoever is nearest,
the share of frames in which it is lost, and how often somebody else becomes the nearest; and then
the processor time of a frame without its searches, in the median.
"""

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
from voxelpose.multiview.people.pose_followers import PoseFollowers
from voxelpose.multiview.proposers.pose_search import FEW_PLACEMENTS
from voxelpose.multiview.tracking.body_track import Moment
from voxelpose.multiview.tracking.follower import PoseFollower, catch_up, search
from voxelpose.recording.folder import Recording

_PLAYED_S, _COUNTED_S = 18.0, 5.0
_CAUGHT_UP = 60  # moments, in the time of a search


class AtOnce(Executor):
    """Does what is submitted before it returns."""

    worked_s = 0.0

    def submit(self, fn, /, *args, **kwargs):
        begun_s, future = time.process_time(), Future()
        future.set_result(fn(*args, **kwargs))
        self.worked_s += time.process_time() - begun_s
        return future


class Late(Executor):
    """Does what is submitted at once, and hands it over as late as a slow machine would.

    Attributes:
        now_s: the present, to be set.
        worked_s: processor time of all that was submitted.
    """

    def __init__(self, search_s: float):
        self.now_s, self.worked_s = 0.0, 0.0
        self._search_s = search_s
        self._waiting: list[tuple[float, Future, object]] = []

    def submit(self, fn, /, *args, **kwargs):
        begun_s, future = time.process_time(), Future()
        result = fn(*args, **kwargs)
        took_s = self._search_s * (len(args[2]) / _CAUGHT_UP if fn is catch_up else 1)
        self.worked_s += time.process_time() - begun_s
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


def joints_of_people(truth: dict) -> NDArray:
    """Joints (N, T, 15, 3) m of everybody of a truth.json, of several people or of one."""
    people = [one["joints"] for one in truth.get("people", [truth])]
    return np.stack(
        [np.stack([np.array(one[name]) for name in LANDMARK_NAMES], axis=1) for one in people]
    )


def follow_people(
    follower: PoseFollowers,
    executor: AtOnce | Late,
    shown: list[tuple[int, dict, NDArray]],
    fps: float,
    first: int,
) -> str:
    """What each number's errors are.

    Args:
        shown: number, silhouettes and people's joints (N, 15, 3) of each frame.
        first: frame from which they count.
    """
    errors: list[list[float]] = [[] for _ in follower.people]
    nearest: list[list[int]] = [[] for _ in follower.people]
    spent_s, counted = [], 0
    for k, masks, people_m in shown:
        if isinstance(executor, Late):
            executor.hand_over(k / fps)
        begun_s = time.process_time() - executor.worked_s
        found = follower.step(Moment.of(k / fps, masks))
        spent_s.append(time.process_time() - executor.worked_s - begun_s)
        counted += k >= first
        for person, off, near in zip(found, errors, nearest, strict=True):
            if person is None:
                continue
            root_m = person.fit.pose.root_m
            near.append(int(np.linalg.norm(people_m[:, 0] - root_m, axis=1).argmin()))
            if k >= first:
                off.append(off_mm(person.model, person.fit.pose, people_m[near[-1]]))
    words = [
        f"{np.mean(off) if off else np.nan:.1f} ({1 - len(off) / max(counted, 1):.2f} lost,"
        f" {int((np.diff(near) != 0).sum())} changes)"
        for off, near in zip(errors, nearest, strict=True)
    ]
    return f"{', '.join(words)}; {1000 * np.median(spent_s):.0f} ms"


def main() -> None:
    """Follows the recordings."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("recordings", type=Path, nargs="+")
    words.add_argument("--people", type=int)
    words.add_argument("--side", type=int, default=480)
    words.add_argument("--starts", type=int, nargs="+", default=[0, 4, 8, 12])
    words.add_argument("--every", type=int, default=1)
    words.add_argument("--late", type=float)
    words.add_argument("--first", action="store_true")
    given = words.parse_args()
    for folder in given.recordings:
        recording = Recording.open(folder)
        truth = json.loads((folder / "truth.json").read_text())
        people_m = joints_of_people(truth)
        joints = people_m[0]
        rig, masks = silhouettes(recording, given.side)
        rows, settings = list(range(len(masks))), Settings(stature_m=truth.get("stature"))
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
            if given.people is not None:
                shown = [(k, masks[rows[k]], people_m[:, rows[k]]) for k in range(start, len(rows))]
                follower = PoseFollowers(rig, Settings(), given.people, executor)
                at = follower, executor, shown[:: given.every], recording.fps, len(rows) - counted
                print(folder.name, follow_people(*at), flush=True)
                continue
            follower, errors = PoseFollower(rig, settings, executor), []
            for k in range(start, len(rows), given.every):
                if isinstance(executor, Late):
                    executor.hand_over(k / recording.fps)
                moment = Moment.of(k / recording.fps, masks[rows[k]])
                fit, body = follower.step(moment), follower.body
                if fit is None or body is None or k < len(rows) - counted:
                    continue
                errors.append(off_mm(body.model, fit.pose, joints[rows[k]]))
            means.append(np.mean(errors) if errors else np.nan)
        if means:
            print(folder.name, " ".join(f"{mean:.1f}" for mean in means), flush=True)


if __name__ == "__main__":
    main()
