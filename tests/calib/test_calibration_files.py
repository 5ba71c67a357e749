"""Calibration formats: round trips, dialects, and messages of one line."""

import contextlib
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from rigs import BENT, FISHEYE, PINHOLE, PRISM, RATIONAL, assert_same_rig, refusal, some_rig

from calib.errors import InputError
from calib.files import read_rig, write_rig
from calib.files.anipose import read_up
from calib.files.plain import decompose
from calib.rotation import matrix_from_rodrigues

CAMERA = """
[cam_1]
name = "left"
size = [640, 480]
matrix = [[600.0, 0.0, 320.0], [0.0, 600.0, 240.0], [0.0, 0.0, 1.0]]
distortions = [0.0, 0.0, 0.0, 0.0, 0.0]
rotation = [0.1, 0.2, 0.3]
translation = [100.0, 200.0, 4000.0]
"""
MM = '[metadata]\nunit = "mm"\n'
ROTATION, LENS = "[0.1, 0.2, 0.3]", "[0.0, 0.0, 0.0, 0.0, 0.0]"


def write(folder: Path, text: str, name: str = "calibration.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", ["rig.toml", "rig.yml", "rig.yaml", "rig.xml", "rig.json"])
def test_what_was_written_is_read(tmp_path, name):
    rig = some_rig(PINHOLE, BENT, RATIONAL, PRISM, FISHEYE)
    write_rig(rig, tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert_same_rig(rig, read_rig(tmp_path / name))
    assert_same_rig(rig, read_rig(tmp_path / name, unit="m"))


def test_opencv_json_is_read(tmp_path):
    rig = some_rig(PINHOLE, RATIONAL, FISHEYE)
    write_rig(rig, tmp_path / "rig.json", style="opencv")
    assert_same_rig(rig, read_rig(tmp_path / "rig.json"))


@pytest.mark.parametrize("name", ["rig", "rig.qca.txt"])
def test_five_term_formats_written_are_read(tmp_path, name):
    rig = some_rig(PINHOLE, BENT, BENT)
    for _ in range(2):  # over an older one, too
        write_rig(rig, tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert_same_rig(rig, read_rig(tmp_path / name), atol=1e-12)
    words = r"camera cam_1: .* k1 k2 p1 p2 k3 and no more: write TOML"
    for lens in (FISHEYE, PRISM):
        with pytest.raises(InputError, match=words):
            write_rig(some_rig(lens), tmp_path / f"new_{name}")
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_projections_written_are_read(tmp_path):
    rig = some_rig(PINHOLE, PINHOLE, PINHOLE)
    write_rig(rig, tmp_path / "rig.json", style="projections")
    back = read_rig(tmp_path / "rig.json")
    assert back.names == rig.names
    for a, b in zip(rig, back, strict=True):
        assert a.size == b.size
        np.testing.assert_allclose(a.projection, b.projection, rtol=1e-12)
    with pytest.raises(InputError, match="cam_1: a 3x4 matrix cannot hold lens distortion"):
        write_rig(some_rig(BENT), tmp_path / "bent.json", style="projections")
    assert not (tmp_path / "bent.json").exists()


def test_unknown_styles_suffixes_and_folders_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"no calibration format has the suffix '\.abc'"):
        write_rig(some_rig(PINHOLE), tmp_path / "rig.abc")
    with pytest.raises(InputError, match="no calibration format 'abc': choose one of anipose"):
        write_rig(some_rig(PINHOLE), tmp_path / "rig.txt", style="abc")
    for name in ("rig.toml", "rig.yml", "rig", "rig.txt"):
        with pytest.raises(InputError, match="cannot be written"):
            write_rig(some_rig(PINHOLE), tmp_path / "missing" / name)


def test_lengths_become_metres(tmp_path):
    assert read_rig(write(tmp_path, CAMERA + MM))["left"].translation.tolist() == [0.1, 0.2, 4.0]
    assert read_rig(write(tmp_path, CAMERA), unit="cm")["left"].translation.tolist() == [1, 2, 40]


def test_an_unknown_unit_is_asked_for(tmp_path):
    assert 'unit = "m" or pass --unit m|cm|mm' in refusal(write(tmp_path, CAMERA))
    assert "not 'inch'" in refusal(write(tmp_path, CAMERA + MM.replace("mm", "inch")))
    said = refusal(write(tmp_path, CAMERA + MM), unit="m")
    assert "the file says its unit is mm, --unit says m" in said


def test_freemocap_dialect(tmp_path):
    text = CAMERA + "fisheye = true\n[metadata]\ncharuco_square_size = 58.0\n"
    text += "groundplane_calibration = false\n[metadata.recording_info]\nx = 1\n"
    for terms, values in (("0.1, 0.0, 0.0, 0.0]", [0.1, 0, 0, 0]), ("0.0, " * 4 + "0.0]", [0] * 4)):
        path = write(tmp_path, text.replace("0.0, 0.0, 0.0, 0.0, 0.0]", terms))
        camera = read_rig(path, unit="mm")["left"]
        assert camera.fisheye and camera.distortion.tolist() == values


def test_pose2sim_dialect(tmp_path):
    text = CAMERA.replace("[640, 480]", "[ 640.0, 480.0]").replace('name = "left"\n', "")
    text += "[metadata]\nadjusted = false\nerror = 0.0\n"
    rig = read_rig(write(tmp_path, text), unit="m")
    assert rig.names == ("cam_1",) and rig["cam_1"].size == (640, 480)


def test_caliscope_dialect(tmp_path):
    rows = matrix_from_rodrigues([0.1, 0.2, 0.3]).tolist()
    text = CAMERA.replace("[cam_1]", "[cameras.1]\ncam_id = 1\nrotation_count = -1\nignore = false")
    text = text.replace("[0.1, 0.2, 0.3]", str(rows)).replace('name = "left"\n', "")
    text += "[cameras.2]\nignore = true\nmatrix = []\n"
    text += "[charuco]\ncolumns = 4\n[capture_volume]\nstage = 2\n"
    rig = read_rig(write(tmp_path, "CreationDate = 2023-03-31T09:56:43\n" + text), unit="m")
    assert rig.names == ("cam_1",)
    np.testing.assert_allclose(rig["cam_1"].rotation, rows, atol=1e-15)


def test_a_rounded_rotation_matrix_is_made_a_rotation_again(tmp_path):
    rows = matrix_from_rodrigues([0.1, 0.2, 0.3]).round(3).tolist()
    path = write(tmp_path, CAMERA.replace("[0.1, 0.2, 0.3]", str(rows)) + MM)
    rotation = read_rig(path)["left"].rotation
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (ROTATION, "[nan, 0.2, 0.3]", "rotation holds a NaN"),
        ("[[600.0", "[[inf", "matrix holds a NaN or infinite number"),
        ("[[600.0", "[[0.0", "focal lengths must be positive, got 0 and 600"),
        ("[[600.0", "[[-600.0", "focal lengths must be positive, got -600 and 600"),
        (ROTATION, "[[1,0,0],[0,1,0],[0,0,-1]]", "rotation is not a rotation matrix (off by 2)"),
        (ROTATION, "[[2,0,0],[0,1,0],[0,0,1]]", "rotation is not a rotation matrix (off by 1)"),
        (ROTATION, "[10.0, 20.0, 30.0]", "rotation [10.0, 20.0, 30.0] turns more than once"),
        (ROTATION, "[0.1, 0.2]", "rotation must be 3 (Rodrigues) or 9 (matrix) numbers, got 2"),
        (f"rotation = {ROTATION}\n", "", "rotation is missing"),
        ("100.0, 200.0, 4000.0", "100.0, 200.0", "translation must have shape (3,), got (2,)"),
        ("100.0, 200", '"a", 200', "translation must be numbers, got ['a', 200.0, 4000.0]"),
        (LENS, "[0, 0, 0]", "distortion must have 0 or 4 or 5 or 8 or 12 or 14 numbers, got 3"),
        ("[640,", "[640.5,", "size must be width and height in whole pixels, got [640.5, 480]"),
        ("size = [640, 480]\n", "", "the image size is not in the file"),
        ("0.0, 1.0]]", "0.0, 2.0]]", "matrix must be [[fx, s, cx], [0, fy, cy], [0, 0, 1]]"),
        ("[cam_1]", "[cam_1]\nfisheye = 3", "fisheye must be true or false, got 3"),
    ],
)
def test_each_mistake_is_named_with_its_camera(tmp_path, old, new, message):
    assert old in CAMERA
    said = refusal(write(tmp_path, CAMERA.replace(old, new, 1) + MM))
    assert f"camera left: {message}" in said


