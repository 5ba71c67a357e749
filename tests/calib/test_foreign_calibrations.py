"""Calibrations of other programs: each is written here by its own rules, and a known point must
fall where those rules put it.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from rigs import refusal
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from calib.camera import Camera
from calib.errors import InputError
from calib.files import read_rig

# Two cameras, world to camera: quaternions x, y, z, w, and centres, m.
TURNS = Rotation.from_euler("xyz", [[100, 10, -40], [95, -5, 60]], degrees=True)
CENTRES = np.array([[-2.0, -3.0, 1.4], [2.5, -2.0, 1.1]])
NAMES = ("left", "right")
SIZE = (640, 480)
FX, FY, CX, CY = 600.0, 610.0, 315.0, 242.0
K1, K2, P1, P2 = -0.2, 0.05, 0.002, -0.003


def points(camera: int) -> np.ndarray:
    """Points (5, 3) in front of a camera, in the world."""
    before = np.array([[0, 0, 3], [0.8, 0, 4], [0, 0.9, 4], [-0.9, -0.5, 3], [0.5, 0.4, 2.0]])
    return TURNS[camera].inv().apply(before) + CENTRES[camera]


def in_camera(camera: int) -> np.ndarray:
    return TURNS[camera].apply(points(camera) - CENTRES[camera])


def bent(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Brown's lens in OpenCV's order of terms."""
    r = x * x + y * y
    radial = 1 + K1 * r + K2 * r * r
    return (
        x * radial + 2 * P1 * x * y + P2 * (r + 2 * x * x),
        y * radial + P1 * (r + 2 * y * y) + 2 * P2 * x * y,
    )


def assert_seen(path: Path, expected, atol=1e-6, **known) -> None:
    """Says whether both cameras of a file see their points where `expected` says."""
    rig = read_rig(path, **known)
    assert rig.names == NAMES
    for number, camera in enumerate(rig):
        assert camera.size == SIZE
        np.testing.assert_allclose(camera.center_m, CENTRES[number], atol=1e-9)
        seen, depth = camera.project(points(number))
        assert (depth > 0).all()
        np.testing.assert_allclose(seen, expected(number), atol=atol)


def corner_pixels(number: int) -> np.ndarray:
    """Pixels of the points where the image begins at its corner, in this project's coordinates."""
    x, y, z = in_camera(number).T
    x, y = bent(x / z, y / z)
    return np.stack([FX * x + CX - 0.5, FY * y + CY - 0.5], axis=1)


def colmap(folder: Path, camera="OPENCV 640 480 600 610 315 242 -0.2 0.05 0.002 -0.003") -> Path:
    folder.mkdir(exist_ok=True)
    lens = "# Camera list\n" + "".join(f"{number} {camera}\n" for number in (1, 2))
    (folder / "cameras.txt").write_text(lens)
    lines = ["# Image list, two lines each"]
    for number, name in enumerate(NAMES):
        x, y, z, w = TURNS[number].as_quat()
        t = " ".join(map(str, -TURNS[number].apply(CENTRES[number])))
        lines += [f"{number + 7} {w} {x} {y} {z} {t} {number + 1} {name}/0001.png", ""]
    (folder / "images.txt").write_text("\n".join(lines) + "\n")
    return folder


def test_colmap_is_world_to_camera_with_the_image_from_its_corner(tmp_path):
    folder = colmap(tmp_path / "model")
    assert_seen(folder, corner_pixels, unit="m")
    assert_seen(folder / "images.txt", corner_pixels, unit="m")
    half = read_rig(folder, unit="cm")["left"].center_m
    np.testing.assert_allclose(half, CENTRES[0] / 100, atol=1e-9)


