"""Pose2Sim: videos, calibration/Calib_*.toml, TRC."""

import cv2
import numpy as np
import pytest

from tests.datasets import miniatures as mini

K = np.array([[70.0, 0, 31.5], [0, 70.0, 23.5], [0, 0, 1]])
MARKERS = ("MidHip", "LHip", "LKnee", "LAnkle", "RHip", "RKnee", "RAnkle", "Neck", "Head")
MARKERS += ("LShoulder", "LElbow", "LWrist", "RShoulder", "RElbow", "RWrist")


def table(name: str, number: int) -> str:
    (width, height), (rotation, translation) = mini.SIZE, mini.looking(number)
    vector = cv2.Rodrigues(rotation)[0].ravel().tolist()
    return (
        f'[{name}]\nname = "{name}"\nsize = [ {width}.0, {height}.0]\nmatrix = {K.tolist()}\n'
        f"distortions = [ 0.0, 0.0, 0.0, 0.0]\nrotation = {vector}\n"
        f"translation = {translation.tolist()}\nfisheye = false\n\n"
    )


@pytest.fixture
def source(tmp_path):
    folder = tmp_path / "Demo"
    (folder / "calibration").mkdir(parents=True)
    text = "".join(table(f"int_cam0{number + 1}_img", number) for number in range(2))
    text += "[metadata]\nadjusted = false\nerror = 0.0\n"
    (folder / "calibration" / "Calib_scene.toml").write_text(text)
    for number in range(2):
        mini.write_video(folder / "videos" / f"cam0{number + 1}.mp4", fps=60)
    return folder


def pixels() -> dict[str, np.ndarray]:
    return {f"cam0{n + 1}": mini.pinhole(mini.POINTS, *mini.looking(n), K) for n in range(2)}


def test_pixels_and_reference(source, tmp_path, convert):
    trc = source / "pose-3d" / "Demo_filt.trc"
    trc.parent.mkdir()
    head = "PathFileType\t4\t(X/Y/Z)\tDemo.trc\n"
    head += "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n"
    head += f"60\t60\t{mini.FRAMES}\t15\tm\nFrame#\tTime\t" + "\t\t\t".join(MARKERS) + "\n\t\tX1\n"
    rows = []
    for frame in range(mini.FRAMES):
        # Its x y z are our y z x.
        values = [mini.moving(frame)[name][[1, 2, 0]] for name in mini.FIGURE]
        rows.append("\t".join(map(repr, [frame + 1, frame / 60, *np.ravel(values).tolist()])))
    trc.write_text(head + "\n".join(rows) + "\n")
    convert("pose2sim", source, tmp_path / "out", "--trc", trc)
    recording = mini.opened(tmp_path / "out", pixels())
    assert recording.fps == pytest.approx(60)
    mini.checked_truth(tmp_path / "out", mini.truth_of())


def test_calibration_of_the_session_and_order(source, tmp_path, convert):
    trial = source / "Trial_1"
    (trial / "videos").mkdir(parents=True)
    for old, new in (("cam01.mp4", "left.mp4"), ("cam02.mp4", "right.mp4")):
        (source / "videos" / old).rename(trial / "videos" / new)
    convert("pose2sim", trial, tmp_path / "out")
    named = dict(zip(("cam_left", "cam_right"), pixels().values(), strict=True))
    assert set(mini.opened(tmp_path / "out", named).rig.names) == {"cam_left", "cam_right"}


def test_mistakes(source, tmp_path, refuse):
    out = tmp_path / "out"
    calibration = source / "calibration" / "Calib_scene.toml"
    (calibration.parent / "Calib_other.toml").write_text(calibration.read_text())
    assert "choose with --calibration" in refuse("pose2sim", source, out)
    (calibration.parent / "Calib_other.toml").unlink()
    mini.write_video(source / "videos" / "door.mp4")
    assert "name videos like cameras" in refuse("pose2sim", source, out)
    (source / "videos" / "door.mp4").unlink()
    video = source / "videos" / "cam01.mp4"
    whole = video.read_bytes()
    video.write_bytes(whole[: len(whole) // 2])
    output = refuse("pose2sim", source, out)
    assert "cam01.mp4 cannot be read as a video" in output and "repeat the download" in output
    video.write_bytes(whole)
    calibration.write_text(calibration.read_text()[:200])
    assert "Calib_scene.toml" in refuse("pose2sim", source, out)
    calibration.unlink()
    assert "holds no Calib*.toml" in refuse("pose2sim", source, out)
