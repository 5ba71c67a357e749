"""CMU Panoptic: calibration_NAME.json, hdVideos, hdPose3d_stage1_coco19."""

import json

import numpy as np
import pytest

from tests.datasets import miniatures as mini
from voxelpose.recording.truth import read_truth

# The data set's y points down: (x, y, z) there is (x, z, -y) with z up.
Y_DOWN_FROM_Z_UP = np.array([[1, 0, 0], [0, 0, -1.0], [0, 1, 0]])
K = [[70.0, 0.0, 31.0], [0.0, 71.0, 23.0], [0.0, 0.0, 1.0]]
DIST = (-0.2, 0.15, 0.002, -0.003, -0.01)
COCO19 = [
    *("neck", None, "pelvis", "left_shoulder", "left_elbow", "left_wrist", "left_hip"),
    *("left_knee", "left_ankle", "right_shoulder", "right_elbow", "right_wrist", "right_hip"),
    *("right_knee", "right_ankle", None, "left_ear", None, "right_ear"),
]


def native(number: int) -> tuple[np.ndarray, np.ndarray]:
    rotation, translation = mini.looking(number)
    return rotation @ Y_DOWN_FROM_Z_UP.T, 100 * translation


def formula(number: int) -> np.ndarray:
    """projectPoints of the toolbox's panutils: cm, R X + t, OpenCV's distortion."""
    points_cm = 100 * mini.POINTS @ Y_DOWN_FROM_Z_UP.T
    np.testing.assert_allclose(points_cm[8], [0, -175, 0], atol=1e-9)  # the head is up: y < 0
    rotation, translation = native(number)
    x = points_cm @ rotation.T + translation
    a, b = x[:, 0] / x[:, 2], x[:, 1] / x[:, 2]
    r = a**2 + b**2
    radial = 1 + DIST[0] * r + DIST[1] * r * r + DIST[4] * r**3
    u = a * radial + 2 * DIST[2] * a * b + DIST[3] * (r + 2 * a * a)
    v = b * radial + 2 * DIST[3] * a * b + DIST[2] * (r + 2 * b * b)
    return np.column_stack([70 * u + 31, 71 * v + 23])


def body(frame: int, who: int = 0) -> dict:
    joints = []
    for name in COCO19:
        if name is None:
            joints += [0, 0, 0, -1]
        else:
            joints += [*(100 * Y_DOWN_FROM_Z_UP @ mini.moving(frame)[name]), 0.7]
    return {"id": who, "joints19": joints}


@pytest.fixture
def source(tmp_path):
    folder = tmp_path / "171204_pose1"
    cameras = [{"name": "01_01", "type": "vga", "resolution": [640, 480]}]
    for number, name in enumerate(("00_00", "00_12", "00_20")):
        rotation, translation = native(number)
        one = {"name": name, "type": "hd", "panel": 0, "node": int(name[3:]), "K": K}
        one |= {"resolution": list(mini.SIZE), "distCoef": list(DIST)}
        cameras.append(one | {"R": rotation.tolist(), "t": translation[:, None].tolist()})
    mini.write_json(folder / "calibration_171204_pose1.json", {"cameras": cameras})
    for name in ("00_00", "00_12"):
        mini.write_video(folder / "hdVideos" / f"hd_{name}.mp4", fps=29.97)
    for frame in range(mini.FRAMES):
        content = {"version": 0.7, "univTime": 1.0, "fpsType": "hd_29_97", "bodies": [body(frame)]}
        name = f"body3DScene_{frame:08d}.json"
        mini.write_json(folder / "hdPose3d_stage1_coco19" / name, content)
    return folder


def test_pixels_and_truth(source, tmp_path, convert):
    out = tmp_path / "out"
    convert("cmu_panoptic", source, out)
    mini.opened(out, {"cam_00_00": formula(0), "cam_00_12": formula(1)})
    mini.checked_truth(out, mini.truth_of(), but=("head_top",))


def test_one_of_several_people(source, tmp_path, convert, refuse):
    file = source / "hdPose3d_stage1_coco19" / "body3DScene_00000002.json"
    content = json.loads(file.read_text())
    content["bodies"].insert(0, body(0, who=4))
    file.write_text(json.dumps(content))
    output = refuse("cmu_panoptic", source, tmp_path / "out")
    assert "0 (6 frames), 4 (1 frames)" in output and "--person" in output
    assert "nobody with ID 9" in refuse("cmu_panoptic", source, tmp_path / "a", "--person", 9)
    convert("cmu_panoptic", source, tmp_path / "out", "--person", 4)
    truth = read_truth(tmp_path / "out" / "truth.json")
    np.testing.assert_array_equal(np.isfinite(truth).all(axis=(1, 2)).nonzero()[0], [2])


def test_extracted_images_begin_at_their_number(source, tmp_path, convert):
    for name in ("00_00", "00_12"):
        (source / "hdVideos" / f"hd_{name}.mp4").unlink()
        pattern = f"{name}_{{:08d}}.jpg"
        mini.write_images(source / "hdImgs" / name, 4, pattern, first=2)
    convert("cmu_panoptic", source, tmp_path / "out", "--cameras", "00_00,00_12")
    recording = mini.opened(tmp_path / "out", {"cam_00_00": formula(0), "cam_00_12": formula(1)})
    assert recording.fps == pytest.approx(29.97, rel=1e-3)
    mini.checked_truth(tmp_path / "out", mini.truth_of()[2:], but=("head_top",))


def test_mistakes(source, tmp_path, refuse):
    out, file = tmp_path / "out", source / "calibration_171204_pose1.json"
    assert "no HD camera '01_01'" in refuse("cmu_panoptic", source, out, "--cameras", "01_01")
    frame = source / "hdPose3d_stage1_coco19" / "body3DScene_00000003.json"
    frame.write_text(frame.read_text()[:100])
    assert "body3DScene_00000003.json is not whole JSON" in refuse("cmu_panoptic", source, out)
    for path in frame.parent.iterdir():
        path.unlink()
    assert "extract hdPose3d_stage1_coco19.tar" in refuse("cmu_panoptic", source, out)
    text = file.read_text()
    file.write_text(text[: len(text) // 2])
    assert "is not whole JSON" in refuse("cmu_panoptic", source, out)
    file.unlink()
    assert "holds no calibration_*.json" in refuse("cmu_panoptic", source, out)
