"""TRC and MOT, read back by hand, and put together again as OpenSim's models do."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.kinematics import landmarks
from silhouette_core.motion.motion import Motion
from tests.clips import turning, waving
from voxelpose.export.opensim import write_mot
from voxelpose.export.skeleton import named_points
from voxelpose.export.trc import write_trc


def read_trc(path: Path) -> tuple[dict[str, str], list[str], np.ndarray, np.ndarray]:
    """Returns header, marker names, (F, 2) frame numbers and times, (F, K, 3) in the axes of the
    world.
    """
    lines = path.read_text().split("\n")
    assert lines[0].split("\t")[:3] == ["PathFileType", "4", "(X/Y/Z)"]
    about = dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=True))
    names = [name for name in lines[3].split("\t")[2:] if name]
    axes = [f"{axis}{k + 1}" for k in range(len(names)) for axis in "XYZ"]
    assert lines[4].split("\t")[2:] == axes
    table = np.array([[float(cell) for cell in line.split("\t")] for line in lines[5:] if line])
    points = table[:, 2:].reshape(len(table), len(names), 3)
    return about, names, table[:, :2], points[..., [2, 0, 1]]  # world x, y, z: the file's z, x, y


def read_mot(path: Path) -> dict[str, np.ndarray]:
    lines = path.read_text().split("\n")
    end = lines.index("endheader")
    about = dict(line.split("=") for line in lines[:end] if "=" in line)
    names = lines[end + 1].split("\t")
    rows = [line.split("\t") for line in lines[end + 2 :] if line]
    table = np.array(rows).astype(float)
    assert (int(about["nRows"]), int(about["nColumns"])) == table.shape == (len(table), len(names))
    assert about["inDegrees"] == "yes"
    return dict(zip(names, table.T, strict=True))


def turned(columns: dict[str, np.ndarray], *names: str, mirror: float = 1.0) -> np.ndarray:
    """(T, 3, 3): turns about z, x and y in this order, as the joints of OpenSim's full-body models
    make them.
    """
    zero = np.zeros(len(columns["time"]))
    z, x, y = (columns.get(name, zero) for name in names)
    angles = np.column_stack([z, mirror * x, mirror * y])
    return Rotation.from_euler("ZXY", angles, degrees=True).as_matrix()


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@pytest.fixture(params=["waving", "tall", "wild"])
def motion(request) -> Motion:
    take = waving(5, 1.95 if request.param == "tall" else 1.7)
    if request.param != "wild":
        return take
    random, low, high = np.random.default_rng(3), *take.model.tree.dof_limits_rad.T
    heading = unit(random.normal(size=(5, 4)))
    angles = random.uniform(low, high, take.angles_rad.shape)  # every joint turned
    angles[:, take.model.tree.dof_fixed] = (
        0  # as estimators leave them: an elbow that turns too is no hinge
    )
    return replace(take, angles_rad=angles, root_quaternion=heading)


def test_trc_has_the_points_where_they_are(tmp_path, motion):
    write_trc(motion, tmp_path / "motion.trc")
    about, names, stamps, points = read_trc(tmp_path / "motion.trc")
    expected_names, expected = named_points(motion)
    assert tuple(names) == expected_names
    assert (about["Units"], float(about["DataRate"]), int(about["NumFrames"])) == (
        "m",
        motion.fps,
        len(motion),
    )
    np.testing.assert_allclose(points, expected, atol=1e-6)
    np.testing.assert_allclose(
        points[:, [names.index(name) for name in LANDMARK_NAMES]], motion.landmarks(), atol=1e-6
    )
    np.testing.assert_allclose(stamps, np.column_stack([motion.frames + 1, motion.time_s]))


def test_trc_marks_lost_frames(tmp_path):
    write_trc(waving(7).select(np.array([1, 2, 4, 6])), tmp_path / "motion.trc")
    about, _, stamps, points = read_trc(tmp_path / "motion.trc")
    assert (about["NumFrames"], about["OrigDataStartFrame"]) == ("6", "2")
    assert stamps[:, 0].tolist() == [2, 3, 4, 5, 6, 7]
    assert np.isnan(points).all(axis=(1, 2)).tolist() == [False, False, True, False, True, False]


def test_mot_puts_the_bones_where_they_are(tmp_path, motion):
    write_mot(motion, tmp_path / "motion.mot")
    columns = read_mot(tmp_path / "motion.mot")
    skeleton = landmarks(motion.model, *motion.parts())[..., [1, 2, 0]]
    joints = dict(zip(LANDMARK_NAMES, np.moveaxis(skeleton, 1, 0), strict=True))
    rest = dict(zip(LANDMARK_NAMES, motion.model.landmarks_m, strict=True))
    length = lambda a, b: np.linalg.norm(rest[a] - rest[b])  # noqa: E731
    pelvis = turned(columns, "pelvis_tilt", "pelvis_list", "pelvis_rotation")
    trunk = pelvis @ turned(columns, "lumbar_extension", "lumbar_bending", "lumbar_rotation")
    origin = np.column_stack([columns[f"pelvis_t{axis}"] for axis in "xyz"])
    scale = motion.model.sizes.stature_m / 1.70
    middle = origin + scale * pelvis @ np.array([-0.056276, -0.07849, 0])
    down = np.array([0, -1.0, 0])
    for side, letter, sign in (("right", "r", 1.0), ("left", "l", -1.0)):
        hip = middle + pelvis @ np.array([0, 0, sign * length("left_hip", "right_hip") / 2])
        np.testing.assert_allclose(hip, joints[f"{side}_hip"], atol=2e-5)
        thigh = pelvis @ turned(
            columns,
            *(f"hip_{name}_{letter}" for name in ("flexion", "adduction", "rotation")),
            mirror=sign,
        )
        knee = hip + length(f"{side}_hip", f"{side}_knee") * thigh @ down
        np.testing.assert_allclose(knee, joints[f"{side}_knee"], atol=2e-5)
        # Flexion is positive, and turns backward.
        shin = thigh @ np.swapaxes(turned(columns, f"knee_angle_{letter}", "", ""), 1, 2)
        ankle = knee + length(f"{side}_knee", f"{side}_ankle") * shin @ down
        # The model's knee bends about z alone.
        np.testing.assert_allclose(ankle, joints[f"{side}_ankle"], atol=0.04)
        arm = trunk @ turned(
            columns, *(f"arm_{name}_{letter}" for name in ("flex", "add", "rot")), mirror=sign
        )
        np.testing.assert_allclose(
            arm @ down, unit(joints[f"{side}_elbow"] - joints[f"{side}_shoulder"]), atol=1e-6
        )
        forearm = arm @ turned(
            columns, f"elbow_flex_{letter}", "", f"pro_sup_{letter}", mirror=sign
        )
        np.testing.assert_allclose(
            forearm @ down, unit(joints[f"{side}_wrist"] - joints[f"{side}_elbow"]), atol=1e-4
        )


def test_mot_is_continuous_and_leaves_lost_frames_out(tmp_path):
    motion = waving(41).select(np.delete(np.arange(41), [3, 4, 20]))
    write_mot(motion, tmp_path / "motion.mot")
    columns = read_mot(tmp_path / "motion.mot")
    np.testing.assert_allclose(columns["time"], motion.frames / motion.fps)
    # Raised to the side, past the horizontal where the other triple begins.
    assert columns["arm_add_r"].min() < -150
    for name, values in columns.items():
        if name != "time":
            assert np.abs(np.diff(values)).max() < 12, name
    assert columns["knee_angle_l"][-1] > 80


def test_mot_of_somebody_who_turns_twice_has_no_jumps(tmp_path):
    write_mot(turning(), tmp_path / "motion.mot")
    columns = read_mot(tmp_path / "motion.mot")
    assert np.ptp(columns["pelvis_rotation"]) > 500
    for name, values in columns.items():
        assert np.abs(np.diff(values)).max() < 45, name
