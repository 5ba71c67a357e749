"""`voxelpose fit --body FILE` with files that hold no body: one line, exit code 2, nothing left."""

import json

import pytest

from tests.sources import ring, write_recording
from voxelpose.cli import run

_URDF = """<robot name="arm">
<link name="base"><visual><geometry><box size="0.2 0.2 0.2"/></geometry></visual></link>
<link name="upper"><visual><geometry><sphere radius="0.1"/></geometry></visual></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="upper"/>
<origin xyz="0 0 0.3"/><axis xyz="1 0 0"/><limit lower="-1" upper="2"/></joint></robot>"""
_BOX = '<box size="0.2 0.2 0.2"/>'
_LAUGHS = '<!DOCTYPE r [<!ENTITY a "ha">' + "".join(
    f'<!ENTITY {"bcdefghij"[k]} "{("&" + "abcdefghi"[k] + ";") * 10}">' for k in range(9)
)
_CHAIN = "".join(
    f'<link name="l{k}"/><joint name="j{k}" type="revolute"><parent link="{above}"/>'
    f'<child link="l{k}"/><axis xyz="1 0 0"/></joint>'
    for k, above in enumerate(["upper", *(f"l{k}" for k in range(299))])
)


def changed_urdf(folder, rig_files, old, new):
    assert old in _URDF
    (folder / "body.urdf").write_text(_URDF.replace(old, new))
    return folder / "body.urdf"


def changed_bvh(folder, rig_files, old, new):
    rig_files.write_bvh_rig(folder)
    path = folder / "leg.bvh"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    return path


def changed_table(folder, rig_files, old, new):
    rig_files.write_bvh_rig(folder)
    (folder / "leg.rig.toml").write_text(new)
    return folder / "leg.bvh"


def changed_gltf(folder, rig_files, old, new):
    """Sets one entry, whose place is named by keys with dots."""
    rig_files.write_gltf(folder)
    path = next(folder.glob("*.gltf"))
    content = json.loads(path.read_text())
    *above, last = (int(key) if key.isdigit() else key for key in old.split("."))
    entry = content
    for key in above:
        entry = entry[key]
    entry[last] = new
    path.write_text(json.dumps(content))
    return path


def changed_makehuman(folder, rig_files, old, new):
    rig_files.write_makehuman(folder)
    path = folder / "data" / "rigs" / "standard" / old.partition("|")[0]
    text, before = path.read_text(), old.partition("|")[2]
    assert before in text
    path.write_text(text.replace(before, new))
    return folder / "body.toml"


def measured(folder, rig_files, old, new):
    text = f'format = "voxelpose body 1"\nsex = "male"\n[measurements]\n{new}\n'
    (folder / "body.toml").write_text(text)
    return folder / "body.toml"


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return write_recording(tmp_path_factory.mktemp("unfit") / "walk", ring(2), 2)


@pytest.mark.parametrize(
    ("write", "old", "new", "words"),
    [
        (changed_urdf, '<parent link="base"/>', '<parent link="upper"/>', "cyclic"),
        (changed_urdf, '<child link="upper"/>', '<child link="gone"/>', "links that it lacks"),
        (changed_urdf, '<robot name="arm">', _LAUGHS + ']><robot name="&j;">', "document type"),
        (changed_urdf, _BOX, '<mesh filename="package://../../etc/passwd"/>', "beside"),
        (changed_urdf, _BOX, '<mesh filename="package://a/../../b.stl"/>', "beside"),
        (changed_urdf, _BOX, '<mesh filename="file:///etc/passwd"/>', "is none of"),
        (changed_urdf, _BOX, '<cylinder radius="1e-12" length="1e-12"/>', "size"),
        (changed_urdf, "</robot>", _CHAIN + "</robot>", "a body can have 250"),
        (changed_urdf, 'xyz="0 0 0.3"', 'xyz="nan 0 0.3"', "far too large"),
        (changed_urdf, 'lower="-1"', 'lower="-90"', "in radians"),
        (changed_bvh, "OFFSET 0 -45 1", "OFFSET 0 0 0", "no length"),
        (changed_bvh, "OFFSET 0 -45 1", "OFFSET 0 nan 1", "damaged hierarchy"),
        (changed_table, "", 'unit = "cm"\nradius = 1e-9', "radius"),
        (changed_gltf, "nodes.2.children", [1], "cyclic"),
        (changed_gltf, "nodes.1.children", [], "not connected"),
        (changed_gltf, "nodes.2.translation", [0, 0, 0], "no length"),
        (changed_gltf, "nodes.0", {"mesh": 0}, "no mesh with a skin"),
        (changed_gltf, "bufferViews.2.byteOffset", 132, "sum to"),
        (changed_gltf, "accessors.0.count", 10**15, "cannot be"),
        (changed_gltf, "bufferViews.0.byteStride", 10**8, "beyond its buffer"),
        (changed_gltf, "buffers.0.uri", "../../../etc/passwd", "beside"),
        (changed_makehuman, 'rig.two.json|"parent": ""', '"parent": "high"', "cyclic"),
        (changed_makehuman, 'rig.two.json|"parent": "low"', '"parent": ""', "not connected"),
        (changed_makehuman, "weights.two.json|[1, 1.0]", "[1, 0.5]", "sum to"),
        (measured, "", "stature_m = 100", "not a person's"),
        (measured, "", "stature_m = nan", "stature_m"),
        (measured, "", "stature_m = 1.7\nwaist_girth_m = 5", "waist_girth_m"),
        (measured, "", "stature_m = 1.7\nmass_kg = 900", "mass_kg"),
    ],
)  # fmt: skip
def test_what_is_no_body_is_refused_in_one_line(
    recording, rig_files, tmp_path, capsys, write, old, new, words
):
    body = write(tmp_path, rig_files, old, new)
    out = tmp_path / "out"
    assert run(["fit", str(recording), "--out", str(out), "--body", str(body)]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1 and said[0].startswith("voxelpose: ")
    assert words in said[0]
    assert str(tmp_path) in said[0] and not out.exists()


def test_a_mesh_with_entities_is_refused(recording, rig_files, tmp_path, capsys):
    """A COLLADA file is XML, too."""
    rig_files.write_urdf(tmp_path, "dae")
    mesh = tmp_path / "part.dae"
    hostile = '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/hostname">]>'
    mesh.write_text(hostile + mesh.read_text())
    out, body = str(tmp_path / "out"), str(tmp_path / "arm.urdf")
    assert run(["fit", str(recording), "--out", out, "--body", body]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert "part.dae" in last and "document type" in last