@pytest.mark.parametrize(
    ("lens", "fisheye", "terms"),
    [
        ("SIMPLE_PINHOLE 640 480 600 315 242", False, [0] * 5),
        ("PINHOLE 640 480 600 600 315 242", False, [0] * 5),
        ("SIMPLE_RADIAL 640 480 600 315 242 .1", False, [0.1, 0, 0, 0, 0]),
        ("RADIAL 640 480 600 315 242 .1 .2", False, [0.1, 0.2, 0, 0, 0]),
        ("FULL_OPENCV 640 480 600 600 315 242 1 2 3 4 5 6 7 8", False, [1, 2, 3, 4, 5, 6, 7, 8]),
        ("OPENCV_FISHEYE 640 480 600 600 315 242 1 2 3 4", True, [1, 2, 3, 4]),
        ("RADIAL_FISHEYE 640 480 600 315 242 1 2", True, [1, 2, 0, 0]),
    ],
)
def test_colmap_lenses(tmp_path, lens, fisheye, terms):
    camera = read_rig(colmap(tmp_path / "model", lens), unit="m")["left"]
    assert camera.fisheye == fisheye
    assert camera.distortion.tolist() == terms
    assert camera.matrix.tolist() == [[600, 0, 314.5], [0, 600, 241.5], [0, 0, 1]]


def test_colmap_mistakes_are_named(tmp_path):
    folder = colmap(tmp_path / "model")
    assert "scale the model" in refusal(folder)
    fov = colmap(tmp_path / "fov", "FOV 640 480 600 600 315 242 0.9")
    assert "camera left: lens model 'FOV' is none of OpenCV's" in refusal(fov, unit="m")
    short = colmap(tmp_path / "short", "OPENCV 640 480 600")
    assert "OPENCV has 8 parameters, not 1" in refusal(short, unit="m")
    (folder / "images.txt").write_text("1 1 0 0\n\n")
    assert "images.txt is cut off" in refusal(folder, unit="m")
    (folder / "images.txt").unlink()
    (folder / "images.bin").write_bytes(b"\0")
    assert "images.txt is missing: COLMAP's text model" in refusal(folder, unit="m")


def transforms(**more) -> dict:
    frames = []
    for number, name in enumerate(NAMES):
        pose = np.eye(4)
        pose[:3, :3] = TURNS[number].inv().as_matrix() @ np.diag([1, -1, -1])  # x right, y up
        pose[:3, 3] = CENTRES[number]
        frames.append({"file_path": f"images/{name}.jpg", "transform_matrix": pose.tolist()})
    lens = {"fl_x": FX, "fl_y": FY, "cx": CX, "cy": CY, "w": 640, "h": 480}
    lens |= {"k1": K1, "k2": K2, "p1": P1, "p2": P2, "camera_model": "OPENCV"}
    return lens | {"frames": frames} | more


def test_nerfstudio_is_camera_to_world_with_y_up_and_z_backward(tmp_path):
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps(transforms()))
    assert_seen(path, corner_pixels, unit="m")
    assert "nerfstudio's have none" in refusal(path)
    content = transforms()
    for key in ("fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "k2", "p1", "p2"):
        for frame in content["frames"]:
            frame[key] = content[key]
        del content[key]
    path.write_text(json.dumps(content))
    assert_seen(path, corner_pixels, unit="m")


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"camera_model": "EQUIRECTANGULAR"}, "camera left: lens model 'EQUIRECTANGULAR' is not"),
        ({"camera_model": ["OPENCV"]}, "is not read"),
        ({"k4": 0.1}, "camera left: k4 is no term of OpenCV's"),
        ({"fl_x": None, "fl_y": None}, "camera left: fx is missing"),
        ({"w": None}, "camera left: size must be numbers|size holds a NaN"),
        ({"frames": 3}, "frames must be a list of objects"),
        ({"frames": [{"file_path": "a.jpg", "transform_matrix": [1, 2]}]}, "must be 4x4 numbers"),
    ],
)
def test_nerfstudio_mistakes_are_named(tmp_path, more, message):
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps(transforms(**more)))
    said = refusal(path, unit="m")
    assert any(part in said for part in message.split("|"))


