"""Motion files that hold a body which is no person's: round trips and refusals."""

import json

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import save_file

from calib.errors import InputError
from silhouette_core.body.kinematic_tree import Dof, KinematicTree
from silhouette_core.body.rigid_parts import Box, Capsule, body_of_parts
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import body_of_motion, read_motion, write_motion

_TREE = KinematicTree.from_parts(
    (("base", "", ()), ("arm", "base", (Dof("bend", (0.0, -1.0, 0.0), (-90.0, 90.0)),))),
    {"tip": "arm"},
    root_fixed=True,
)


@pytest.fixture
def written(tmp_path):
    shapes = [[Box((-0.1, -0.2, 0.0), (0.1, 0.2, 0.2))], [Capsule((0, 0, 0.2), (0, 0, 0.7), 0.05)]]
    joints = np.array([[0.0, 0, 0], [0, 0, 0.2]])
    model = body_of_parts(_TREE, joints, shapes, np.array([*joints, [0, 0, 0.75]]))
    turned = np.tile([1.0, 0, 0, 0], (2, 1))
    motion = Motion(25.0, model, np.zeros((2, 3)), turned, np.array([[0.1], [0.2]]))
    write_motion(motion, tmp_path / "motion.safetensors")
    return motion, tmp_path / "motion.safetensors"


def test_a_motion_holds_its_body(written):
    motion, path = written
    found = read_motion(path)
    assert found.model.tree.names == _TREE.names and found.model.tree.dofs == _TREE.dofs
    assert found.model.tree.landmark_names == _TREE.landmark_names and found.model.tree.root_fixed
    assert found.model.tree.landmark_bones.tolist() == _TREE.landmark_bones.tolist()
    for name in ("vertices_m", "faces", "face_part", "skin_parts", "joints_m"):
        np.testing.assert_array_equal(getattr(found.model, name), getattr(motion.model, name))
    np.testing.assert_array_equal(found.landmarks(), motion.landmarks())
    assert found.landmarks().shape == (2, 3, 3) and found.landmark_confidence().shape == (2, 3)
    assert body_of_motion(path.parent).tree.dof_names == ("arm.bend",)


def _rewrite(path, change_text=None, **changed):
    with safe_open(str(path), framework="numpy") as file:
        arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        about = file.metadata()
    if change_text:
        tree = json.loads(about["tree"])
        change_text(tree)
        about["tree"] = json.dumps(tree)
    save_file(arrays | {name.replace("__", "."): a for name, a in changed.items()}, path, about)


def _first_dof(position, value):
    return lambda tree: tree["dofs"][0].__setitem__(position, value)


@pytest.mark.parametrize(
    "change",
    [
        lambda tree: tree.__setitem__("parents", [-1, 1]),
        lambda tree: tree.__setitem__("parents", [0, 0]),
        lambda tree: tree.__setitem__("parents", None),
        lambda tree: tree.__setitem__("names", ["base", "base"]),
        lambda tree: tree.__setitem__("names", ["base", "a\x1b[31m"]),
        lambda tree: tree.__setitem__("landmark_part", [0, 1, 2]),
        lambda tree: tree.__setitem__("landmark_bones", [[0, 3]]),
        lambda tree: tree.__setitem__("root_fixed", "yes"),
        lambda tree: tree.pop("dofs"),
        _first_dof(0, 2),
        _first_dof(2, [0.0, 2.0, 0.0]),
        _first_dof(2, [0.0, 1.0]),
        _first_dof(3, [90.0, -90.0]),
        _first_dof(3, [float("nan"), 1.0]),
    ],
)
def test_a_tree_that_no_body_has_is_refused(written, change):
    _rewrite(written[1], change)
    with pytest.raises(InputError, match="is damaged"):
        read_motion(written[1])


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("faces", lambda a: a + 10_000),
        ("faces", lambda a: a - 1),
        ("faces", lambda a: a.astype(float)),
        ("face_part", lambda a: a + 1),
        ("face_part", lambda a: a[1:]),
        ("skin_parts", lambda a: a + 2),
        ("skin_weights", lambda a: 2 * a),
        ("vertices_m", lambda a: np.full_like(a, np.inf)),
        ("joints_m", lambda a: a[:1]),
        ("landmarks_m", lambda a: a[:2]),
    ],
)
def test_arrays_that_no_body_has_are_refused(written, name, change):
    motion, path = written
    _rewrite(path, **{f"body__{name}": change(getattr(motion.model, name))})
    with pytest.raises(InputError, match="is damaged"):
        read_motion(path)
