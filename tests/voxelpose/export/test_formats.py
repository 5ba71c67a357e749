"""Several formats at once: whole or not at all."""

import re

import numpy as np
import pytest

from calib.errors import InputError
from calib.upright import UprightFrame
from tests.clips import waving
from voxelpose.export import opensim
from voxelpose.export.formats import EXPORT_RECORD, FORMATS, export_motion, read_export_record


def test_every_format_is_written_and_named(tmp_path):
    files = export_motion(waving(3), tmp_path / "new" / "out")
    assert {path.name for path in files} == {
        *("motion.bvh", "motion.glb", "motion.trc", "motion.mot", "motion.c3d", "motion.npz"),
        *("joints.csv", "joints_wide.csv", "angles.csv", "export.json"),
    }
    assert sorted((tmp_path / "new" / "out").iterdir()) == sorted(files)
    assert all(path.stat().st_size > 100 for path in files)
    assert set(FORMATS) == {"bvh", "glb", "trc", "c3d", "csv", "npz"}


def test_files_of_each_of_several_people_and_one_scene_of_all(tmp_path):
    motions = [waving(4), waving(4, 1.6).select(np.arange(1, 4))]
    files = export_motion(motions, tmp_path / "out", ["glb", "trc", "csv"])
    own = ("motion.trc", "motion.mot", "joints.csv", "joints_wide.csv", "angles.csv", EXPORT_RECORD)
    assert {path.relative_to(tmp_path / "out").as_posix() for path in files} == {
        *(f"person_{k}/{name}" for k in (1, 2) for name in own),
        *("motion.glb", "joints.csv", EXPORT_RECORD),
    }
    assert all(path.is_file() for path in files)
    for k, motion in enumerate(motions, 1):
        export_motion(motion, tmp_path / f"alone_{k}", ["trc", "csv"])
        for name in own:
            alone = (tmp_path / f"alone_{k}" / name).read_bytes()
            assert (tmp_path / "out" / f"person_{k}" / name).read_bytes() == alone
    assert "\n2,1,0.04" in (tmp_path / "out" / "joints.csv").read_text()
    record = read_export_record(tmp_path / "out")["motion.glb"]
    assert [one["frames"]["with_pose"] for one in record.values()] == [4, 3]
    with pytest.raises(InputError, match=r"person_1.motion\.trc exists"):
        export_motion(motions, tmp_path / "out", ["trc"])


def test_one_person_of_a_list_is_as_alone(tmp_path):
    for name, motion in (("one", waving(3)), ("listed", [waving(3)])):
        export_motion(motion, tmp_path / name, ["glb", "csv"])
    names = [path.name for path in (tmp_path / "one").iterdir()]
    assert sorted(names) == sorted(path.name for path in (tmp_path / "listed").iterdir())
    for name in names:
        alone = (tmp_path / "one" / name).read_bytes()
        assert (tmp_path / "listed" / name).read_bytes() == alone


def test_what_exists_is_kept_unless_told(tmp_path):
    (tmp_path / "motion.mot").write_text("mine")
    with pytest.raises(InputError, match=r"motion\.mot exists"):
        export_motion(waving(3), tmp_path, ["csv", "trc"])
    assert [path.name for path in tmp_path.iterdir()] == ["motion.mot"]
    export_motion(waving(3), tmp_path, ["trc"], overwrite=True)
    assert (tmp_path / "motion.mot").read_text().startswith("Coordinates")


@pytest.mark.parametrize(
    "error", [OSError(28, "No space left on device"), KeyboardInterrupt(), ValueError("a bug")]
)
@pytest.mark.parametrize("people", [1, 2])
def test_nothing_is_left_of_what_fails(tmp_path, monkeypatch, error, people):
    def fail(motion, path):
        path.write_text("half")
        raise error

    monkeypatch.setattr(opensim, "write_mot", fail)
    with pytest.raises(InputError if isinstance(error, OSError) else type(error)) as raised:
        export_motion([waving(3)] * people, tmp_path / "out", ["csv", "trc"])
    assert list(tmp_path.iterdir()) == []
    if isinstance(error, OSError):
        assert "the disk is full" in str(raised.value)


@pytest.mark.parametrize(
    ("formats", "line"),
    [(["obj"], "no format 'obj': the formats are bvh"), (["csv", ""], "no format ''")],
)
def test_unknown_formats(tmp_path, formats, line):
    with pytest.raises(InputError, match=line):
        export_motion(waving(2), tmp_path, formats)


def test_no_pose_at_all(tmp_path):
    with pytest.raises(InputError, match="nothing to export"):
        export_motion(waving(2).select(np.zeros(0, int)), tmp_path)


def test_a_file_in_the_way(tmp_path):
    (tmp_path / "out").write_text("")
    with pytest.raises(InputError, match="out cannot be written"):
        export_motion(waving(2), tmp_path / "out", ["csv"])


def test_files_of_a_turned_world_are_upright(tmp_path):
    """All but positions in the world are the same, whatever the calibration's axes."""
    clip = waving(3)
    turned = clip.in_world(UprightFrame.from_up([0.0, 0.2, -1.0], 0.7))
    export_motion(clip, tmp_path / "plain")
    export_motion(turned, tmp_path / "turned")
    for name in ("motion.bvh", "motion.trc", "motion.mot", "angles.csv"):
        texts = [(tmp_path / where / name).read_text() for where in ("plain", "turned")]
        plain, other = (np.array(re.findall(r"-?\d+\.\d+", text), float) for text in texts)
        np.testing.assert_allclose(other, plain, atol=2e-3, err_msg=name)
    joints = [(tmp_path / where / "joints.csv").read_text() for where in ("plain", "turned")]
    assert joints[0] != joints[1]