def metashape(path: Path, lens: str, world: str = "", kind: str = "frame") -> Path:
    cameras = ""
    for number, name in enumerate(NAMES):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = TURNS[number].inv().as_matrix(), CENTRES[number]
        if world:  # turned by 90 degrees about z, moved and shrunk
            turn = Rotation.from_euler("z", 90, degrees=True).as_matrix()
            pose[:3, :3] = turn.T @ pose[:3, :3]
            pose[:3, 3] = turn.T @ (CENTRES[number] - [1, 2, 3]) / 2
        numbers = " ".join(map(str, pose.ravel()))
        cameras += f'<camera id="{number}" sensor_id="0" label="{name}">'
        cameras += f"<transform>{numbers}</transform></camera>"
    path.write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n<document version="2.0.0"><chunk><sensors>'
        f'<sensor id="0" type="{kind}"><calibration type="{kind}" class="initial"><f>1</f>'
        f'</calibration><calibration type="{kind}" class="adjusted">'
        f'<resolution width="640" height="480"/>{lens}</calibration></sensor></sensors>'
        f"<cameras>{cameras}</cameras>{world}</chunk></document>"
    )
    return path


LENS = "<f>610</f><cx>-5</cx><cy>2</cy><b1>-10</b1><b2>1.5</b2>"
LENS += f"<k1>{K1}</k1><k2>{K2}</k2><p1>{P2}</p1><p2>{P1}</p2>"


def metashape_pixels(number: int) -> np.ndarray:
    """By the formulas of Metashape's manual, in which P1 goes with r² + 2x²."""
    x, y, z = in_camera(number).T
    x, y = bent(x / z, y / z)
    u = 320 - 5 + x * 610 + x * -10 + y * 1.5
    v = 240 + 2 + y * 610
    return np.stack([u - 0.5, v - 0.5], axis=1)


def test_metashape_as_its_manual_says(tmp_path):
    path = metashape(tmp_path / "cameras.xml", LENS)
    assert_seen(path, metashape_pixels, unit="m")
    assert "Metashape's are metres only with scale bars" in refusal(path)
    turn = "0 -1 0 1 0 0 0 0 1"
    world = f"<transform><rotation>{turn}</rotation><translation>1 2 3</translation>"
    world += "<scale>2</scale></transform>"
    assert_seen(metashape(path, LENS, world), metashape_pixels, unit="m")
    component = f'<components><component id="0">{world}</component></components>'
    metashape(path, LENS, component)
    path.write_text(path.read_text().replace("sensor_id", 'component_id="0" sensor_id'))
    assert_seen(path, metashape_pixels, unit="m")


def test_metashape_fisheyes_and_mistakes(tmp_path):
    path = tmp_path / "cameras.xml"
    round_lens = "<f>300</f><cx>0</cx><cy>0</cy><k1>0.1</k1><k2>0.02</k2><k4>0.001</k4>"
    camera = read_rig(metashape(path, round_lens, kind="fisheye"), unit="m")["left"]
    assert camera.fisheye and camera.distortion.tolist() == [0.1, 0.02, 0, 0.001]
    for lens, kind in ((LENS, "fisheye"), (round_lens, "frame"), (LENS, "spherical")):
        said = refusal(metashape(path, lens, kind=kind), unit="m")
        assert f"camera left: a '{kind}' lens with" in said
    assert "focal lengths must be positive" in refusal(metashape(path, "<k1>0</k1>"), unit="m")
    text = metashape(path, LENS).read_text()
    path.write_text(text.replace("<resolution", "<other"))
    assert "the image size is not in the file" in refusal(path, unit="m")
    path.write_text(text.replace('sensor_id="0"', 'sensor_id="5"'))
    assert "camera left: its sensor has no calibration" in refusal(path, unit="m")
    path.write_text(text.replace("<transform>", "<other>").replace("</transform>", "</other>"))
    assert "camera left: has a lens and no position" in refusal(path, unit="m")