def test_files_without_cameras_or_with_two_of_a_name_are_refused(tmp_path):
    assert "no camera in it" in refusal(write(tmp_path, "[settings]\nx = 1\n"))
    twice = write(tmp_path, CAMERA + CAMERA.replace("cam_1", "cam_2") + MM)
    assert "these appear more than once: left: give every camera its own name" in refusal(twice)
    assert "no such calibration file" in refusal(tmp_path / "nothing.toml")
    assert "no camera in it" in refusal(tmp_path)
    (tmp_path / "binary.toml").write_bytes(bytes(range(128, 256)))
    assert "not a text file" in refusal(tmp_path / "binary.toml")


def storage(path: Path, **entries) -> Path:
    """Writes an OpenCV file as a user's own script would."""
    path.parent.mkdir(parents=True, exist_ok=True)
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for key, value in entries.items():
        file.write(key, value)
    file.release()
    return path


OWN = {
    "CameraMatrix": np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]]),
    "DistortionCoeffs": np.zeros((5, 1)),
    "rvec": np.array([[0.1], [0.2], [0.3]]),
    "tvec": np.array([[100.0], [200.0], [4000.0]]),
    "image_width": 640,
    "image_height": 480,
}


def test_opencv_folder_of_a_file_or_a_folder_per_camera(tmp_path):
    for name in ("cam1", "cam2"):
        storage(tmp_path / "folders" / name / "config.xml", **OWN)
        storage(tmp_path / "files" / f"{name}.yml", **OWN)
    (tmp_path / "folders" / "notes.txt").write_text("x")
    (tmp_path / "folders" / "cam1" / "foreign.yml").write_text("a: 1\n")
    for folder in ("folders", "files"):
        rig = read_rig(tmp_path / folder, unit="mm")
        assert rig.names == ("cam1", "cam2")
        assert rig["cam1"].translation.tolist() == [0.1, 0.2, 4.0]
    assert read_rig(tmp_path / "files" / "cam2.yml", unit="mm").names == ("cam2",)
    storage(tmp_path / "folders" / "cam1" / "old.xml", **OWN)
    with pytest.raises(InputError, match="2 calibrations in one camera's folder"):
        read_rig(tmp_path / "folders", unit="mm")


