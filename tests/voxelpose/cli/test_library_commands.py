"""voxelpose library build and info."""

import numpy as np
import pytest

from silhouette_core.body.presets import body_preset
from silhouette_core.monocular.making import from_motion
from silhouette_core.monocular.tree.store import read_library
from tests.clips import waving
from voxelpose.cli import run
from voxelpose.export.bvh import write_bvh

SMALL = ["--yaw-step", "120", "--poses", "12", "--no-mirror", "--stature", "1.7"]


@pytest.fixture
def clips(desk, monkeypatch):
    """Two clips as BVH files; what takes long, the proposal, is not learned from them."""
    monkeypatch.setattr(from_motion, "learned_from", lambda *_: None)
    (desk / "clips").mkdir()
    for name, count in (("wave_1", 60), ("long_wave_2", 80)):
        write_bvh(waving(count, 1.7), desk / "clips" / f"{name}.bvh")
    return desk / "clips"


def test_build_and_info(clips, desk, capsys):
    more = ["--out", "me.vplib", "--pitch", "4", "--leave-out", "wave_2"]
    assert run(["library", "build", "clips", *SMALL, *more]) == 0
    out = capsys.readouterr().out
    library = read_library(desk / "me.vplib")
    assert library.bases.clips == ("wave_1",)
    assert 0 < len(library) <= 12 and library.model.sizes.stature_m == 1.7
    np.testing.assert_allclose(np.degrees(library.views), [[0, 4], [120, 4], [240, 4]])
    assert {path.name for path in desk.iterdir()} == {"site", "clips", "me.vplib"}
    poses = len(library.bases.angles)
    assert f"{len(library)} = {poses} (0 of them mirror images) x 3 views" in out
    assert run(["library", "info", str(desk / "me.vplib"), "--png", str(desk / "sheet.png")]) == 0
    assert "stature 1.7 m" in capsys.readouterr().out
    assert (desk / "sheet.png").read_bytes().startswith(b"\x89PNG")


def test_build_for_a_named_body(clips, desk, capsys):
    out = desk / "man.vplib"
    words = [str(clips), "--out", str(out), *SMALL[:-2], "--body", "104E6"]
    assert run(["library", "build", *words]) == 0
    body = body_preset("104E6").body()
    made = read_library(out).model
    np.testing.assert_allclose(made.vertices_m, body.vertices_m, atol=1e-6)
    assert "stature 1.75 m, chest 1.04 m, sex male" in capsys.readouterr().out
    assert run(["library", "build", *words[:-1], "nobody"]) == 2
    assert "there is no body nobody" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("info nothing.vplib", "the library nothing.vplib cannot be read"),
        ("info clips/wave_1.bvh", "is not a pose library"),
        ("mend x", "there is no command 'library mend': there are library build, library info"),
        ("build clips --out x --leave-out dance", "--leave-out dance: no clip is called so"),
        ("build clips --out x --leave-out wave_1 --leave-out wave_2", "no poses are left"),
        ("build nowhere --out x", "nowhere does not exist"),
        ("build clips --out x --yaw-step 50", "does not divide the full turn"),
        ("build clips --out x --poses 5", "5 poses are too few"),
        ("build clips --out x --pitch 200", "not one a standing camera has"),
        (
            f"build clips --out clips/wave_1.bvh {' '.join(SMALL)}",
            "is not a pose library, so it is not overwritten",
        ),
    ],
)
def test_mistakes_are_one_line(clips, desk, monkeypatch, capsys, words, line):
    monkeypatch.chdir(desk)
    assert run(["library", *words.split()]) == 2
    (error,) = [e for e in capsys.readouterr().err.splitlines() if e.startswith("voxelpose: ")]
    assert line in error
    assert not (desk / "x").exists()


def test_help_lists_both(capsys):
    with pytest.raises(SystemExit) as end:
        run(["library", "--help"])
    assert end.value.code == 0
    out = capsys.readouterr().out
    assert "build " in out and "info " in out