def vicon(path: Path, more: str = "", radial="Vicon3Parameter 318 244 8e-8 1e-14 0") -> Path:
    cameras = '<Camera DEVICEID="9" TYPE="Vero2.2" SENSOR_SIZE="2048 1088"><KeyFrames><KeyFrame'
    cameras += ' POSITION="0 0 0" ORIENTATION="0 0 0 1"'
    cameras += ' FOCAL_LENGTH="1" PRINCIPAL_POINT="0 0"/></KeyFrames></Camera>'
    for number, name in enumerate(NAMES):
        where = " ".join(map(str, 1000 * CENTRES[number]))
        turned = " ".join(map(str, TURNS[number].as_quat()))
        cameras += (
            f'<Camera DEVICEID="{name}" TYPE="Vue_VIDEO" SENSOR_SIZE="640 480" {more}>'
            f'<KeyFrames><KeyFrame FRAME="0" POSITION="{where}" ORIENTATION="{turned}"'
            ' FOCAL_LENGTH="600" PRINCIPAL_POINT="315 242"'
            f' VICON_RADIAL2="{radial}"/></KeyFrames></Camera>'
        )
    path.write_text(f"<?xml version='1.0'?>\n<Cameras>{cameras}</Cameras>\n")
    return path


def test_vicon_maps_distorted_pixels_to_ideal_ones(tmp_path):
    path = vicon(tmp_path / "trial.xcp")
    rig = read_rig(path)
    assert rig.names == NAMES
    assert rig.notes == (f"{path}: left out cameras for markers: 9 (Vero2.2)",)
    assert read_rig(path, cameras=["9", "left"]).names == ("9", *NAMES)
    pixels = np.array([[10.0, 20.0], [600, 30], [318, 244], [100, 400], [630, 470]])
    off = pixels - [318, 244]
    r = (off**2).sum(axis=1, keepdims=True)
    ideal = [318, 244] + off * (1 + 8e-8 * r + 1e-14 * r**2)
    assert np.abs(ideal - pixels).max() > 1
    rays = np.column_stack([(ideal - [315, 242]) / 600, np.ones(len(pixels))])
    for number, camera in enumerate(rig):
        assert camera.size == SIZE
        places = TURNS[number].inv().apply(4 * rays) + CENTRES[number]
        np.testing.assert_allclose(camera.project(places)[0], pixels, atol=0.02)


def test_vicon_mistakes_are_named(tmp_path):
    path = tmp_path / "trial.xcp"
    assert "pixels are not square" in refusal(vicon(path, 'PIXEL_ASPECT_RATIO="1.1"'))
    assert "lens 'Other' is not read" in refusal(vicon(path, radial="Other 1 2 3 4 5"))
    assert "bends more than OpenCV's terms" in refusal(
        vicon(path, radial="Vicon3Parameter 0 0 -1e-5 1e-10 0")
    )
    text = vicon(path).read_text()
    path.write_text(text.replace("POSITION=", "PLACE="))
    assert "POSITION must have shape (3,)" in refusal(path)
    path.write_text(text.replace('VICON_RADIAL2="Vicon3Parameter 318', 'VICON_RADIAL2="'))
    assert "is not read" in refusal(path)
    assert "the file says its unit is mm, --unit says m" in refusal(vicon(path), unit="m")


def kinect(**more) -> dict:
    lens = [0.5, 0.51, 0.48, 0.64, K1, K2, 0.01, 0.02, 0.03, 0.04, 0, 0, P2, P1]
    colour = {
        "Intrinsics": {"ModelParameters": lens},
        "Purpose": "CALIBRATION_CameraPurposePhotoVideo",
    }
    colour["Intrinsics"]["ModelType"] = "CALIBRATION_LensDistortionModelBrownConrady"
    colour["Intrinsics"] |= more
    return {"CalibrationInformation": {"Cameras": [{"Purpose": "depth"}, colour]}}