def test_opencv_mistakes_are_named(tmp_path):
    assert "add a top-level entry unit: m" in refusal(storage(tmp_path / "a.yml", **OWN))
    path = tmp_path / "a.yml"
    storage(path, unit="mm", **{key: OWN[key] for key in OWN if not key.startswith("image")})
    assert "camera a: the image size is not in the file" in refusal(path)
    assert read_rig(path, size=(640, 480))["a"].size == (640, 480)
    storage(path, unit="m", **{key: OWN[key] for key in OWN if key != "tvec"})
    assert "camera a: translation is missing" in refusal(path)
    assert "no camera in it" in refusal(storage(tmp_path / "c.yml", unit="m"))
    xml = '<?xml version="1.0"?>\n<opencv_storage><a></opencv_storage>'
    for name, text, message in (
        ("broken.yml", "%YAML:1.0\n---\na: [1, 2\nb: }\n", "OpenCV cannot read it"),
        ("broken.xml", xml, "broken XML"),
        ("broken.json", '{"projections": [', "broken JSON"),
        ("other.json", '{"a": 1}', "no camera in it"),
    ):
        assert message in refusal(write(tmp_path, text, name))


def test_projection_mistakes_are_named(tmp_path):
    good, size = np.column_stack([np.eye(3), [0, 0, 4]]).tolist(), {"size": [4, 4]}
    unsized = write(tmp_path, json.dumps([good]), "p.json")
    assert 'add "unit": "m"' in refusal(unsized, size=(640, 480))
    for projections, more, message in (
        ([good], {}, "camera cam_0: the image size is not in the file"),
        ([good, good[:2]], size, "camera cam_1: projection must have shape (3, 4), got (2, 4)"),
        ([[[1, 2, 3, 4]] * 3], size, "camera cam_0: projection is no camera"),
        ([[[float("nan")] * 4] * 3], size, "camera cam_0: projection holds a NaN"),
        ([good], size | {"names": ["a", "b"]}, "names must be a list of 1"),
        (3, {}, "projections must be a list"),
        ([], {}, "no camera in it"),
    ):
        content = {"unit": "m", "projections": projections} | more
        assert message in refusal(write(tmp_path, json.dumps(content), "p.json"))


