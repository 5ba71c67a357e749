"""From pictures of a board to a rig, through the command line; and what is said where that cannot
be.
"""

import json
import shutil
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from benchmarks.board_scene import FACE_UP, room, without_poses
from calib.board import Board
from calib.camera import Rig
from calib.errors import InputError
from calib.extrinsics import pose_difference
from calib.files import read_rig, write_rig
from calib.files.anipose import read_notes, read_up
from calib.upright import UprightFrame
from silhouette_core.motion.motion_file import write_motion
from tests.clips import FIRST_SUMMARY, waving
from tests.sources import ring, write_film
from tests.voxelpose.board_films import film_boards
from voxelpose.cli import run

BOARD = Board(8, 5, 0.15)
LIKE_THIS = ["--board", "8x5", "--square", "0.15"]
FLOOR_M = np.array([-0.4, -0.3, 0])  # the middle of the board on the floor
SIZE = (480, 360)


@pytest.fixture(scope="module")
def truth() -> Rig:
    return room(3, 2.4, size=SIZE, arc_deg=80)


@pytest.fixture(scope="module")
def studio(truth, tmp_path_factory) -> Path:
    """Stills of the board before each camera, and videos of it being carried about after it lay on
    the floor.
    """
    return film_boards(tmp_path_factory.mktemp("studio"), truth, BOARD, FLOOR_M)