def test_a_kinect_has_a_lens_for_the_size_of_its_pictures(tmp_path):
    path = tmp_path / "kinect_1.json"
    path.write_text(json.dumps(kinect()))
    camera = read_rig(path, size=(1280, 720), lenses=True)["kinect_1"]
    # Of 1280 x 960, 120 lines are cut off above and below.
    wanted = [[0.48 * 1280, 0, 639.5], [0, 0.64 * 960, 0.51 * 960 - 120 - 0.5], [0, 0, 1]]
    np.testing.assert_allclose(camera.matrix, wanted)
    assert camera.distortion.tolist() == [K1, K2, P1, P2, 0.01, 0.02, 0.03, 0.04]
    assert read_rig(path, size=(2048, 1536), lenses=True)["kinect_1"].matrix[1, 2] == 782.86
    assert "camera kinect_1: has a lens and no position" in refusal(path, size=(1280, 720))
    assert "the image size is not in the file" in refusal(path, lenses=True)
    assert "4:3 or 16:9, not 1000 x 800" in refusal(path, size=(1000, 800), lenses=True)
    for more, message in (
        ({"ModelType": "Theta"}, "lens 'Theta' is not read"),
        ({"ModelParameters": [1, 2]}, "ModelParameters must have shape (14,)"),
        ({"ModelParameters": [0.5] * 14}, "a lens with codx and cody is none of OpenCV's"),
    ):
        path.write_text(json.dumps(kinect(**more)))
        assert message in refusal(path, size=(1280, 720), lenses=True)
    path.write_text(json.dumps({"CalibrationInformation": {"Cameras": [1]}}))
    assert "holds no colour camera" in refusal(path, lenses=True)


def opencap(number: int) -> dict:
    return {
        "intrinsicMat": [[FX, 0, CX], [0, FY, CY], [0, 0, 1]],
        "distortion": [[K1, K2, P1, P2, 0]],
        "imageSize": [[480], [640]],
        "rotation": TURNS[number].as_matrix().tolist(),
        "translation": [[1000 * t] for t in -TURNS[number].apply(CENTRES[number])],
        "rotation_EulerAngles": [[0], [0], [0]],
    }


def test_opencap_has_height_before_width_and_millimetres(tmp_path):
    path = tmp_path / "left.json"
    path.write_text(json.dumps(dict(zip(NAMES, map(opencap, (0, 1)), strict=True))))
    assert_seen(path, lambda number: corner_pixels(number) + 0.5)
    path.write_text(json.dumps(opencap(0)))
    assert read_rig(path).names == ("left",)
    path.write_text(json.dumps(opencap(0) | {"imageSize": [1, 2, 3]}))
    assert "camera left: imageSize must have shape (2,)" in refusal(path)


def test_a_folder_may_hold_a_file_per_camera_of_opencap_or_of_kinect(tmp_path):
    for number, name in enumerate(NAMES):
        path = tmp_path / "opencap" / name / "cameraIntrinsicsExtrinsics.json"
        path.parent.mkdir(parents=True)
        path.write_text(json.dumps(opencap(number)))
        path.with_name("notes.json").write_text("{}")
    assert_seen(tmp_path / "opencap", lambda number: corner_pixels(number) + 0.5)
    folder = tmp_path / "kinects"
    folder.mkdir()
    plain = {"width": 1280, "height": 720, "intrinsic_matrix": [600, 0, 0, 0, 61, 0, 64, 36, 1]}
    (folder / "back.json").write_text(json.dumps(plain))
    (folder / "front.json").write_text(json.dumps(kinect()))
    rig = read_rig(folder, size=(1280, 720), lenses=True)
    assert rig.names == ("back", "front")
    assert rig["back"].matrix[0].tolist() == [600, 0, 64]
    assert rig["front"].matrix[0, 0] == 0.48 * 1280
    with pytest.raises(InputError, match="camera back: has a lens and no position"):
        read_rig(folder, size=(1280, 720))


def dannce(number: int) -> dict:
    return {
        "K": np.array([[FX, 0, CX + 1], [0, FY, CY + 1], [0, 0, 1]]).T,
        "r": TURNS[number].as_matrix().T,
        "t": 1000 * -TURNS[number].apply(CENTRES[number])[None],
        "RDistort": np.array([[K1, K2]]),
        "TDistort": np.array([[P1, P2]]),
    }


