"""TotalCapture: calibration.cal, TC_S1_acting1_camN.mp4, gt_skel_gbl_pos.txt."""

import numpy as np
import pytest

from tests.datasets import miniatures as mini

Y_UP_FROM_Z_UP = np.array([[1, 0, 0], [0, 0, 1.0], [0, -1, 0]])
BONES = [
    *("Hips", "Spine", "Spine1", "Spine2", "Spine3", "Neck", "Head", "RightShoulder", "RightArm"),
    *("RightForeArm", "RightHand", "LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand"),
    *("RightUpLeg", "RightLeg", "RightFoot", "LeftUpLeg", "LeftLeg", "LeftFoot"),
]
LIMBS = {"Arm": "shoulder", "ForeArm": "elbow", "Hand": "wrist"}
LIMBS |= {"UpLeg": "hip", "Leg": "knee", "Foot": "ankle"}
OURS = {"Hips": "pelvis", "Neck": "neck"} | {
    side + bone: f"{side.lower()}_{joint}"
    for side in ("Left", "Right")
    for bone, joint in LIMBS.items()
}
CLIP = ("--subject", "S1", "--sequence", "acting1")


def native(number: int) -> tuple[np.ndarray, np.ndarray]:
    rotation, translation = mini.looking(number)
    return rotation @ Y_UP_FROM_Z_UP.T, translation


def formula(number: int) -> np.ndarray:
    """project_pose3d_to_2d of the TotalCapture toolbox: metres, R X + T, one radial term."""
    points = mini.POINTS @ Y_UP_FROM_Z_UP.T
    np.testing.assert_allclose(points[8], [0, 1.75, 0])
    rotation, translation = native(number)
    x = points @ rotation.T + translation
    xy = x[:, :2] / x[:, 2:]
    r2 = (xy**2).sum(1, keepdims=True)
    return xy * (1 - 0.15 * r2) * (70.0, 71.0) + (31.0, 23.0)


@pytest.fixture
def source(tmp_path):
    root = tmp_path / "TotalCapture"
    lines = ["2 1"]
    for number in range(2):
        rotation, translation = native(number)
        lines += [f"0 {mini.SIZE[1] - 1} 0 {mini.SIZE[0] - 1}", "70.0 71.0 31.0 23.0", "-0.15"]
        lines += [" ".join(f"{value:.9f}" for value in row) for row in (*rotation, translation)]
        for clip in ("acting1", "acting2"):
            mini.write_video(root / "s1" / clip / f"TC_S1_{clip}_cam{number + 1}.mp4", fps=60)
    (root / "calibration.cal").write_text("\n".join(lines) + "\n")
    rows = ["\t".join(BONES)]
    for frame in range(mini.FRAMES + 2):  # the motion capture is a little longer than the videos
        at = mini.moving(frame)
        head = at["neck"] + 0.5 * (at["head_top"] - at["neck"])
        places = [at[OURS[b]] if b in OURS else head for b in BONES]
        inches = np.array(places) @ Y_UP_FROM_Z_UP.T / 0.0254
        rows.append("\t".join(" ".join(f"{v:.6f}" for v in place) for place in inches) + "\t")
    text = "\n".join(rows) + "\n\n"
    (root / "s1" / "acting1" / "gt_skel_gbl_pos.txt").write_text(text)
    return root


def test_pixels_and_truth(source, tmp_path, convert):
    out = tmp_path / "out"
    convert("totalcapture", source, out, *CLIP)
    recording = mini.opened(out, {"cam1": formula(0), "cam2": formula(1)})
    assert recording.fps == pytest.approx(60)
    mini.checked_truth(out, mini.truth_of(), but=("head_top",))


def test_the_archives_own_folders(source, tmp_path, convert):
    gt = source / "s1" / "acting1" / "gt_skel_gbl_pos.txt"
    place = source / "S1_vicon_pos_ori" / "acting1"
    place.mkdir(parents=True)
    gt.rename(place / gt.name)
    convert("totalcapture", source, tmp_path / "out", *CLIP, "--cameras", "cam2")
    mini.checked_truth(tmp_path / "out", mini.truth_of(), but=("head_top",))


def test_mistakes(source, tmp_path, refuse):
    out = tmp_path / "out"
    words = ("totalcapture", source, out, *CLIP)
    assert "no camera of TC_S2_acting1" in refuse(*words, "--subject", "S2")
    assert "no S1/acting2/gt_skel_gbl_pos.txt" in refuse(*words, "--sequence", "acting2")
    gt = source / "s1" / "acting1" / "gt_skel_gbl_pos.txt"
    lines = gt.read_text().splitlines()
    gt.write_text("\n".join([*lines[:4], lines[4][:100]]))
    assert "frame 3 must be 63 numbers" in refuse("totalcapture", source, out, *CLIP)
    calibration = source / "calibration.cal"
    calibration.write_text("\n".join(calibration.read_text().splitlines()[:-1]))
    assert "2 cameras must be 42 numbers" in refuse("totalcapture", source, out, *CLIP)
    calibration.unlink()
    assert "calibration.cal is missing" in refuse("totalcapture", source, out, *CLIP)
