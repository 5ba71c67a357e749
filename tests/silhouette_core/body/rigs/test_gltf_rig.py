"""Skinned glTF as a body: its joints and surface, and refusals."""

import base64
import json

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.body.rigs.gltf_rig import read_gltf


@pytest.fixture
def changed(rig_files, tmp_path):
    """Writes the small glTF after a change of its JSON and returns its path."""

    def write(change=None):
        rig_files.write_gltf(tmp_path)
        path = tmp_path / "box.gltf"
        content = json.loads(path.read_text())
        if change is not None:
            change(content)
        path.write_text(json.dumps(content))
        return path

    return write


def test_nodes_become_parts_with_z_up(changed, rig_files):
    body = read_gltf(changed())
    assert body.names == ("low", "high") and body.tree.parents.tolist() == [-1, 0]
    assert np.allclose(body.joints_m, [[0, 0, -0.2], [0, 0, 0]])
    vertices, _ = rig_files.box_mesh()
    moved = vertices + np.where(np.arange(8) % 2, 0.0, -0.2)[:, None] * [0, 0, 1]
    assert np.allclose(body.vertices_m, moved, atol=1e-6)
    assert body.tree.dof_names == ("high.x", "high.y", "high.z")
    assert body.skin_parts[np.arange(8), body.skin_weights.argmax(1)].tolist() == [0, 1] * 4


def test_glb_is_the_same_body_as_gltf(changed, rig_files, tmp_path):
    one = read_gltf(changed())
    rig_files.write_box_glb(tmp_path)
    other = read_gltf(tmp_path / "box.glb")
    assert np.array_equal(one.vertices_m, other.vertices_m)
    assert np.array_equal(one.faces, other.faces)


def test_a_hole_is_closed_and_volume_known(changed):
    whole = read_gltf(changed()).part_volumes_m3(0.01).sum()

    def cut(content):
        content["accessors"][3]["count"] -= 6  # the last side

    assert read_gltf(changed(cut)).part_volumes_m3(0.01).sum() == pytest.approx(whole, rel=0.02)


def test_limits_come_from_the_table_beside_it(changed):
    path = changed()
    assert not read_gltf(path).tree.root_fixed
    table = "root_fixed = true\n[limits.high]\nx = [-30, 60]\n"
    path.with_name("box.rig.toml").write_text(table)
    body = read_gltf(path)
    assert body.tree.root_fixed
    assert body.tree.dof_names == ("high.x",)
    assert np.allclose(np.degrees(body.tree.dof_limits_rad), [[-30, 60]])


def _no_skin(content):
    del content["nodes"][0]["skin"]


def _cyclic(content):
    content["nodes"][2]["children"] = [1]


def _two_roots(content):
    del content["nodes"][1]["children"]


def _zero_length(content):
    content["nodes"][2]["translation"] = [0, 0, 0]


def _half_weights(content):
    content["accessors"][2]["byteOffset"] = 4
    content["accessors"][2]["count"] = 7
    content["accessors"][0]["count"] = content["accessors"][1]["count"] = 7


def _far_too_large(content):
    content["nodes"][1]["scale"] = [1e4] * 3


def _beyond(content):
    content["accessors"][0]["count"] = 10**8


def _negative(content):
    buffer = content["buffers"][0]
    head, _, coded = buffer["uri"].partition(",")
    data = base64.b64decode(coded) + np.array([0, 1, -1] * 12, np.int8).tobytes()
    buffer |= {"uri": f"{head},{base64.b64encode(data).decode()}", "byteLength": len(data)}
    view = {"buffer": 0, "byteOffset": len(data) - 36, "byteLength": 36}
    content["bufferViews"].append(view)
    number = len(content["bufferViews"]) - 1
    content["accessors"][3] |= {"bufferView": number, "componentType": 5120}


def _twice(content):
    content["nodes"][2]["name"] = "low"


def _empty(content):
    content["meshes"][0]["primitives"] = []


def _compressed(content):
    content["extensionsRequired"] = ["KHR_draco_mesh_compression"]


def _elsewhere(content):
    content["buffers"][0]["uri"] = "../../etc/passwd"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_no_skin, "no mesh with a skin"),
        (_cyclic, "cyclic"),
        (_two_roots, "not connected"),
        (_zero_length, "no length"),
        (_half_weights, "sum to"),
        (_far_too_large, "unit"),
        (_beyond, "beyond its buffer"),
        (_negative, "do not exist"),
        (_twice, "rename"),
        (_empty, "without triangles"),
        (_compressed, "without compression"),
        (_elsewhere, "beside it"),
    ],
)
def test_what_cannot_be_a_body_is_refused_in_one_line(changed, change, words):
    with pytest.raises(InputError, match=words) as refused:
        read_gltf(changed(change))
    assert "box.gltf" in str(refused.value) and "\n" not in str(refused.value)
