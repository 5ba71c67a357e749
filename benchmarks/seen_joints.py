"""Joints by the points of the pose network, against the truth.

    python -m benchmarks.seen_joints RECORDING ... [--fit]

Every third frame of every camera of recordings with truth.json, in which the network (see
`voxelpose network install`) follows one person. Prints for each joint how far off it is relative to
the pelvis across its viewing ray: medians, mm, where its points are seen and where they are not.
--fit first writes weights and deviations anew into silhouette_core/image/pose_network.toml: each
joint an affine combination of the points, by least squares with a ridge toward the points that have
its name.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.weights_file import write_weights
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.image.person_windows import PeopleWindows
from silhouette_core.image.pose_network import FILE, POINTS, PoseNetwork
from silhouette_core.image.seen_joints import SeenJoints, joint_weights, point_rays
from silhouette_core.network_files import installed_network
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import read_truth

_EVERY = 3  # frames
_HIPS = 23, 24
_NAMED = {
    "pelvis": _HIPS,
    "neck": (11, 12),
    "head_top": (0,),
    **{
        f"{side}_{name}": (number + k,)
        for k, side in enumerate(("left", "right"))
        for name, number in (
            ("shoulder", 11),
            ("elbow", 13),
            ("wrist", 15),
            ("hip", 23),
            ("knee", 25),
            ("ankle", 27),
        )
    },
}
_RIDGE_M2 = 0.03  # m²: scored on seeds 41 to 46, 0.3e-3 to 30e-3 differ by 10 %
_SEEN, _HIDDEN = 0.8, 0.5  # visibilities
_OF_RADIUS = 1.25  # median of a radius over the scale of Student's t of 4 degrees of freedom


@dataclass(frozen=True, eq=False)
class SeenFrame:
    """A frame: rays (33, 3) of the points, their visibility (33,), joints (15, 3), m; in axes of
    the camera.
    """

    rays: NDArray[np.float64]
    visibility: NDArray[np.float64]
    joints_m: NDArray[np.float64]

    @property
    def across_m(self) -> NDArray[np.float64]:
        """(33, 2): the points across the picture at the depth of the pelvis, from the hips."""
        return (self.rays - self.rays[[*_HIPS]].mean(axis=0))[:, :2] * self.joints_m[0, 2]

    @property
    def wanted_m(self) -> NDArray[np.float64]:
        """(15, 2): the same of the joints."""
        rays = self.joints_m / self.joints_m[:, 2:]
        return (rays - self.rays[[*_HIPS]].mean(axis=0))[:, :2] * self.joints_m[0, 2]


def seen_frames(folder: Path, network: Path) -> Iterator[SeenFrame]:
    """Frames of a recording in which somebody is seen."""
    recording, truth = Recording.open(folder), read_truth(folder / "truth.json")
    windows = {name: PeopleWindows(PoseNetwork(network)) for name in recording.rig.names}
    for step, (number, _, frames) in enumerate(recording):
        for camera in recording.rig:
            people = windows[camera.name].see(frames[camera.name])
            if step % _EVERY or not people:
                continue
            person = next(iter(people.values()))
            yield SeenFrame(
                point_rays(person, camera),
                person.visibility,
                truth[number] @ camera.rotation.T + camera.translation,
            )


def fitted(frames: Sequence[SeenFrame]) -> NDArray[np.float64]:
    """Weights (15, 33) of the points, each joint's summing to 1."""
    weights = np.zeros((len(LANDMARK_NAMES), POINTS))
    for joint, name in enumerate(LANDMARK_NAMES):
        weights[joint, [*_NAMED[name]]] = 1 / len(_NAMED[name])
    given = np.concatenate([frame.across_m.T for frame in frames])
    wanted = np.concatenate([frame.wanted_m.T for frame in frames])
    square = given.T @ given / len(given) + _RIDGE_M2 * np.eye(POINTS)
    one = np.ones((POINTS, 1))
    system = np.block([[square, one], [one.T, np.zeros((1, 1))]])
    left = given.T @ (wanted - given @ weights.T) / len(given)
    changes = np.linalg.solve(system, np.concatenate([left, np.zeros((1, left.shape[1]))]))
    return weights + changes[:POINTS].T


def errors(
    frames: Sequence[SeenFrame], weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Errors (N, 15) across the rays, m, relative to the pelvis, and visibility (N, 15)."""
    across, seen = [], []
    for frame in frames:
        joints = SeenJoints.from_points(frame.rays, frame.visibility, weights)
        off = (joints.rays - frame.joints_m / frame.joints_m[:, 2:])[:, :2] * frame.joints_m[:, 2:]
        across.append(np.linalg.norm(off - off[0], axis=1))
        seen.append(joints.visibility)
    return np.array(across), np.array(seen)


def medians_mm(away_m: NDArray[np.float64], chosen: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Median (15,) of errors (N, 15) where chosen; NaN where too few are."""
    kept = np.where(chosen, np.abs(away_m), np.nan)
    return np.where(chosen.sum(axis=0) > 15, 1000 * np.nanmedian(kept, axis=0), np.nan)


def deviations(
    away_m: NDArray[np.float64], visibility: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Deviations (15,), mm, of joints that are seen, and what is added for those that are not."""
    seen = medians_mm(away_m, visibility > _SEEN)
    seen = np.where(np.isnan(seen), medians_mm(away_m, visibility >= 0), seen)
    hidden = medians_mm(away_m, visibility < _HIDDEN)
    hidden = np.where(np.isnan(hidden), 1.5 * seen, hidden)
    return np.maximum(seen, 10) / _OF_RADIUS, np.maximum(hidden - seen, 0) / _OF_RADIUS


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures, and fits if asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("recordings", nargs="+", type=Path, metavar="RECORDING")
    parser.add_argument("--fit", action="store_true")
    given = parser.parse_args(arguments)
    network = installed_network()
    if network is None:
        print("no network is installed: run `voxelpose network install`", file=sys.stderr)
        return 2
    frames = [frame for folder in given.recordings for frame in seen_frames(folder, network)]
    if given.fit:
        weights = fitted(frames)
        sigmas = deviations(*errors(frames, weights))
        names = "points", "across_mm", "across_hidden_mm"
        values = dict(zip(names, (weights.ravel(), *sigmas), strict=True))
        data = f"{len(frames)} frames of {len(given.recordings)} recordings drawn at random"
        write_weights(FILE, values, data, "python -m benchmarks.seen_joints RECORDING ... --fit")
    across, seen = errors(frames, joint_weights())
    columns = medians_mm(across, seen > _HIDDEN), medians_mm(across, seen <= _HIDDEN)
    print(f"{len(frames)} frames\n{'joint':<16}{'seen':>8}{'hidden':>8}")
    for name, *values in zip(LANDMARK_NAMES, *columns, strict=True):
        print(f"{name:<16}" + "".join(f"{value:8.0f}" for value in values))
    return 0


if __name__ == "__main__":
    sys.exit(main())