@pytest.mark.parametrize("scale", [1.0, -1.0, 1e-4, -300.0])
def test_decomposition_gives_the_matrix_back(scale):
    for camera in some_rig(*[PINHOLE] * 10):
        matrix, rotation, translation = decompose(scale * camera.projection)
        np.testing.assert_allclose(matrix, camera.matrix, atol=1e-9)
        np.testing.assert_allclose(rotation, camera.rotation, atol=1e-12)
        np.testing.assert_allclose(translation, camera.translation, atol=1e-11)


def test_easymocap_as_it_writes(tmp_path):
    def entry(key: str, rows: int, cols: int, data: str) -> str:
        about = f"  rows: {rows}\n  cols: {cols}\n  dt: d\n"
        return f"{key}: !!opencv-matrix\n{about}  data: [{data}]\n"

    head = '%YAML:1.0\n---\nnames:\n  - "01"\n'
    numbers = "600.000, 0.000, 320.000, 0.000, 600.000, 240.000, 0.000, 0.000, 1.000"
    intri = head + entry("K_01", 3, 3, numbers) + entry("dist_01", 1, 5, "0.1, 0.0, 0.0, 0.0, 0.0")
    extri = head + entry("R_01", 3, 1, "0.1, 0.2, 0.3") + entry("T_01", 3, 1, "0.1, 0.2, 4.0")
    write(tmp_path, intri, "intri.yml")
    with pytest.raises(InputError, match=r"extri\.yml is missing"):
        read_rig(tmp_path, unit="m", size=(640, 480))
    write(tmp_path, extri, "extri.yml")
    for path in (tmp_path, tmp_path / "extri.yml"):
        camera = read_rig(path, unit="m", size=(640, 480))["01"]
        assert camera.translation.tolist() == [0.1, 0.2, 4.0]
        np.testing.assert_allclose(camera.rotation, matrix_from_rodrigues([0.1, 0.2, 0.3]))
    assert "camera 01: the image size is not in the file" in refusal(tmp_path, unit="m")
    assert "add an entry unit: m to extri.yml" in refusal(tmp_path, size=(640, 480))
    write(tmp_path, intri.replace("K_01", "K_02"), "intri.yml")
    assert "camera 01: matrix is missing" in refusal(tmp_path, unit="m", size=(640, 480))


def test_qualisys_mistakes_are_named(tmp_path):
    write_rig(some_rig(BENT), tmp_path / "rig.qca.txt")
    text = (tmp_path / "rig.qca.txt").read_text()
    half = text.replace('model="none"', 'model="Miqus Video" video_resolution="240p"')
    letters = text.replace('focalLengthU="', 'focalLengthU="x')
    for other, message in (
        (text.replace("<transform", "<other"), "camera cam_1: <transform> is missing"),
        (letters, "camera cam_1: focalLengthU must be numbers"),
        (half, "camera cam_1: filmed at 240p but calibrated at 480 lines"),
        (text[:300], "broken XML"),
        ("<html></html>", "no camera in it"),
    ):
        assert message in refusal(write(tmp_path, other, "a.txt"))
    said = refusal(tmp_path / "rig.qca.txt", unit="m")
    assert "the file says its unit is mm, --unit says m" in said


