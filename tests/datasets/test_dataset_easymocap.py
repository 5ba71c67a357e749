"""EasyMocap and ZJU-MoCap: intri.yml, extri.yml, images or videos, masks, keypoints3d."""

import cv2
import numpy as np
import pytest

from tests.datasets import miniatures as mini

K = np.array([[70.0, 0, 31.5], [0, 70.0, 23.5], [0, 0, 1]])
DIST = np.array([[-0.1, 0.02, 0.001, -0.002, 0.0]])
BODY25 = "nose neck rs re rw ls le lw pelvis rh rk ra lh lk la reye leye right_ear left_ear".split()
SIDES = {"r": "right", "l": "left"}
PARTS = {"s": "shoulder", "e": "elbow", "w": "wrist", "h": "hip", "k": "knee", "a": "ankle"}


def formula(number: int) -> np.ndarray:
    """cv2.projectPoints, as EasyMocap does it."""
    rotation, translation = mini.looking(number)
    vector = cv2.Rodrigues(rotation)[0]
    return cv2.projectPoints(mini.POINTS, vector, translation, K, DIST)[0][:, 0]


def write_cameras(folder, names) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for file in ("intri.yml", "extri.yml"):
        storage = cv2.FileStorage(str(folder / file), cv2.FILE_STORAGE_WRITE)
        storage.startWriteStruct("names", cv2.FileNode_SEQ)
        for name in names:
            storage.write("", name)
        storage.endWriteStruct()
        for number, name in enumerate(names):
            rotation, translation = mini.looking(number)
            if file == "intri.yml":
                storage.write(f"K_{name}", K)
                storage.write(f"dist_{name}", DIST)
            else:
                storage.write(f"R_{name}", cv2.Rodrigues(rotation)[0])
                storage.write(f"Rot_{name}", rotation)
                storage.write(f"T_{name}", translation[:, None])
        storage.release()


@pytest.fixture
def zju(tmp_path):
    """ZJU-MoCap's layout."""
    folder = tmp_path / "CoreView_377"
    write_cameras(folder, ["1", "2"])
    for number in (1, 2):
        mini.write_images(folder / f"Camera_B{number}", name="{:06d}.jpg")
        mini.write_masks(folder / "mask_cihp" / f"Camera_B{number}", value=3)
    (folder / "annots.npy").write_bytes(b"a pickle")
    return folder


def test_zju_silhouettes(zju, tmp_path, convert):
    out = tmp_path / "out"
    convert("easymocap", zju, out, "--fps", 50, "--silhouettes")
    recording = mini.opened(out, {"cam_1": formula(0), "cam_2": formula(1)})
    assert recording.silhouettes_given and recording.fps == pytest.approx(50)
    masks = [pictures["cam_1"] for _, _, pictures in recording]
    assert len(masks) == mini.FRAMES and set(np.unique(masks[0])) == {0, 255}
    assert masks[2][10:20, 7:17].all() and masks[2].sum() == 100 * 3 * 255


def test_zju_pictures_and_masks(zju, tmp_path, convert):
    convert("easymocap", zju, tmp_path / "out", "--fps", 50, "--cameras", "2", "--frames", "1:4")
    recording = mini.opened(tmp_path / "out", {"cam_2": formula(1)})
    assert not recording.silhouettes_given and recording.frame_count == 3
    pictures = [pictures["cam_2"].mean() for _, _, pictures in recording]
    np.testing.assert_allclose(pictures, [50, 60, 70], atol=2)
    assert len(list((tmp_path / "out" / "masks" / "cam_2").iterdir())) == 3


def test_easymocap_videos_and_keypoints(tmp_path, convert):
    folder = tmp_path / "session"
    write_cameras(folder, ["01", "02"])
    for name in ("01", "02"):
        mini.write_video(folder / "videos" / f"{name}.mp4", fps=30)
    names = [f"{SIDES[n[0]]}_{PARTS[n[1]]}" if len(n) == 2 else n for n in BODY25]
    for frame in range(mini.FRAMES):
        places = mini.moving(frame)
        points = [[*places[n], 0.8] if n in places else [0, 0, 0, 0] for n in names]
        people = [{"id": 1, "keypoints3d": [[9, 9, 9, 1]] * 25}]
        people.append({"id": 0, "keypoints3d": points + [[0, 0, 0, 0]] * 6})
        mini.write_json(folder / "output" / "keypoints3d" / f"{frame:06d}.json", people)
    keypoints = folder / "output" / "keypoints3d"
    convert("easymocap", folder, tmp_path / "out", "--keypoints", keypoints)
    recording = mini.opened(tmp_path / "out", {"cam_01": formula(0), "cam_02": formula(1)})
    assert recording.fps == pytest.approx(30) and recording.rig["cam_01"].size == mini.SIZE
    mini.checked_truth(tmp_path / "out", mini.truth_of(), but=("head_top",))


def test_mistakes(zju, tmp_path, refuse):
    out = tmp_path / "out"
    assert "give --fps" in refuse("easymocap", zju, out)
    words = ("easymocap", zju, out, "--fps", 50)
    assert "there is no camera '7'" in refuse(*words, "--cameras", "1,7")
    assert "correct --masks" in refuse(*words, "--masks", "mattes")
    text = (zju / "extri.yml").read_text()
    (zju / "extri.yml").write_text(text[: text.index("T_2")])
    assert "camera 2: translation is missing" in refuse("easymocap", zju, out, "--fps", 50)
    (zju / "extri.yml").unlink()
    assert "extri.yml is missing" in refuse("easymocap", zju, out, "--fps", 50)
    (zju / "intri.yml").unlink()
    assert "annots.npy, a pickle" in refuse("easymocap", zju, out, "--fps", 50)