@pytest.fixture(scope="module")
def lenses(truth, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("lenses") / "lenses.toml"
    write_rig(without_poses(truth), path)
    return path


def calibrate(*words) -> int:
    return run(["calibrate", *map(str, words)])


def failure(capsys, *words) -> str:
    """Runs a command that must fail with one line; returns the line."""
    capsys.readouterr()
    assert calibrate(*words) == 2
    return capsys.readouterr().err.splitlines()[-1]


def test_from_stills_and_videos_to_a_rig_in_another_format(studio, truth, tmp_path, capsys):
    calibration = tmp_path / "lenses.toml"
    assert calibrate("intrinsics", studio / "stills", *LIKE_THIS, "--out", calibration) == 0
    output = capsys.readouterr().out
    assert "used" in output and "distortion" in output
    result = read_rig(calibration)
    for camera in truth:
        np.testing.assert_allclose(
            np.diag(result[camera.name].matrix)[:2], np.diag(camera.matrix)[:2], rtol=0.01
        )
    assert tomllib.loads(calibration.read_text())["metadata"]["intrinsics"]["cam_0"]["rms_px"] < 0.3
    report = json.loads((tmp_path / "lenses_lenses.json").read_text())
    assert report["cam_1"]["pictures"][0]["picture"] == "00.png"
    assert cv2.imread(str(tmp_path / "lenses_coverage.png")).std() > 10

    rig_path = tmp_path / "calibration.toml"
    words = [studio / "walk", "--intrinsics", calibration, *LIKE_THIS, "--floor", "0"]
    assert calibrate("extrinsics", *words, "--out", rig_path) == 0
    output = capsys.readouterr().out
    assert "reference" in output
    assert "boards that pairs of cameras share: cam_0-cam_1" in output
    # The world begins at the board's first corner on the floor.
    corner = FLOOR_M - FACE_UP @ BOARD.points_m.mean(axis=0)
    rig = read_rig(rig_path)
    for camera in truth:
        moved = replace(camera, translation=camera.translation + camera.rotation @ corner)
        millimetres, degrees = pose_difference(rig[camera.name], moved)
        assert millimetres < 30 and degrees < 0.7
    notes = tomllib.loads(rig_path.read_text())["metadata"]
    assert notes["extrinsics"]["cam_2"]["position_standard_error_mm"] < 20
    assert notes["intrinsics"]["cam_2"]["pictures"] > 4
    assert cv2.imread(str(tmp_path / "calibration_rig.png")).std() > 5

    assert calibrate("convert", rig_path, tmp_path / "easymocap") == 0
    again = read_rig(tmp_path / "easymocap")
    for camera in rig:
        assert pose_difference(again[camera.name], camera)[0] < 1e-6
    assert {path.name for path in tmp_path.iterdir()} == {
        *("calibration.toml", "calibration_places.json", "calibration_rig.png"),
        *("easymocap", "lenses.toml", "lenses_coverage.png", "lenses_lenses.json"),
    }


def test_pictures_that_exif_data_turn_have_one_lens(studio, truth, tmp_path, capsys):
    """Pixels as the sensor has them, and a number that says how to turn them."""
    (tmp_path / "cam_0").mkdir()
    for at, still in enumerate(sorted((studio / "stills" / "cam_0").glob("*.png"))):
        data = Image.Exif()
        data[0x0112] = (3, 1, 6, 8)[at % 4]
        file = tmp_path / "cam_0" / f"{at:02d}.jpg"
        Image.open(still).convert("RGB").save(file, quality=95, exif=data)
    out = tmp_path / "lens.toml"
    assert calibrate("intrinsics", tmp_path / "cam_0", *LIKE_THIS, "--out", out) == 0
    assert "turned back to the sensor's pixels" in capsys.readouterr().err
    camera = read_rig(out, lenses=True)["cam_0"]
    assert camera.size == SIZE
    known = truth["cam_0"].matrix
    np.testing.assert_allclose(camera.matrix, known, atol=0.01 * known[0, 0])


@pytest.mark.accuracy
@pytest.mark.parametrize(
    ("name", "kind", "asked", "words"),
    [
        (
            "charuco_legacy",
            "legacy",
            ["--board", "5x8", "--marker", "0.0216"],
            "it has 8 x 5 inner corners), and its",
        ),
        ("board_exif_mixed", "exif3", ["--board", "8x5"], "turned back to the sensor's pixels"),
        ("board_exif_mixed", "exif6", ["--board", "8x5"], "turned back to the sensor's pixels"),
    ],
)
def test_shared_pictures_of_boards(shared, tmp_path, capsys, name, kind, asked, words):
    script = shared / "cases" / "scripts" / name / "boards.py"
    if not script.is_file():
        pytest.skip(f"no script that draws boards at {script}")
    subprocess.run([sys.executable, script, tmp_path / "cam_1", kind, "1"], check=True)
    out = tmp_path / "lens.toml"
    given = ["intrinsics", tmp_path / "cam_1", "--square", "0.03", *asked]
    assert calibrate(*given, "--out", out) == 0
    assert words in capsys.readouterr().err
    matrix = read_rig(out, lenses=True)["cam_1"].matrix
    np.testing.assert_allclose(matrix, [[820, 0, 505], [0, 820, 345], [0, 0, 1]], atol=3)
    error_px = read_notes(out)["intrinsics"]["cam_1"]["focal_standard_error_px"]
    assert (np.abs(np.diag(matrix)[:2] - 820) < 3 * np.array(error_px)).all()


def test_a_video_gives_a_lens_too(studio, tmp_path, capsys):
    stills = sorted((studio / "stills" / "cam_0").glob("*.png"))
    pictures = [cv2.imread(str(still)) for still in stills]
    boards = tmp_path / "boards"
    boards.mkdir()
    write_film(boards / "cam_0.avi", [picture for picture in pictures for _ in range(2)])
    # A camera that saw no board does not cost the others their lenses; nor is this folder one.
    for name in ("blank", "extrinsics"):
        (boards / name).mkdir()
        cv2.imwrite(str(boards / name / "0.png"), np.full((120, 160), 128, np.uint8))
    words = ["intrinsics", boards, *LIKE_THIS, "--frames", "8"]
    words += ["--out", tmp_path / "lens.toml"]
    assert calibrate(*words) == 0
    out, err = capsys.readouterr()
    assert "shows the board much as another frame does" in out and "lenses of 1 cameras" in out
    assert "blank: the board was found in none of 1 pictures" in err and "extrinsics" not in err
    report = json.loads((tmp_path / "lens_lenses.json").read_text())["cam_0"]
    assert sum(line["left_out"] is None for line in report["pictures"]) <= 8
    assert "there are blank, cam_0" in failure(capsys, *words, "--cameras", "cam_9", "--overwrite")
    assert "exists: give --out another name, or add --overwrite" in failure(capsys, *words)


def test_many_pictures_in_a_folder_are_a_film(studio, tmp_path, capsys):
    (tmp_path / "cam_0").mkdir()
    for number, still in enumerate(sorted((studio / "stills" / "cam_0").glob("*.png"))):
        for copy in range(6):
            shutil.copy(still, tmp_path / "cam_0" / f"{6 * number + copy:04d}.png")
    words = ["intrinsics", tmp_path / "cam_0", *LIKE_THIS, "--frames", "8"]
    assert calibrate(*words, "--out", tmp_path / "lens.toml") == 0
    assert "shows the board much as another frame does" in capsys.readouterr().out
    report = json.loads((tmp_path / "lens_lenses.json").read_text())["cam_0"]
    assert len(report["pictures"]) == 72
    assert sum(line["left_out"] is None for line in report["pictures"]) <= 8


def test_boards_that_are_not_there_are_told_of(studio, tmp_path, capsys):
    one = studio / "stills" / "cam_0"
    start = [capsys, "intrinsics", "--out", tmp_path / "lens.toml"]
    for pictures, board, square, line in (
        (one / "00.png", "9x4", "0.15", "a board with 8 x 5 inner corners is there, not 9 x 4"),
        (one / "00.png", "8x5", "0.15", "1 of 1 pictures serve, 4 are needed"),
        (one, "8x5", "150", "give metres, 0.15 for millimetres"),
        (one, "8by5", "0.15", "--board 8by5 is not understood"),
    ):
        assert line in failure(*start, pictures, "--board", board, "--square", square)
    blank = tmp_path / "blank"
    blank.mkdir()
    cv2.imwrite(str(blank / "0.png"), np.full((120, 160), 128, np.uint8))
    said = failure(*start, blank, *LIKE_THIS)
    assert "camera blank: the board was found in none of 1 pictures: no board with 8 x 5" in said
    cv2.imwrite(str(blank / "0.png"), cv2.resize(cv2.imread(str(one / "00.png")), (720, 540)))
    (blank / "1.png").write_bytes((one / "00.png").read_bytes())
    said = failure(*start, blank, *LIKE_THIS)
    assert "camera blank: pictures of different sizes (1.png 480x360, 0.png 720x540)" in said
    assert "holds no pictures" in failure(*start, studio, *LIKE_THIS)
    assert not (tmp_path / "lens.toml").exists()


def test_cameras_that_never_see_the_board_together_are_told_of(studio, lenses, tmp_path, capsys):
    walk = tmp_path / "walk"
    walk.mkdir()
    for name, kept in (("cam_0", slice(0, 4)), ("cam_1", slice(4, 8))):
        capture = cv2.VideoCapture(str(studio / "walk" / f"{name}.avi"))
        frames = [capture.read()[1] for _ in range(8)]
        blank = np.full_like(frames[0], 128)
        write_film(
            walk / f"{name}.avi",
            [frame if index in range(8)[kept] else blank for index, frame in enumerate(frames)],
        )
    start = ["extrinsics", walk, "--intrinsics", lenses, "--out", tmp_path / "rig.toml"]
    together = failure(capsys, *start, *LIKE_THIS, "--cameras", "cam_0,cam_1")
    assert "no two cameras saw the board at the same moment (moments: cam_0 " in together
    assert "no pictures of cam_2" in failure(capsys, *start, *LIKE_THIS)
    assert "what does the board look like?" in failure(capsys, *start)
    assert "--floor 40 is not in the recording: it has frames 0 to 7" in failure(
        capsys, *start, *LIKE_THIS, "--cameras", "cam_0,cam_1", "--floor", "40"
    )
    assert "give either RECORDING" in failure(capsys, "extrinsics", *start[2:])


def test_what_a_conversion_leaves_out_is_said(truth, tmp_path, capsys):
    rig, out = tmp_path / "rig.qca.txt", tmp_path / "out.toml"
    write_rig(truth, rig)
    text = rig.read_text()
    first, second = truth.names[:2]
    mixed = text.replace(f'"none" serial="{first}"', f'"Miqus M3" serial="{first}"')
    rig.write_text(mixed)
    assert mixed != text and calibrate("convert", rig, out) == 0
    assert f"left out cameras for markers: {first} (Miqus M3)" in capsys.readouterr().out
    assert first not in read_rig(out)
    words = ["convert", rig, out, "--overwrite", "--cameras"]
    assert calibrate(*words, first) == 0
    assert read_rig(out).names == (first,)
    assert f"no calibration for x: the rig has {second}" in failure(capsys, *words, "x")


def test_listed_points_place_cameras(truth, lenses, tmp_path, capsys):
    scene = np.random.default_rng(0).uniform([-1, -1, 0], [1, 1, 1.8], (12, 3))
    lines = ["camera,point,x_px,y_px,x_m,y_m,z_m"]
    for camera in truth:
        for index, (pixel, place) in enumerate(zip(camera.project(scene)[0], scene, strict=True)):
            measured = ",".join(map(str, place)) if index < 6 and camera.name == "cam_0" else ",,"
            lines.append(f"{camera.name},p{index},{pixel[0]},{pixel[1]},{measured}")
    points = tmp_path / "points.csv"
    points.write_text("\n".join(lines))
    # As Caliscope writes lenses: no positions yet, and no unit.
    kept = [line for line in lenses.read_text().splitlines() if "tion = " not in line]
    alone = tmp_path / "lenses.toml"
    alone.write_text("\n".join(line for line in kept if "unit" not in line))
    words = ["extrinsics", "--points", points, "--intrinsics", alone]
    words += ["--out", tmp_path / "rig.json"]
    assert calibrate(*words) == 0
    assert "points that pairs of cameras share: cam_0-cam_1 12" in capsys.readouterr().out
    for camera in read_rig(tmp_path / "rig.json"):
        assert pose_difference(camera, truth[camera.name])[0] < 1
    points.write_text("\n".join(lines).replace("p3,", "p3,x", 1))
    assert "points.csv line 5: x_px, y_px must be numbers" in failure(capsys, *words, "--overwrite")
    points.write_text("camera,point,x_px\ncam_0,a,1")
    assert "no column y_px" in failure(capsys, *words, "--overwrite")


def test_units_are_stated_or_asked_for(truth, tmp_path, capsys):
    write_rig(truth, tmp_path / "rig.toml")
    text = (tmp_path / "rig.toml").read_text().replace('unit = "m"', "")
    (tmp_path / "rig.toml").write_text(text)
    words = ["convert", tmp_path / "rig.toml", tmp_path / "out.json"]
    assert "in which unit are its lengths?" in failure(capsys, *words)
    assert calibrate(*words, "--unit", "mm", "--picture", tmp_path / "rig.png") == 0
    assert "in metres" in capsys.readouterr().out
    np.testing.assert_allclose(
        read_rig(tmp_path / "out.json")["cam_0"].center_m, truth["cam_0"].center_m / 1000, atol=1e-9
    )
    assert cv2.imread(str(tmp_path / "rig.png")).std() > 5
    words += ["--unit", "m", "--overwrite", "--size", "640"]
    assert "--size 640 is not understood" in failure(capsys, *words)


def test_a_printed_board_says_what_to_measure(tmp_path, capsys):
    assert calibrate("board", "--out", tmp_path / "board.pdf", "--paper", "a3", "--charuco") == 0
    output = capsys.readouterr().out
    assert "9 squares in a row are 360 mm" in output
    assert "--board 8x5 --square 0.04 --marker 0.03 --dictionary DICT_4X4_50" in output
    words = ["board", "--out", tmp_path / "b.pdf", "--paper", "large"]
    assert "say how large a square is" in failure(capsys, *words)


def test_a_world_with_z_into_the_floor_is_put_right(tmp_path, capsys):
    """By its cameras, by a named axis, and by a fit, which knows the floor as well."""
    upright = ring(3)
    frame = UprightFrame.from_up([0.0, 0.0, -1.0], -0.5)
    places = [(c.rotation @ frame.rotation, c.translation + c.rotation[:, 2] / 2) for c in upright]
    wrong = Rig(
        tuple(
            replace(camera, rotation=rotation, translation=translation)
            for camera, (rotation, translation) in zip(upright, places, strict=True)
        )
    )
    source = tmp_path / "board.toml"
    write_rig(wrong, source)
    result = tmp_path / "fitted"
    result.mkdir()
    write_motion(waving(2).in_world(frame), result / "motion.safetensors")
    write_rig(wrong, result / "calibration.toml")
    (result / "settings.toml").write_text("")
    (result / "summary.json").write_text(json.dumps(FIRST_SUMMARY))
    for number, words in enumerate((["cameras"], ["-z"], ["person", "--result", str(result)])):
        out = tmp_path / f"{number}.toml"
        option = [f"--up={words[0]}", *words[1:]]
        assert calibrate("convert", source, out, *option) == 0
        assert "z is now up, which was -z" in capsys.readouterr().out
        for camera, expected in zip(read_rig(out), upright, strict=True):
            np.testing.assert_allclose(camera.rotation, expected.rotation, atol=1e-9)
            height = expected.center_m[2] - (0.0 if words[0] == "person" else 0.5)
            assert camera.center_m[2] == pytest.approx(height, abs=1e-9)
        assert read_up(out) == pytest.approx([0, 0, 1])
    failing = ["convert", source, tmp_path / "x.toml"]
    assert "--up person needs --result" in failure(capsys, *failing, "--up", "person")
    assert "--up=sky is no direction" in failure(capsys, *failing, "--up", "sky")
    source.write_text(source.read_text().replace('unit = "m"', 'unit = "m"\nup = "sky"'))
    with pytest.raises(InputError, match='up = "sky" is no direction: give an axis'):
        read_up(source)
