"""Mistakes that users of `voxelpose track` make: one clear line, code 2, nothing written."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from benchmarks.library_fuzz_targets import unlearned_proposal
from silhouette_core.monocular.tree.store import read_library, write_library
from tests.clips import waving
from tests.silhouette_core.monocular.tree.small_library import small_library
from tests.sources import ring, write_recording, write_staged
from voxelpose.cli import run

FRAMES = 4


@pytest.fixture(scope="module")
def library_bytes(tmp_path_factory):
    path = tmp_path_factory.mktemp("library") / "small.vplib"
    write_library(replace(small_library(), proposal=unlearned_proposal()), path)
    return path.read_bytes()


@pytest.fixture
def room(desk, library_bytes):
    """A desk with a library and an empty recording of two cameras."""
    write_recording(desk / "walk", ring(2), FRAMES)
    (desk / "lib.vplib").write_bytes(library_bytes)
    return desk


def left(desk):
    return sorted(
        path.name
        for path in desk.iterdir()
        if path.name not in ("site", "walk", "lib.vplib", "bad.vplib")
    )


def refused(desk, capsys, *words):
    """Runs the command; returns what it says in its one line."""
    assert run(["track", "walk", "--out", "x", *words]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert "Traceback" not in "".join(lines)
    assert [line for line in lines if line.startswith("voxelpose: ")] == lines[-1:]
    assert left(desk) == []
    return lines[-1]


TRACK = ("--camera", "cam_1", "--library", "lib.vplib")


def damaged(content, how):
    """A library file with something wrong."""
    if how == "empty":
        return b""
    if how == "no library":
        return b"a letter to my aunt, which is no pose library and long enough to be read"
    if how == "truncated":
        return content[: len(content) // 2]
    if how == "changed":
        return content[:-5000] + bytes([content[-5000] ^ 1]) + content[-4999:]
    length = int.from_bytes(content[:8], "little")
    header = json.loads(content[8 : 8 + length])
    header["__metadata__"]["version"] = "99"
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + content[8 + length :]


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("empty", "bad.vplib cannot be read: the file is empty"),
        ("no library", "bad.vplib is not a pose library, or is damaged"),
        ("truncated", "truncated"),
        ("changed", "changed"),
        ("version", "bad.vplib is a library of version 99, and this program reads version"),
    ],
)
def test_a_library_that_cannot_be_read(room, capsys, library_bytes, how, words):
    (room / "bad.vplib").write_bytes(damaged(library_bytes, how))
    line = refused(room, capsys, "--camera", "cam_1", "--library", "bad.vplib")
    assert words in line and "bad.vplib" in line


def test_a_library_that_is_not_there(room, capsys):
    assert "none.vplib cannot be read" in refused(
        room, capsys, "--camera", "cam_1", "--library", "none.vplib"
    )
    assert "cannot be read" in refused(room, capsys, "--camera", "cam_1", "--library", "site")


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ((), "walk has 2 cameras: choose one with --camera: cam_1, cam_2"),
        (("--camera", "cam_7"), "there is no video of cam_7 in walk"),
        (("--camera", "cam_1,cam_2"), "cam_1,cam_2"),
        ((*TRACK, "--frames", "9:12"), "frames 9:12 are not in the recording"),
        ((*TRACK, "--frames", "first"), "--frames first is not understood"),
        ((*TRACK, "--stature", "17.5"), "17.5"),
        ((*TRACK, "--stature", "-1"), "-1"),
        ((*TRACK, "--stature", "0"), "0"),
        ((*TRACK, "--fps", "0"), "0"),
        ((*TRACK, "--threads", "0"), "--threads = '0' must be a whole number from 1"),
    ],
)
def test_what_is_not_there_or_impossible(room, capsys, words, line):
    assert line in refused(room, capsys, *words)


def test_a_library_without_a_proposal(room, capsys):
    library = read_library(room / "lib.vplib")
    write_library(replace(library, proposal=None), room / "bad.vplib")
    line = refused(room, capsys, "--camera", "cam_1", "--library", "bad.vplib")
    assert "bad.vplib: the library has no proposal" in line and "voxelpose library build" in line


def test_a_single_video_is_a_recording(room, capsys):
    (video,) = (room / "walk").glob("cam_1.*")
    words = str(video.relative_to(room)), "--out", "x"
    assert run(["track", *words, "--library", "lib.vplib", "--frames", "9:12"]) == 2
    assert "frames 9:12 are not in the recording" in capsys.readouterr().err
    assert run(["track", *words, "--camera", "cam_2"]) == 2
    assert "is one video, not of cam_2: leave out --camera" in capsys.readouterr().err
    assert run(["fit", *words]) == 2
    assert f"it is one video: `voxelpose track {words[0]}`" in capsys.readouterr().err


def test_nobody_in_any_frame(room, capsys):
    line = refused(room, capsys, *TRACK, "--stature", "1.75")
    assert "camera cam_1 shows nobody in any frame" in line


@pytest.mark.parametrize("command", [["track", *TRACK], ["fit"]])
def test_a_wall_is_no_person(room, capsys, command):
    for number in (1, 2):
        folder = room / "walk" / "masks" / f"cam_{number}"
        folder.mkdir(parents=True)
        for video in (room / "walk").glob(f"cam_{number}.*"):
            video.unlink()
        wall = np.zeros((120, 160), np.uint8)
        wall[20:100, 40:120] = 255
        for frame in range(FRAMES):
            cv2.imwrite(str(folder / f"{frame}.png"), wall)
    assert run([command[0], "walk", "--out", "x", "--fps", "25", *command[1:]]) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert "cannot be those of a person: those of cam_1 fill a rectangle" in said
    assert f"see {room.resolve() / 'x.silhouettes.png'}" in said
    assert left(room) == ["x.silhouettes.png"]


def test_results_are_not_overwritten_unasked(room, capsys):
    (room / "x").mkdir()
    (room / "x" / "diary.txt").write_text("mine")
    assert run(["track", "walk", "--out", "x", *TRACK]) == 2
    assert "x exists" in capsys.readouterr().err
    assert [path.name for path in (room / "x").iterdir()] == ["diary.txt"]


@pytest.fixture
def tracked(desk, library_bytes, capsys):
    """Tracks three frames of the second of two cameras; returns summary.json."""

    def by(*words):
        (desk / "lib.vplib").write_bytes(library_bytes)
        write_staged(desk / "take", waving(3), ring(2, (320, 240)))
        plain = "--camera cam_2 --library lib.vplib --no-pictures --stature 1.70".split()
        assert run(["track", "take", "--out", "x", *plain, *words]) == 0
        text = capsys.readouterr().out
        assert "3 of 3 frames have a pose" in text
        return json.loads((desk / "x" / "summary.json").read_text()), text

    return by


@pytest.mark.slow
def test_one_camera_of_two_is_tracked(desk, tracked):
    summary, _ = tracked("--start", "any")
    assert summary["cameras"] == ["cam_2"] and summary["estimator"] == "monocular"
    rows = np.genfromtxt(
        desk / "x" / "hypotheses.csv", delimiter=",", names=True, dtype=None, encoding="utf-8"
    )
    assert set(rows["frame"]) == {0, 1, 2} and rows["rank"].max() <= 5


@pytest.mark.parametrize("words", [("--method", "paper"), ("--estimator", "tree")])
def test_the_paper_s_method_tracks_and_claims_nothing(desk, tracked, words):
    summary, text = tracked(*words)
    assert summary["estimator"] == "tree" and summary["verdict"]["level"] == "doubtful"
    assert 'background = "paper"' in (desk / "x" / "settings.toml").read_text()
    assert (desk / "x" / "hypotheses.csv").exists()
    assert summary["conditioning"]["filter"] == "none" and "no filter" in text
    stages = summary["seconds"]["stages"]
    assert [*stages] == ["silhouettes", "estimation", "total"]
    assert stages["silhouettes"]["mean"] + stages["estimation"]["mean"] <= stages["total"]["mean"]
    times = [f"{1000 * stages['total'][key]:.1f}" for key in ("min", "max", "mean")]
    assert ["total", *times] in [line.split() for line in text.splitlines()]


def test_the_paper_s_motion_is_filtered_where_that_is_wanted(tracked):
    summary, _ = tracked("--method", "paper", "--filter", "gaussian")
    assert summary["conditioning"]["filter"] == "gaussian"


def test_the_paper_s_method_has_no_colours_to_leave_out(room, capsys):
    line = refused(room, capsys, *TRACK, "--method", "paper", "--outline-only")
    assert "the tree estimator has no option 'outline_only'" in line


def test_an_unknown_estimator_is_refused(room, capsys):
    line = refused(room, capsys, *TRACK, "--estimator", "leaf")
    assert "'leaf'" in line and "monocular" in line
