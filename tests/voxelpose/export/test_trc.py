"""TRC as others write it."""

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.joint_files import read_trc
from tests.clips import waving
from voxelpose.evaluation import score_motion
from voxelpose.export.trc import write_trc
from voxelpose.recording.truth import read_truth

POSE2SIM = {
    name: f"{name[0].upper()}{name.split('_')[1].title()}"
    for name in LANDMARK_NAMES[1:]
    if "_" in name and name != "head_top"
}
POSE2SIM |= {"neck": "Neck", "head_top": "Head"}


def write(path, points, names, unit="mm", scale=1000.0, gap="", first=1):
    """Writes (T, K, 3) points in the file's axes: Windows line ends, a blank line after the head,
    tabs at the end, as Vicon does.
    """
    head = [
        "PathFileType\t4\t(X/Y/Z)\tmotion.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits",
        f"100\t100\t{len(points)}\t9\t{unit}",
    ]
    lines = [*head, "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t", "\t\tX1\tY1\tZ1", ""]
    for row, frame in enumerate(points):
        cells = [gap if np.isnan(value) else f"{scale * value:.4f}" for value in frame.ravel()]
        lines.append("\t".join([f"{row + first}", f"{row / 100}", *cells, ""]))
    path.write_bytes("\r\n".join([*lines, ""]).encode())


@pytest.fixture
def take():
    return waving(5)


def test_detectors_names_their_axes_and_no_pelvis(tmp_path, take):
    joints = [LANDMARK_NAMES.index(name) for name in POSE2SIM]
    write(tmp_path / "x.trc", take.landmarks()[:, joints][..., [1, 2, 0]], list(POSE2SIM.values()))
    read = read_trc(tmp_path / "x.trc")
    np.testing.assert_allclose(read[:, 1:], take.landmarks()[:, 1:], atol=1e-6)
    np.testing.assert_allclose(read[:, 0], take.landmarks()[:, [1, 4]].mean(axis=1), atol=1e-6)


@pytest.mark.parametrize(
    ("axes", "from_world"), [("xyz", [0, 1, 2]), ("yzx", [1, 2, 0]), ("zxy", [2, 0, 1])]
)
def test_axes(tmp_path, take, axes, from_world):
    write(tmp_path / "x.trc", take.landmarks()[..., from_world], LANDMARK_NAMES, "m", 1.0)
    read = read_truth(tmp_path / "x.trc", axes=axes)
    np.testing.assert_allclose(read, take.landmarks(), atol=1e-4)


def test_axes_that_run_backward(tmp_path, take):
    x, y, z = np.moveaxis(take.landmarks(), -1, 0)
    write(tmp_path / "x.trc", np.stack([x, z, -y], axis=-1), LANDMARK_NAMES)
    np.testing.assert_allclose(read_trc(tmp_path / "x.trc", "xz-y"), take.landmarks(), atol=1e-6)


def test_markers_by_name_go_before_guesses(tmp_path, take):
    others = {"neck": "C7", "left_hip": "LHJC", "right_hip": "hip_r"}
    names = [others.get(name, name) for name in LANDMARK_NAMES]
    points = np.concatenate([take.landmarks(), 9 + take.landmarks()[:, :1]], axis=1)[..., [1, 2, 0]]
    write(tmp_path / "x.trc", points, [*names, "Neck"])
    read = read_trc(tmp_path / "x.trc", markers={"neck": "C7"})
    np.testing.assert_allclose(read, take.landmarks(), atol=1e-6)


@pytest.mark.parametrize("gap", ["", "NaN"])
def test_joints_that_a_frame_lacks_are_not_scored(tmp_path, take, gap):
    points = take.landmarks()[..., [1, 2, 0]].copy()
    points[2, 14] = np.nan  # the last cells of the row
    write(tmp_path / "x.trc", points, LANDMARK_NAMES, gap=gap)
    truth = read_truth(tmp_path / "x.trc")
    assert np.isnan(truth[2, 14]).all()
    far = take.landmarks()
    far[2, 14] += 1.0
    score = score_motion(truth, far)
    assert score.frames == 5 and score.mpjpe_mm < 0.01


def test_what_export_writes_scores_as_perfect_frame_by_frame(tmp_path, take):
    write_trc(take.select(np.array([1, 3, 4])), tmp_path / "x.trc")
    truth = read_truth(tmp_path / "x.trc")
    assert np.isfinite(truth).all(axis=(1, 2)).tolist() == [False, True, False, True, True]
    assert score_motion(truth, take.landmarks()).mpjpe_mm < 0.01


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"unit": "furlongs"}, "furlongs"),
        ({"names": ["a", "b"]}, "no marker for pelvis, left_hip"),
        ({"first": 0}, "number its frames upward from 1"),
        ({"gap": "?"}, "cannot be read as TRC"),
    ],
)
def test_what_cannot_be_used_is_said(tmp_path, take, change, line):
    points = take.landmarks()
    points[1, 1] = np.nan
    write(tmp_path / "x.trc", points, **({"names": LANDMARK_NAMES} | change))
    with pytest.raises(InputError, match=line):
        read_trc(tmp_path / "x.trc")


@pytest.mark.parametrize("axes", ["xy", "xyw", "xyy", "yxz", "x y z"])
def test_axes_that_make_no_world(tmp_path, take, axes):
    write(tmp_path / "x.trc", take.landmarks(), LANDMARK_NAMES)
    with pytest.raises(InputError, match="--axes"):
        read_trc(tmp_path / "x.trc", axes)


@pytest.mark.parametrize(
    "content", [b"", b"PathFileType\n", b"a\nb\nc\nFrame#\tTime\tx\n\n", b"\xff\xfe\x00"]
)
def test_what_is_no_trc(tmp_path, content):
    (tmp_path / "x.trc").write_bytes(content)
    said = r"x\.trc (cannot be read|is not a text file|is text in UTF-16)"
    with pytest.raises(InputError, match=said):
        read_trc(tmp_path / "x.trc")


def test_real_trc_is_the_truth_made_from_it(shared):
    folder = shared / "data" / "balancing4"
    read = read_truth(folder / "reference.trc")
    np.testing.assert_allclose(read, read_truth(folder / "truth.json"), atol=1e-5)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("\n3\t", "\n30000000\t", "the last with the number 3e\\+07"),
        ("\n3\t", "\nnan\t", "must number its frames upward"),
        ("\n3\t", "\n1e300\t", "the last with the number"),
        ("\n3\t", "\n2\t", "must number its frames upward"),
        ("Frame#\tTime\t", "Frame#\tTime\t" + "x\t" * 5000, "it names 50.. markers"),
    ],
)
def test_frames_that_would_fill_memory_are_refused(tmp_path, old, new, words):
    write_trc(waving(3), tmp_path / "x.trc")
    text = (tmp_path / "x.trc").read_text()
    assert old in text
    (tmp_path / "x.trc").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=words):
        read_trc(tmp_path / "x.trc")