def test_json_takes_a_map_of_cameras_too(tmp_path):
    rig = some_rig(BENT)
    write_rig(rig, tmp_path / "rig.json")
    cameras = json.loads((tmp_path / "rig.json").read_text())["cameras"]
    path = write(tmp_path, json.dumps({"cameras": cameras}), "a.json")
    assert 'add "unit": "m"' in refusal(path)
    del cameras[0]["name"]
    path.write_text(json.dumps({"unit": "m", "cameras": {"left": cameras[0]}}))
    assert read_rig(path).names == ("left",)
    path.write_text(json.dumps({"unit": "m", "cameras": [1]}))
    assert "cameras must be a list of objects" in refusal(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[[600.0", "[[1e300", "matrix holds 1e+300, which no camera has"),
        ("[[600.0", "[[1e-3", "a focal length of 0.001 px is no camera's"),
        ("[0.0, 0.0, 0.0, 0.0, 0.0]", "[1e308, 0.0, 0.0, 0.0, 0.0]", "distortions holds 1e+308"),
        ("4000.0", "1e300", "translation holds 1e+300"),
        ("4000.0", "4e11", "the camera is 4e+05 km away"),
        ("4000.0", "9" * 400, "translation must be numbers"),
        ("4000.0", "9" * 5000, "no valid TOML"),
        ("[640, 480]", "[640000, 480]", "an image of 640000 x 480 px is no camera's"),
        ("[640, 480]", "[20000, 20000]", "an image of 20000 x 20000 px is no camera's"),
        ('"left"', '"' + "x" * 5000 + '"', "is no camera's name"),
        ('"left"', '" "', "is no camera's name"),
        (ROTATION, "[" * 3000 + "]" * 3000, "nested more than 50 levels"),
        ("[cam_1]", "[cam_1", "nor is it another calibration that is known here"),
    ],
)
def test_what_no_camera_has_is_refused(tmp_path, old, new, message):
    assert old in CAMERA
    assert message in refusal(write(tmp_path, CAMERA.replace(old, new, 1) + MM))


def test_entries_of_wrong_types_are_no_tracebacks(tmp_path):
    good = storage(tmp_path / "a.yml", **OWN).read_text()
    for entry in ("unit: [m, cm]\n", "unit: {a: 1}\n", "fisheye: [1, 2]\n", "name: [1, 2]\n"):
        refusal(write(tmp_path, good + entry, "b.yml"))
    folder = tmp_path / "easymocap"
    write_rig(some_rig(PINHOLE), folder)
    text = (folder / "extri.yml").read_text()
    for names in ("names: [.Nan]", "names: [{a: 1}]", "names: [1e308]"):
        (folder / "extri.yml").write_text(text.replace("names:\n   - cam_1", names))
        with pytest.raises(InputError, match="easymocap"):
            read_rig(folder)


def test_metadata_of_any_content_is_read(tmp_path):
    for up in ("[1e308, 1e308, 0]", "[" * 300 + "]" * 300, "9" * 5000, '"nan,0,1"', "[0, 0, 0]"):
        path = write(tmp_path, CAMERA + MM + f"up = {up}\n")
        with contextlib.suppress(InputError):
            read_up(path)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.pickle", b"\x80\x04\x95abc", "a pickle, not text: write its cameras as aniposelib's"),
        ("a.mat", b"MATLAB 5.0 MAT-file\0\1IM\xff", "no MATLAB file that can be read: save"),
        ("a.cal", b"4 1\n0 1079 0 1919\n", "of no format that is known: .*Qualisys"),
        ("a.bin", b"ab\xff\xfe", r"byte 2 is no UTF-8\): write its cameras as"),
        ("a.toml", "[cam_1]\n".encode("utf-16"), "text in UTF-16: save it as UTF-8"),
    ],
)
def test_what_is_no_calibration_names_the_formats(tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=words) as refused:
        read_rig(tmp_path / name)
    assert "\n" not in str(refused.value)
