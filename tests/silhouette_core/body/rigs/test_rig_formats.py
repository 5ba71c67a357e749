"""The reader is chosen by what is given."""

import pytest

from calib.errors import InputError
from silhouette_core.body.rigs.rig_formats import read_rig_body
from silhouette_core.motion.body_source import load_body


def test_every_format_has_its_reader(rig_files, tmp_path):
    for write in (rig_files.write_bvh_rig, rig_files.write_gltf, rig_files.write_box_glb):
        write(tmp_path)
    rig_files.write_urdf(tmp_path, "stl")
    rig_files.write_makehuman(tmp_path)
    names = ["leg.bvh", "box.gltf", "box.glb", "arm.urdf", "body.toml"]
    roots = [read_rig_body(tmp_path / name).names[0] for name in names]
    assert roots == ["hip", "low", "low", "base", "low"]


@pytest.mark.parametrize("name", ["a.fbx", "nothing.glb", "."])
def test_anything_else_is_refused_by_name(tmp_path, name):
    with pytest.raises(InputError, match=str(tmp_path)):
        read_rig_body(tmp_path / name)


def test_fbx_is_refused_with_the_way_to_glb(tmp_path):
    path = tmp_path / "robot.fbx"
    path.write_bytes(b"")
    for read in (read_rig_body, load_body):
        with pytest.raises(InputError, match=r"robot\.fbx is no rig.*into GLB in Blender"):
            read(path if read is read_rig_body else str(path))
