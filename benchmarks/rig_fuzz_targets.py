"""Small rigs of every format that is read as a body, for `benchmarks.fuzz_targets`."""

import base64
import json
import struct
from pathlib import Path

import numpy as np

from silhouette_core.body.rigs.rig_formats import read_rig_body

_URDF = """<?xml version="1.0"?>
<robot name="arm">
  <link name="base">
    <visual><geometry><cylinder radius="0.1" length="0.2"/></geometry></visual>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><origin xyz="0 0 0.1" rpy="0 0 0.4"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="2" effort="1" velocity="1"/>
  </joint>
  <link name="upper">
    <collision>
      <origin xyz="0 0 0.2"/><geometry><mesh filename="part.MESH" scale="1 1 1"/></geometry>
    </collision>
  </link>
  <joint name="slide" type="prismatic">
    <parent link="upper"/><child link="tip"/><origin xyz="0 0 0.4"/><mimic joint="shoulder"/>
  </joint>
  <link name="tip"><visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>
</robot>
"""
_TABLE = 'unit = "cm"\nradius = 0.03\nroot_fixed = true\n[limits.knee]\nx = [-10, 120]\n'
_BVH = """HIERARCHY
ROOT hip
{
  OFFSET 0 90 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT knee
  {
    OFFSET 0 -45 1
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 -45 0
    }
  }
}
MOTION
Frames: 1
Frame Time: 0.0333333
0 0 0 0 0 0 0 0 0
"""


def box_mesh() -> tuple[np.ndarray, np.ndarray]:
    """Vertices (8, 3) and outward faces (12, 3) of a box 0.1 m wide and 0.4 m high."""
    vertices = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-4, 4)]) * 0.05
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [corner for a, b, c, d in quads for corner in ((a, b, c), (a, c, d))]
    return vertices, np.array(faces)


def write_urdf(folder: Path, mesh: str) -> None:
    """A robot with a mesh of a format, "stl", "obj", "dae" or "ply"."""
    import trimesh

    (folder / "arm.urdf").write_text(_URDF.replace("MESH", mesh))
    body = trimesh.Trimesh(*box_mesh(), process=False)
    exported = body.export(file_type=mesh)
    data = exported.encode() if isinstance(exported, str) else exported
    (folder / f"part.{mesh}").write_bytes(data)


def write_bvh_rig(folder: Path) -> None:
    """A skeleton of two bones, and a table beside it."""
    (folder / "leg.bvh").write_text(_BVH)
    (folder / "leg.rig.toml").write_text(_TABLE)


def gltf_content() -> tuple[dict, bytes]:
    """JSON and buffer of a box on two joints."""
    vertices, faces = box_mesh()
    weights = np.zeros((8, 4), np.float32)
    weights[:, 1] = np.arange(8) % 2
    weights[:, 0] = 1 - weights[:, 1]
    bind = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    arrays = [
        (vertices.astype(np.float32)[:, [0, 2, 1]] * [1, 1, -1], 5126, "VEC3"),
        (np.tile(np.uint8([0, 1, 0, 0]), (8, 1)), 5121, "VEC4"),
        (weights, 5126, "VEC4"),
        (faces.astype(np.uint16).ravel(), 5123, "SCALAR"),
        (bind, 5126, "MAT4"),
    ]
    data, views, accessors = b"", [], []
    for array, component, kind in arrays:
        own = np.ascontiguousarray(
            array, np.float32 if component == 5126 else array.dtype
        ).tobytes()
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(own)})
        about = {"bufferView": len(accessors), "componentType": component, "type": kind}
        accessors.append({**about, "count": len(array)})
        data += own + bytes(-len(own) % 4)
    attributes = {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}
    return {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [
            {"name": "box", "mesh": 0, "skin": 0},
            {"name": "low", "translation": [0, -0.2, 0], "children": [2]},
            {"name": "high", "translation": [0, 0.2, 0], "rotation": [0, 0, 0, 1]},
        ],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 3}]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": 4}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }, data


def write_gltf(folder: Path) -> None:
    """The box as a .gltf that holds its buffer."""
    content, data = gltf_content()
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    content["buffers"][0]["uri"] = uri
    (folder / "box.gltf").write_text(json.dumps(content))


def write_box_glb(folder: Path) -> None:
    """The box as a .glb."""
    content, data = gltf_content()
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    parts = struct.pack("<II", len(text), 0x4E4F534A) + text
    parts += struct.pack("<II", len(data), 0x004E4942) + data
    (folder / "box.glb").write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(parts)) + parts)


def write_makehuman(folder: Path) -> None:
    """A data folder of a box with a rig of two bones, and a table."""
    vertices, faces = box_mesh()
    lines = [f"v {x * 10:.3f} {z * 10:.3f} {-y * 10:.3f}" for x, y, z in vertices]
    lines += ["g body"] + [f"f {a + 1}/1 {b + 1}/1 {c + 1}/1" for a, b, c in faces]
    lines += ["g joint-low", "f 1 3 7 5", "g joint-high", "f 2 4 8 6"]
    data = folder / "data"
    (data / "3dobjs").mkdir(parents=True)
    (data / "3dobjs" / "base.obj").write_text("\n".join(lines) + "\n")
    rigs, targets = data / "rigs" / "standard", data / "targets" / "macrodetails"
    (targets / "height").mkdir(parents=True)
    rigs.mkdir(parents=True)
    bones = {
        name: {"parent": parent, "head": {"strategy": "CUBE", "cube_name": f"joint-{name}"}}
        for name, parent in (("high", "low"), ("low", ""))
    }
    (rigs / "rig.two.json").write_text(json.dumps(bones))
    weights = {
        "low": [[k, 1.0] for k in range(0, 8, 2)],
        "high": [[k, 1.0] for k in range(1, 8, 2)],
    }
    (rigs / "weights.two.json").write_text(json.dumps({"weights": weights}))
    for name in (
        "caucasian-male-young",
        "universal-male-young-averagemuscle-averageweight",
        "universal-male-young-averagemuscle-maxweight",
        "height/male-young-averagemuscle-averageweight-maxheight",
    ):
        (targets / f"{name}.target").write_text("# a target\n0 .1 0 0\n4 -.1 .02 0\n")
    table = '[makehuman]\nfolder = "data"\nrig = "two"\nsex = "male"\nheight = 0.5\nweight = 0.3\n'
    (folder / "body.toml").write_text(table)


def use_rig(path: Path) -> None:
    """Reads a rig and looks into the body as a fit does."""
    body = read_rig_body(path)
    spacing_m = body.extent_m / 20
    body.part_points(spacing_m)
    assert body.vertex_normals.shape == body.vertices_m.shape
