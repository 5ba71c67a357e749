"""BVH as an independent reader (bvhio) sees it."""

from pathlib import Path

import bvhio
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from silhouette_core.motion.motion import Motion
from tests.clips import turning, waving
from voxelpose.export.bvh import write_bvh


def world_from_bvh(position_cm) -> np.ndarray:
    """BVH's y-up centimetres back to z-up metres."""
    x, y, z = position_cm
    return np.array([x, -z, y]) / 100


def joint_positions(path: Path, frame: int) -> dict[str, np.ndarray]:
    root = bvhio.readAsHierarchy(str(path)).loadPose(frame)
    return {joint.Name: world_from_bvh(joint.PositionWorld) for joint, _, _ in root.layout()}


def assert_same_joints(motion: Motion, path: Path) -> None:
    _, origins = motion.parts()
    for row in range(len(motion)):
        read = joint_positions(path, row)
        for part, name in enumerate(motion.model.names):
            np.testing.assert_allclose(
                read[name], origins[row, part], atol=1e-5, err_msg=f"{name} in frame {row}"
            )


def test_every_joint_is_where_our_kinematics_puts_it(tmp_path):
    motion = waving()
    write_bvh(motion, tmp_path / "motion.bvh")
    assert_same_joints(motion, tmp_path / "motion.bvh")


def test_head_ends_at_its_vertex(tmp_path):
    motion = waving()
    write_bvh(motion, tmp_path / "motion.bvh")
    head = next(
        joint
        for joint, _, _ in bvhio.readAsBvh(str(tmp_path / "motion.bvh")).Root.layout()
        if joint.Name == "head"
    )
    rise = motion.model.landmarks_m[8] - motion.model.joints_m[motion.model.names.index("head")]
    np.testing.assert_allclose(world_from_bvh(head.EndSite), rise, atol=1e-6)


def test_between_the_frames_every_joint_turns_the_short_way(tmp_path):
    write_bvh(turning(), tmp_path / "motion.bvh")
    rows = (tmp_path / "motion.bvh").read_text().split("Frame Time")[1].splitlines()[1:]
    degrees = np.array([row.split() for row in rows], float)[:, 3:]
    assert np.ptp(degrees, axis=0).max() > 600  # it turns twice
    keys, between = (
        Rotation.from_euler("ZXY", angles.reshape(-1, 3), degrees=True)
        for angles in (degrees, (degrees[:-1] + degrees[1:]) / 2)
    )
    parts = degrees.shape[1] // 3
    whole = keys[:-parts].inv() * keys[parts:]
    half = keys[:-parts].inv() * between
    off = (Rotation.from_rotvec(whole.as_rotvec() / 2).inv() * half).magnitude()
    assert np.degrees(off).max() < 2


def test_lost_frames_are_interpolated(tmp_path):
    motion = waving(7)
    keep = np.array([0, 1, 3, 6])
    write_bvh(motion.select(keep), tmp_path / "motion.bvh")
    file = bvhio.readAsBvh(str(tmp_path / "motion.bvh"))
    assert file.FrameCount == 7
    assert file.FrameTime == pytest.approx(1 / motion.fps)
    _, origins = motion.parts()
    for frame in range(7):
        hand = joint_positions(tmp_path / "motion.bvh", frame)["right_hand"]
        np.testing.assert_allclose(
            hand,
            origins[frame, motion.model.names.index("right_hand")],
            atol=1e-5 if frame in keep else 0.02,
        )