@pytest.mark.parametrize("count", [1, 2])
def test_dannce_has_transposed_matrices_and_pixels_from_1(tmp_path, count):
    path = tmp_path / "label3d_dannce.mat"
    params, names = np.empty((count, 1), object), np.empty((1, count), object)
    params[:, 0], names[0] = [*map(dannce, range(count))], NAMES[:count]
    content = {"params": params, "camnames": names, "sync": {"data_frame": [1]}}
    savemat(path, content, do_compression=count > 1)
    rig = read_rig(path, "mm", SIZE)
    assert rig.names == NAMES[:count]
    for number, camera in enumerate(rig):
        pixels, _ = camera.project(points(number))
        np.testing.assert_allclose(pixels, corner_pixels(number) + 0.5, atol=0.01)
    assert "in which unit are its lengths? DANNCE works in mm: or pass --unit" in refusal(
        path, size=SIZE
    )
    for one in range(count):
        savemat(tmp_path / f"{NAMES[one]}.mat", dannce(one) | {"RDistort": [K1, K2, 0.1]})
    path.unlink()
    assert read_rig(tmp_path, "mm", SIZE)["left"].distortion.tolist() == [K1, K2, P1, P2, 0.1]


def test_matlab_files_that_are_not_dannces_are_named(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, dannce(0) | {"K": dannce(0)["K"].T})
    assert "camera a: K is not transposed" in refusal(path, unit="mm", size=SIZE)
    savemat(path, {"params": [1, 2], "camnames": ["a", "b"]})
    assert "params must be a cell array of structs" in refusal(path, unit="mm", size=SIZE)
    path.write_bytes(path.read_bytes()[:140])
    assert "is no MATLAB file that can be read" in refusal(path, unit="mm", size=SIZE)
    savemat(path, {"other": 1})
    assert "camera a: K is missing" in refusal(path, unit="mm", size=SIZE)
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + bytes([0, 2]) + b"IM" + bytes(200))
    assert "version 7.3: save it with -v7" in refusal(path, unit="mm", size=SIZE)


def qualisys(path: Path, models: dict[str, str], root='type="regular"') -> Path:
    camera = (
        '<camera active="1" serial="{}" model="{}"><fov_video left="0" top="0" right="639"'
        ' bottom="479"/><transform x="0" y="0" z="1000" r11="1" r12="0" r13="0" r21="0" r22="1"'
        ' r23="0" r31="0" r32="0" r33="1"/><intrinsic focalLengthU="38400" focalLengthV="38400"'
        ' centerPointU="20480" centerPointV="15360"/></camera>'
    )
    cameras = "".join(camera.format(*item) for item in models.items())
    path.write_text(f"<calibration {root}><cameras>{cameras}</cameras></calibration>")
    return path


def test_qualisys_cameras_that_film_are_read_and_others_are_listed(tmp_path):
    path = tmp_path / "rig.qca.txt"
    models = {
        "1": "Miqus Hybrid",
        "2": "Miqus Video Plus",
        "3": "Oqus 210c",
        "4": "Miqus Video Color",
        "5": "Miqus M3",
        "6": "Oqus 700+",
        "7": "Miqus Video",
    }
    qualisys(path, models)
    path.write_text(path.read_text().replace('"1" serial="7"', '"0" serial="7"'))
    rig = read_rig(path)
    assert rig.names == ("1", "2", "3", "4")
    assert rig.notes == (
        f"{path}: left out cameras for markers: 5 (Miqus M3), 6 (Oqus 700+)",
        f"{path}: left out cameras that are not calibrated: 7",
    )
    assert read_rig(path, cameras=["1", "5"]).names == ("1", "2", "3", "4", "5")
    assert read_rig(qualisys(path, {"a": "Miqus M3", "b": "Arqus A12"})).names == ("a", "b")
    assert read_rig(path).notes == ()


