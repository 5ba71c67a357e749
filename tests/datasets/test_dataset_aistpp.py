"""AIST++: mapping.txt, settingN.json, keypoints3d, AIST's videos."""

import cv2
import numpy as np
import pytest

from tests.datasets import miniatures as mini

Y_UP_FROM_Z_UP = np.array([[1, 0, 0], [0, 0, 1.0], [0, -1, 0]])
SEQUENCE = "gBR_sBM_cAll_d04_mBR0_ch01"
COCO = [None, None, None, "left_ear", "right_ear"] + [
    f"{side}_{joint}"
    for joint in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
    for side in ("left", "right")
]
MATRIX = [[70.0, 0.0, 31.5], [0.0, 70.0, 23.5], [0.0, 0.0, 1.0]]
DIST = [-0.1, 0.02, 0.0, 0.0, 0.0]
BUT = ("head_top", "neck", "pelvis")


def native(number: int) -> tuple[np.ndarray, np.ndarray]:
    rotation, translation = mini.looking(number)
    return rotation @ Y_UP_FROM_Z_UP.T, 100 * translation


def formula(number: int) -> np.ndarray:
    """aniposelib's projection, which is OpenCV's: cm."""
    rotation, translation = native(number)
    points_cm = 100 * mini.POINTS @ Y_UP_FROM_Z_UP.T
    np.testing.assert_allclose(points_cm[8], [0, 175, 0])
    x = points_cm @ rotation.T + translation
    xy = x[:, :2] / x[:, 2:]
    r2 = (xy**2).sum(1, keepdims=True)
    return 70 * xy * (1 - 0.1 * r2 + 0.02 * r2**2) + (31.5, 23.5)


@pytest.fixture
def source(tmp_path):
    folder = tmp_path / "aist"
    setting = []
    for number in range(3):
        rotation, translation = native(number)
        one = {"name": f"c0{number + 1}", "size": list(mini.SIZE), "matrix": MATRIX}
        one |= {"rotation": cv2.Rodrigues(rotation)[0].ravel().tolist(), "distortions": DIST}
        setting.append(one | {"translation": translation.tolist()})
    mini.write_json(folder / "cameras" / "setting1.json", setting)
    (folder / "cameras" / "mapping.txt").write_text(f"{SEQUENCE} setting1\nother setting2\n")
    for name in ("c01", "c03"):
        mini.write_video(folder / "videos" / f"{SEQUENCE.replace('cAll', name)}.mp4", fps=60)
    points = np.zeros((mini.FRAMES, 17, 3))
    for frame in range(mini.FRAMES):
        for place, name in enumerate(COCO):
            if name is not None:
                points[frame, place] = 100 * Y_UP_FROM_Z_UP @ mini.moving(frame)[name]
    (folder / "keypoints3d").mkdir()
    file = folder / "keypoints3d" / f"{SEQUENCE}.npz"
    np.savez(file, keypoints3d=points + 5, keypoints3d_optim=points)
    return folder


def test_pixels_and_truth(source, tmp_path, convert):
    out = tmp_path / "out"
    convert("aistpp", source, out, "--sequence", SEQUENCE)
    mini.opened(out, {"cam_c01": formula(0), "cam_c03": formula(2)})
    mini.checked_truth(out, mini.truth_of(), but=BUT)


def test_json_and_videos_elsewhere(source, tmp_path, convert):
    file = source / "keypoints3d" / f"{SEQUENCE}.npz"
    with np.load(file) as content:
        points = {"keypoints3d": content["keypoints3d_optim"].tolist()}
        mini.write_json(file.with_suffix(".json"), points)
    file.unlink()
    (source / "videos").rename(tmp_path / "films")
    words = ("--sequence", SEQUENCE, "--videos", tmp_path / "films", "--keypoints", "keypoints3d")
    convert("aistpp", source, tmp_path / "out", *words)
    mini.checked_truth(tmp_path / "out", mini.truth_of(), but=BUT)


def test_a_pickle_is_not_opened(source, tmp_path, refuse, convert):
    file = source / "keypoints3d" / f"{SEQUENCE}.npz"
    file.unlink()
    # Opened as a pickle, this would make a file.
    evil = tmp_path / "evil"
    code = b"cbuiltins\nexec\n(S'open(%r, \"w\")'\ntR." % str(evil).encode()
    file.with_suffix(".pkl").write_bytes(code)
    assert "is a pickle" in refuse("aistpp", source, tmp_path / "out", "--sequence", SEQUENCE)
    assert not evil.exists()
    convert("aistpp", source, tmp_path / "out", "--sequence", SEQUENCE, "--no-truth")


def test_npz_of_objects_is_refused(source, tmp_path, refuse):
    file = source / "keypoints3d" / f"{SEQUENCE}.npz"
    np.savez(file, keypoints3d_optim=np.array([{"a": 1}], dtype=object))
    refused = refuse("aistpp", source, tmp_path / "out", "--sequence", SEQUENCE)
    assert "keypoints3d_optim cannot be read" in refused


def test_mistakes(source, tmp_path, refuse):
    out = tmp_path / "out"
    assert "there is no sequence 'x'" in refuse("aistpp", source, out, "--sequence", "x")
    assert "setting2.json is missing" in refuse("aistpp", source, out, "--sequence", "other")
    setting = source / "cameras" / "setting1.json"
    setting.write_text(setting.read_text()[:-40])
    assert "is not whole JSON" in refuse("aistpp", source, out, "--sequence", SEQUENCE)
    for video in (source / "videos").iterdir():
        video.unlink()
    setting.write_text(setting.read_text() + "]")
    (source / "cameras" / "mapping.txt").write_text("one\n")
    assert "mapping.txt must have" in refuse("aistpp", source, out, "--sequence", SEQUENCE)
