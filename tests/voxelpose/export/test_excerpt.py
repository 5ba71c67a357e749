"""Some frames, another rate, on the spot; FBX by Blender."""

import json
import os
import sys

import numpy as np
import pytest

from calib.errors import InputError
from calib.upright import UprightFrame
from silhouette_core.motion.conditioning import Conditioning, conditioned
from tests.clips import waving
from tests.voxelpose.export.glb_reader import Glb
from voxelpose.export.excerpt import Excerpt, at_rate
from voxelpose.export.formats import export_motion, read_export_record


def test_some_frames_alone():
    motion = waving(9).select(np.array([1, 2, 4, 6, 7]))
    assert Excerpt(frames=(2, 7)).of(motion).frames.tolist() == [2, 4, 6]
    assert Excerpt(frames=(None, 2)).of(motion).frames.tolist() == [1]
    with pytest.raises(InputError, match="none of these frames has a pose: they are among 1 to 7"):
        Excerpt(frames=(8, None)).of(motion)


def test_another_rate_keeps_the_clock_the_poses_and_the_gaps():
    clip = waving(40)
    motion = clip.select(np.r_[5:20, 24:40])
    twice = at_rate(motion, 50.0)
    even = twice.frames % 2 == 0
    assert twice.frames.tolist() == [*range(10, 39), *range(48, 79)]
    np.testing.assert_allclose(twice.time_s, twice.frames / 50.0, atol=1e-9)
    np.testing.assert_allclose(twice.root_m[even], motion.root_m, atol=1e-12)
    between = twice.select(~even)
    whole = waving(79, fps=50.0)  # the same movement, twice as finely
    rows = np.searchsorted(whole.frames, between.frames)
    np.testing.assert_allclose(between.landmarks(), whole.select(rows).landmarks(), atol=2e-3)
    assert at_rate(motion, 10.0).frames.tolist() == [*range(2, 8), *range(10, 16)]


def test_what_was_filtered_is_said_at_a_rate_that_could_not_be(tmp_path):
    motion = conditioned(waving(60, fps=50.0), Conditioning())
    export_motion(motion, tmp_path, ["glb"], excerpt=Excerpt(rate_hz=10.0))
    record = read_export_record(tmp_path)["motion.glb"]
    assert record["fps"] == 10.0 and record["sampled_from_hz"] == 50.0
    assert record["conditioning"]["words"].startswith("Butterworth low-pass, 7 Hz")
    assert record["conditioning"]["frames_unfiltered"] == 0
    document = Glb(tmp_path / "motion.glb").document
    assert document["extras"]["fps"] == 10.0
    assert "not filtered" not in document["extras"]["conditioning"]


def test_on_the_spot_the_pelvis_rises_alone():
    clip = waving(5)
    for motion in (clip, clip.in_world(UprightFrame.from_up([0.0, 0.2, -1.0], 0.7))):
        place = Excerpt(in_place=True).of(motion).upright().root_m
        np.testing.assert_allclose(place, clip.root_m * (0, 0, 1), atol=1e-9)


def test_an_excerpt_is_marked(tmp_path):
    asked = Excerpt((1, 4), in_place=True, skeleton="mixamo")
    export_motion(waving(6), tmp_path, ["bvh"], excerpt=asked)
    record = json.loads((tmp_path / "export.json").read_text())["files"]["motion.bvh"]
    assert record["frames"] == {"first": 1, "last": 3, "with_pose": 3}
    assert record["skeleton"] == "mixamo" and record["in_place"] is True
    assert "JOINT mixamorig:LeftForeArm" in (tmp_path / "motion.bvh").read_text()


def test_fbx_is_made_where_blender_is(tmp_path, monkeypatch):
    """A stand-in for Blender, which takes the same words."""
    program = tmp_path / "bin" / "blender"
    program.parent.mkdir()
    monkeypatch.setenv("PATH", str(program.parent))

    def exported(folder):
        notes = list[str]()
        paths = export_motion(waving(3), tmp_path / folder, ["fbx"], notes=notes)
        return {path.name for path in paths}, notes

    written = {"motion.glb", "to_fbx.py", "export.json"}
    assert exported("without") == (written, ["no motion.fbx is made: Blender is not on the path"])
    script = (tmp_path / "without" / "to_fbx.py").read_text()
    compile(script, "to_fbx.py", "exec")
    assert "fps, scene.render.fps_base = 25, 1.0" in script
    program.write_text(
        f"#!{sys.executable}\nimport sys\nopen('motion.fbx', 'w').write(sys.argv[-1])\n"
    )
    program.chmod(0o755)
    if os.name == "posix":
        assert exported("with") == (written | {"motion.fbx"}, [])
        assert (tmp_path / "with" / "motion.fbx").read_text() == "to_fbx.py"
        program.write_text(f"#!{sys.executable}\nraise SystemExit('no such operator')\n")
        names, notes = exported("failing")
        assert names == written and notes[0].endswith("Blender failed: no such operator")