def theia(path: Path, last: tuple[int, int], spelling: str, centre: float = 0) -> Path:
    """A file as Theia's documentation describes it, with a made-up camera that is not in use."""
    cameras = ['<camera active="0" serial="spare" viewrotation="0"/>']
    for number, name in enumerate(NAMES):
        rotation = TURNS[number].as_matrix()
        moved = -1000 * rotation @ CENTRES[number]
        turned = " ".join(f'r{i + 1}{j + 1}="{rotation[i, j]}"' for i in range(3) for j in range(3))
        cameras.append(
            f'<camera active="1" serial="{name}" viewrotation="90"><transform x="{moved[0]}"'
            f' y="{moved[1]}" z="{moved[2]}" {turned}/><intrinsic focallength="4" sensorMinU="0"'
            f' sensorMaxU="{last[0]}" sensorMinV="0" sensorMaxV="{last[1]}" focalLengthU="{FX}"'
            f' focalLengthV="{FY}" centerPointU="{CX + centre}" centerPointV="{CY}" skew="0"'
            f' radialDistortion1="{K1}" radialDistortion2="{K2}" radialDistortion3="0"'
            f' {spelling}Distortion1="{P1}" {spelling}Distortion2="{P2}"/></camera>'
        )
    path.write_text(f"<calibration><results/><cameras>{''.join(cameras)}</cameras></calibration>")
    return path


@pytest.mark.parametrize("last", [(639, 479), (640, 480)])
@pytest.mark.parametrize("spelling", ["tangental", "tengental", "tengential", "tangential"])
def test_theia_takes_the_world_into_the_camera(tmp_path, last, spelling):
    path = theia(tmp_path / "calibration.txt", last, spelling)
    assert_seen(path, lambda number: corner_pixels(number) + 0.5)
    assert read_rig(path).notes == (f"{path}: left out cameras that are not calibrated: spare",)


def test_what_is_neither_theias_nor_qualisys_is_refused(tmp_path):
    path = qualisys(tmp_path / "theia.txt", {"a": "none"}, root="")
    assert "of neither kind" in refusal(path)
    path = qualisys(path, {"a": "none"})
    path.write_text(path.read_text().replace("fov_video", "fov"))
    assert "of neither kind" in refusal(path)
    path = theia(path, (1280 * 64, 960 * 64), "tangental")
    assert "an image of 81920 x 61440 px is no camera's" in refusal(path)


LENSES = """
[cameras.1]
size = [640, 480]
matrix = [[570.0, 0.0, 318.0], [0.0, 570.0, 241.5], [0.0, 0.0, 1.0]]
distortions = [-0.06, 0.015, 0.0, 0.0, 0.0]
"""
POSE = "rotation = [0.0, 0.0, 0.0]\ntranslation = [0.0, 0.0, 4.0]\n"


def test_a_lens_without_a_position_serves_as_a_lens(tmp_path):
    path = tmp_path / "cali.toml"
    path.write_text(LENSES)
    camera = read_rig(path, lenses=True)["cam_1"]
    assert isinstance(camera, Camera)
    assert camera.distortion.tolist() == [-0.06, 0.015, 0, 0, 0]
    said = refusal(path)
    assert "camera cam_1: has a lens and no position" in said
    assert f"calibrate extrinsics --intrinsics {path}" in said and "--cameras" in said
    assert "none of cam_2 is in it with a position" in refusal(path, cameras=["cam_2"])


def test_a_camera_without_a_position_is_left_out_by_name(tmp_path):
    path = tmp_path / "cali.toml"
    located = LENSES.replace("cameras.1", "cameras.2") + POSE
    path.write_text(LENSES + located)
    assert read_rig(path, unit="m", cameras=["cam_2"]).names == ("cam_2",)
    assert "camera cam_1: has a lens and no position" in refusal(path, unit="m")
    said = refusal(path, unit="m", cameras=["cam_1", "cam_2"])
    assert "camera cam_1: has a lens and no position" in said
    assert read_rig(path, lenses=True).names == ("cam_1", "cam_2")
