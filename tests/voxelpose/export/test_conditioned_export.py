"""Filter and filled frames in every format alike."""

import csv
import json

import ezc3d
import numpy as np
import pygltflib
import pytest

from calib.errors import InputError
from silhouette_core.motion.conditioning import Conditioning, conditioned
from tests.clips import waving
from voxelpose.export.formats import export_motion

WORDS = "Butterworth low-pass, 5 Hz, order 2, forward and backward; 2 missing frames filled"
GAPS = np.r_[0:20, 22:40, 46:70]  # two missing frames, and six


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("export")
    motion = waving(70, fps=50.0).select(GAPS)
    export_motion(conditioned(motion, Conditioning(cutoff_hz=5.0, gap_limit=2)), out)
    return out


@pytest.mark.parametrize("name", ["joints.csv", "joints_wide.csv", "angles.csv"])
def test_tables_mark_what_was_filled(folder, name):
    with (folder / name).open() as file:
        rows = list(csv.DictReader(file))
    assert {int(row["frame"]) for row in rows if row["filled"] == "1"} == {20, 21}
    assert {int(row["frame"]) for row in rows} == {*range(40), *range(46, 70)}
    if name == "joints.csv":
        assert {row["confidence"] for row in rows if row["filled"] == "1"} == {"0.000"}


def test_every_format_holds_the_filled_frames_and_leaves_the_others(folder):
    trc = (folder / "motion.trc").read_text().splitlines()[6:]
    lost = [int(line.split("\t")[0]) - 1 for line in trc if "NaN" in line]
    assert lost == list(range(40, 46)) and len(trc) == 70
    mot = (folder / "motion.mot").read_text()
    times = [float(line.split("\t")[0]) for line in mot.split("time\t")[1].splitlines()[1:]]
    np.testing.assert_allclose(times, np.r_[0:40, 46:70] / 50.0, atol=1e-6)
    c3d = ezc3d.c3d(str(folder / "motion.c3d"))
    residual = c3d["data"]["meta_points"]["residuals"][0, 0]
    np.testing.assert_array_equal(np.flatnonzero(residual < 0), np.arange(40, 46))
    npz = np.load(folder / "motion.npz")
    np.testing.assert_array_equal(npz["frames"][npz["filled"]], [20, 21])
    glb = pygltflib.GLTF2().load(str(folder / "motion.glb"))
    assert glb.accessors[glb.animations[0].samplers[0].input].count == 64
    assert "Frames: 70" in (folder / "motion.bvh").read_text()


def test_every_format_states_filter_and_gaps(folder):
    record = json.loads((folder / "export.json").read_text())["files"]
    others = {path.name for path in folder.iterdir()} - {"export.json"}
    assert set(record) == others
    for entry in record.values():
        assert entry["conditioning"]["words"].startswith(WORDS)
        assert entry["conditioning"]["frames_filled"] == [20, 21]
        assert entry["conditioning"]["frames_left"] == 6
        assert entry["frames"] == {"first": 0, "last": 69, "with_pose": 62}
    assert str(np.load(folder / "motion.npz")["conditioning"]).startswith(WORDS)
    assert f"\n{WORDS}" in (folder / "motion.mot").read_text().split("endheader")[0]
    glb = pygltflib.GLTF2().load(str(folder / "motion.glb"))
    assert glb.extras["conditioning"].startswith(WORDS)
    assert glb.extras["filled_frames"] == [20, 21]
    points = ezc3d.c3d(str(folder / "motion.c3d"))["parameters"]["POINT"]
    assert points["CONDITIONING"]["value"][0].startswith(WORDS)
    assert list(points["FILLED"]["value"]) == [21, 22]  # frames are counted from 1


def test_nothing_is_marked_where_nothing_was_filled(tmp_path):
    export_motion(conditioned(waving(20), Conditioning()), tmp_path, ["csv", "c3d"])
    for name in ("joints.csv", "joints_wide.csv", "angles.csv"):
        assert "filled" not in (tmp_path / name).read_text()
    assert list(
        ezc3d.c3d(str(tmp_path / "motion.c3d"))["parameters"]["POINT"]["FILLED"]["value"]
    ) == [0]


def test_the_record_keeps_what_it_says_of_other_files(tmp_path):
    export_motion(conditioned(waving(40), Conditioning("none")), tmp_path, ["bvh"])
    export_motion(conditioned(waving(40), Conditioning()), tmp_path, ["npz"])
    record = json.loads((tmp_path / "export.json").read_text())["files"]
    assert record["motion.bvh"]["conditioning"]["words"] == "no filter"
    assert record["motion.npz"]["conditioning"]["filter"] == "butterworth"


@pytest.mark.parametrize("text", ["", "[]", '{"files": 3}', '{"files": [1]}', '{"mine": 1}'])
def test_a_file_in_the_place_of_the_record_is_kept(tmp_path, text):
    (tmp_path / "export.json").write_text(text)
    with pytest.raises(InputError, match="is no record of an export"):
        export_motion(waving(3), tmp_path, ["bvh"])
    assert [path.name for path in tmp_path.iterdir()] == ["export.json"]
