"""BVH skeletons as bodies of capsules, and refusals."""

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.body.rigs.bvh_rig import read_bvh_rig


def test_bones_are_capsules_in_the_stated_unit(rig_files, tmp_path):
    rig_files.write_bvh_rig(tmp_path)
    body = read_bvh_rig(tmp_path / "leg.bvh")
    assert body.names == ("hip", "knee") and body.tree.root_fixed
    assert np.allclose(body.joints_m, [[0, 0, 0.9], [0, -0.01, 0.45]])
    assert body.tree.landmark_names == ("hip", "knee", "knee_end")
    assert np.allclose(body.landmarks_m[2], [0, -0.01, 0])
    assert body.tree.dof_names == ("knee.Zrotation", "knee.Xrotation", "knee.Yrotation")
    assert np.allclose(body.tree.dof_axis, [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert np.degrees(body.tree.dof_limits_rad[1]).tolist() == pytest.approx([-10, 120])
    whole = np.pi * 0.03**2 * (0.45 + 4 / 3 * 0.03)
    assert body.part_volumes_m3(0.005)[1] == pytest.approx(whole, rel=0.15)


def test_a_limit_about_y_is_mirrored_where_the_file_turns_about_z(rig_files, tmp_path):
    rig_files.write_bvh_rig(tmp_path)
    (tmp_path / "leg.rig.toml").write_text('unit = "cm"\n[limits.knee]\ny = [-20, 50]\n')
    limits = np.degrees(read_bvh_rig(tmp_path / "leg.bvh").tree.dof_limits_rad[0])
    assert limits.tolist() == pytest.approx([-50, 20])


def test_a_file_without_a_unit_is_refused_with_a_question(rig_files, tmp_path):
    rig_files.write_bvh_rig(tmp_path)
    (tmp_path / "leg.rig.toml").unlink()
    with pytest.raises(InputError, match="which is it"):
        read_bvh_rig(tmp_path / "leg.bvh")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("OFFSET 0 -45 1", "OFFSET 0 0 0", "no length"),
        ("JOINT knee", "JOINT hip", "rename one"),
        ("OFFSET 0 -45 1", "OFFSET 0 -4500000 1", "unit"),
        ("MOTION", "", "cut off"),
        ("OFFSET 0 -45 1", "OFFSET 0 -45", "three numbers"),
        ("CHANNELS 3", "CHANNELS 2", "CHANNELS 2"),
    ],
)
def test_what_cannot_be_a_body_is_refused_in_one_line(rig_files, tmp_path, old, new, words):
    rig_files.write_bvh_rig(tmp_path)
    path = tmp_path / "leg.bvh"
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(InputError, match=words) as refused:
        read_bvh_rig(path)
    assert "leg.bvh" in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('unit = "ell"', "no unit"),
        ('unit = "cm"\nradius = -1', "radius"),
        ('unit = "cm"\n[limits.toe]\nx = [0, 1]', "has limits of"),
        ('unit = "cm"\n[limits.knee]\nx = [9, 1]', "smaller first"),
        ('unit = "cm"\nlimit = 3', "unknown field"),
    ],
)
def test_a_wrong_table_is_refused_by_its_name(rig_files, tmp_path, table, words):
    rig_files.write_bvh_rig(tmp_path)
    (tmp_path / "leg.rig.toml").write_text(table)
    with pytest.raises(InputError, match=words) as refused:
        read_bvh_rig(tmp_path / "leg.bvh")
    assert "leg.rig.toml" in str(refused.value)
