"""Compare anatomical angles of balancing4 with OpenSim's: python -m benchmarks.angles [RESULT]

RESULT is a fit of balancing4; by default it is fitted first, into out/angles/balancing4. One line
per angle, in degrees: mean and standard deviation of the difference (ours minus OpenSim's),
correlation, and the range of OpenSim's. The recording is in ../shared/data, or in
$VOXELPOSE_SHARED/data.
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.accuracy import ROOT, SHARED
from silhouette_core.estimator import Settings
from silhouette_core.motion.anatomical import anatomical_angles, joint_rotations
from silhouette_core.motion.motion import Motion
from voxelpose.export.opensim import mot_coordinates
from voxelpose.fitting import Output, fit
from voxelpose.recording.folder import Recording
from voxelpose.results import Result

DATA = SHARED / "data" / "balancing4"
OURS = (
    "pelvis_tilt pelvis_list pelvis_rotation hip_flexion_r hip_flexion_l hip_adduction_r"
    " hip_adduction_l hip_rotation_r hip_rotation_l knee_angle_r knee_angle_l ankle_angle_r"
    " ankle_angle_l subtalar_angle_r subtalar_angle_l arm_flex_r arm_flex_l arm_add_r arm_add_l"
    " arm_rot_r arm_rot_l elbow_flex_r elbow_flex_l"
).split()
# OpenSim's model has six lumbar joints, ours a single one: their angles are summed.
LUMBAR = {
    "lumbar_extension": "Flex_Ext",
    "lumbar_bending": "Lat_Bending",
    "lumbar_rotation": "axial_rotation",
}
ARM = {
    side: tuple(f"arm_{name}_{side[0]}" for name in ("flex", "add", "rot"))
    for side in ("right", "left")
}
DOWN = np.array([0.0, -1.0, 0.0])


def main(words: list[str]) -> int:
    """Print the comparison."""
    if not DATA.is_dir():
        print(f"no recording {DATA}: set VOXELPOSE_SHARED", file=sys.stderr)
        return 2
    folder = Path(words[0]) if words else ROOT / "out" / "angles" / "balancing4"
    if not words:
        fit(Recording.open(DATA), Output(folder, overwrite=True, pictures=False), Settings())
    motion = Result.open(folder).motion
    theirs = read_mot(DATA / "reference_opensim.mot", motion.frames)
    print(f"{'angle':<34}{'mean':>8}{'rms':>8}{'corr':>8}{'theirs from':>14}{'to':>6}")
    for name, ours, reference in compared(motion, theirs):
        off = (ours - reference + 180) % 360 - 180
        rest = off - off.mean()
        agreement = np.corrcoef(ours, reference)[0, 1]
        span = f"{reference.min():>14.0f}{reference.max():>6.0f}"
        print(
            f"{name:<34}{off.mean():>8.1f}{np.sqrt((rest**2).mean()):>8.1f}{agreement:>8.2f}{span}"
        )
    for name, ours, reference in directions(motion, theirs):
        away = np.degrees(np.arccos(np.clip((ours * reference).sum(axis=1), -1, 1)))
        print(f"{name}: directions {away.mean():.1f} degrees apart, {away.max():.1f} at most")
    return 0


def compared(motion: Motion, theirs: dict[str, NDArray]) -> Iterator[tuple[str, NDArray, NDArray]]:
    """Yield name, our angles and OpenSim's, (T,) degrees each."""
    ours = mot_coordinates(motion)
    for name in OURS:
        yield name, ours[name], theirs[name]
    for name in LUMBAR:
        yield name, ours[name], lumbar_sum(theirs, name)
    angles = anatomical_angles(motion)
    for side in ("right", "left"):
        elevation = np.degrees(np.arccos(turned(theirs, *ARM[side]) @ DOWN @ DOWN))
        yield f"{side}_shoulder_elevation", angles[f"{side}_shoulder_elevation"], elevation
    points = json.loads((DATA / "truth.json").read_text())["joints"]
    for side in ("right", "left"):
        for joint, chain in (
            ("knee", ("hip", "knee", "ankle")),
            ("elbow", ("shoulder", "elbow", "wrist")),
        ):
            keypoints = [np.array(points[f"{side}_{name}"])[motion.frames] for name in chain]
            yield (
                f"{side}_{joint}_flexion, keypoints",
                angles[f"{side}_{joint}_flexion"],
                flexion_deg(*keypoints),
            )


def directions(
    motion: Motion, theirs: dict[str, NDArray]
) -> Iterator[tuple[str, NDArray, NDArray]]:
    """Yield name, our directions and OpenSim's, (T, 3) each; the left arm's are mirrored."""
    rotations = joint_rotations(motion)
    pelvis = turned(theirs, "pelvis_tilt", "pelvis_list", "pelvis_rotation")
    lumbar = turned({name: lumbar_sum(theirs, name) for name in LUMBAR}, *LUMBAR)
    yield "pelvis, upward, in the room", rotations["pelvis"] @ -DOWN, pelvis @ -DOWN
    yield (
        "thorax, upward, in the room",
        rotations["pelvis"] @ rotations["trunk"] @ -DOWN,
        pelvis @ lumbar @ -DOWN,
    )
    for side, names in ARM.items():
        yield (
            f"{side} upper arm, against the thorax",
            rotations[f"{side}_shoulder"] @ DOWN,
            turned(theirs, *names) @ DOWN,
        )


def turned(columns: dict[str, NDArray], *names: str) -> NDArray:
    """Rotations (T, 3, 3) by three columns, about z, x and y in this order."""
    return Rotation.from_euler(
        "ZXY", np.column_stack([columns[name] for name in names]), degrees=True
    ).as_matrix()


def lumbar_sum(theirs: dict[str, NDArray], name: str) -> NDArray:
    return np.sum(
        [
            values
            for other, values in theirs.items()
            if other.startswith("L") and other.endswith(LUMBAR[name])
        ],
        axis=0,
    )


def flexion_deg(a: NDArray, b: NDArray, c: NDArray) -> NDArray:
    """Angle at b between a-b and b-c, (T,) degrees; 0 is straight."""
    first, second = (
        (to - start) / np.linalg.norm(to - start, axis=1, keepdims=True)
        for start, to in ((a, b), (b, c))
    )
    return np.degrees(np.arccos(np.clip((first * second).sum(axis=1), -1, 1)))


def read_mot(path: Path, frames: NDArray) -> dict[str, NDArray]:
    """Columns of a MOT file at frames of the recording; its first row is frame 0."""
    lines = path.read_text().splitlines()
    end = lines.index("endheader")
    table = np.array([line.split() for line in lines[end + 2 :] if line.strip()], float)
    return dict(zip(lines[end + 1].split(), table[frames].T, strict=True))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
