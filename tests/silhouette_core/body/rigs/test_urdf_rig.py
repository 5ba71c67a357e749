"""URDF robots as bodies: merged links, axes, limits, shapes and refusals."""

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.body.rigs.urdf_rig import read_urdf
from silhouette_core.motion.motion import Motion

_ROBOT = """<robot name="arm">
<link name="world"/><link name="base"><visual><geometry><box size="0.2 0.2 0.2"/>
</geometry></visual></link>
<joint name="stand" type="fixed"><parent link="world"/><child link="base"/></joint>
<link name="upper"><collision><origin xyz="0 0 0.2"/><geometry>
<cylinder radius="0.05" length="0.4"/></geometry></collision></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
<origin xyz="0 0 0.1" rpy="0 0 1.5707963267948966"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
<link name="lower"><visual><origin xyz="0 0 0.1"/>
<geometry><sphere radius="0.1"/></geometry></visual></link>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
<origin xyz="0 0 0.4"/><axis xyz="0 2 0"/></joint>
<link name="tool"/><joint name="slide" type="prismatic"><parent link="lower"/><child link="tool"/>
<origin xyz="0 0 0.3"/><limit lower="0" upper="0.1" effort="1" velocity="1"/></joint>
</robot>"""


@pytest.fixture
def robot(tmp_path):
    """Writes the robot after replacing some of its text."""

    def write(old="", new=""):
        assert old in _ROBOT
        path = tmp_path / "arm.urdf"
        path.write_text(_ROBOT.replace(old, new) if old else _ROBOT)
        return path

    return write


def test_links_between_fixed_joints_are_one_part(robot):
    said = []
    body = read_urdf(robot(), said.append)
    assert body.names == ("world", "upper", "lower")
    assert body.tree.dof_names == ("upper.shoulder", "lower.elbow")
    assert np.allclose(body.joints_m[:, 2], [0, 0.1, 0.5])
    assert np.degrees(body.tree.dof_limits_rad[1]).tolist() == pytest.approx([-180, 180])
    assert body.tree.dof_limits_rad[0].tolist() == pytest.approx([-1, 2])
    assert body.tree.root_fixed
    assert body.tree.landmark_names == ("world", "upper", "lower", "tool")
    assert len(said) == 1 and "slide" in said[0]
    assert body.part_volumes_m3(0.01) == pytest.approx(
        [0.2**3, np.pi * 0.05**2 * 0.4, 4 / 3 * np.pi * 0.1**3], rel=0.1
    )


def test_a_joint_turns_as_in_the_file(robot):
    body = read_urdf(robot())
    still = np.zeros((1, 3))
    motion = Motion(
        30.0,
        body,
        still,
        np.array([[1.0, 0, 0, 0]]),
        np.array([[np.pi / 2, 0.0]]),
        np.zeros(1, np.int64),
        np.zeros(1),
    )
    # The axis x, turned by 90 degrees about z, is the file's y, which is x of the body frame.
    assert np.allclose(body.tree.dof_axis, [[1, 0, 0], [0, 1, 0]])
    tool = motion.landmarks()[0, 3]
    assert np.allclose(tool, [0, -0.7, 0.1], atol=1e-9)


def test_a_mimicking_joint_stays_at_rest(robot):
    said = []
    text = '<child link="lower"/><mimic joint="shoulder"/>'
    body = read_urdf(robot('<child link="lower"/>\n', text), said.append)
    assert body.tree.dof_fixed.tolist() == [False, True]
    assert any("mimics" in line for line in said)


@pytest.mark.parametrize("mesh", ["stl", "obj", "dae", "ply"])
def test_meshes_lie_beside_the_file(rig_files, tmp_path, mesh):
    rig_files.write_urdf(tmp_path, mesh)
    body = read_urdf(tmp_path / "arm.urdf")
    assert body.names == ("base", "upper")
    # The mesh of 0.1 x 0.1 x 0.4 m, and the box of 0.1 m half within it.
    assert body.part_volumes_m3(0.005)[1] == pytest.approx(0.004 + 0.0005, rel=0.05)
    (tmp_path / f"part.{mesh}").unlink()
    with pytest.raises(InputError, match="is not beside it"):
        read_urdf(tmp_path / "arm.urdf")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('link name="world"/>', 'link name="w"/>', "connects links that it lacks"),
        ('<parent link="world"/>', '<parent link="tool"/>', "cyclic|no joint|no parent"),
        ('<joint name="stand" type="fixed"><parent link="world"/><child link="base"/></joint>', "",
         "not connected"),
        ('lower="-1" upper="2"', 'lower="3" upper="2"', "limits"),
        ('xyz="0 2 0"', 'xyz="0 0 0"', "axis"),
        ('radius="0.1"', 'radius="0"', "size"),
        ('radius="0.1"', 'radius="word"', "no complete URDF"),
        ('box size="0.2 0.2 0.2"', 'mesh filename="/etc/passwd"', "none of"),
        ('box size="0.2 0.2 0.2"', 'mesh filename="../a.stl"', "beside"),
        ('xyz="0 0 0.4"', 'xyz="0 0 4e5"', "unit"),
        ('type="continuous"', 'type="screw"', "type"),
        ('<robot name="arm">', '<!DOCTYPE a []><robot name="arm">', "document type"),
    ],
)  # fmt: skip
def test_what_cannot_be_a_body_is_refused_in_one_line(robot, old, new, words):
    with pytest.raises(InputError, match=words) as refused:
        read_urdf(robot(old, new))
    assert "arm.urdf" in str(refused.value) and "\n" not in str(refused.value)


def test_axes_are_those_of_the_file_seen_from_the_body(robot):
    """x of the file is forward, -y of the body; y is left, its x."""
    body = read_urdf(robot(' rpy="0 0 1.5707963267948966"', ""))
    np.testing.assert_allclose(body.tree.dof_axis, [[0, -1, 0], [1, 0, 0]], atol=1e-12)


def test_a_mesh_above_the_robots_folder_is_not_read(rig_files, tmp_path):
    """Even where there is one."""
    (tmp_path / "robot").mkdir()
    rig_files.write_urdf(tmp_path / "robot", "stl")
    (tmp_path / "robot" / "part.stl").rename(tmp_path / "part.stl")
    path = tmp_path / "robot" / "arm.urdf"
    assert "part.stl" in path.read_text()
    path.write_text(path.read_text().replace("part.stl", "../part.stl"))
    with pytest.raises(InputError, match="put it beside the robot's file"):
        read_urdf(path)
