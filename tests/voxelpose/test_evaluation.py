"""Measures against hand-made cases and against the reviewers' own script."""

import importlib.util
import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from silhouette_core.body.joints import EXCHANGED_LANDMARKS, LANDMARK_NAMES
from silhouette_core.motion.joint_files import read_joints
from tests.clips import waving
from voxelpose.evaluation import score_motion
from voxelpose.export.tables import write_joints
from voxelpose.recording.truth import read_truth


@pytest.fixture
def truth():
    return waving(12).landmarks()


def test_perfect(truth):
    score = score_motion(truth, truth)
    assert (score.lost, score.flips, score.pck150) == (0, 0, 1)
    assert max(score.mpjpe_mm, score.root_mm, score.pa_mm, score.angle_deg) < 1e-3
    assert score.jitter_mm == score.jitter_truth_mm


def test_shift_counts_in_the_world_only_and_size_and_turn_not_after_alignment(truth):
    score = score_motion(truth, truth + np.array([0.03, 0.04, 0]))
    assert score.mpjpe_mm == pytest.approx(50) and score.root_mm == pytest.approx(0, abs=1e-9)
    score = score_motion(truth, 1.1 * truth @ np.array([[0, 1.0, 0], [-1.0, 0, 0], [0, 0, 1.0]]))
    assert score.pa_mm == pytest.approx(0, abs=1e-6) and score.root_mm > 100


def test_exchanged_sides_are_flips(truth):
    estimate = truth.copy()
    estimate[3:6] = truth[3:6][:, EXCHANGED_LANDMARKS]
    assert score_motion(truth, estimate).flips == pytest.approx(3 / 12)


def test_a_mirrored_figure_is_not_aligned(truth):
    """The error left is that of the best proper rotation, by another solver."""
    rng = np.random.default_rng(1)
    mirrored = truth * [-1.0, 1.0, 1.0] + rng.normal(0, 0.03, truth.shape)
    errors = []
    for a, b in zip(mirrored, truth, strict=True):
        a, b = a - a.mean(axis=0), b - b.mean(axis=0)
        turn, _ = Rotation.align_vectors(b, a)
        turned = turn.apply(a)
        scale = (turned * b).sum() / (a**2).sum()
        errors.append(np.linalg.norm(scale * turned - b, axis=1).mean())
    found = score_motion(truth, mirrored).pa_mm
    assert found == pytest.approx(1000 * np.mean(errors), rel=1e-6)
    assert found > 40


def test_a_figure_whose_sides_hardly_differ_is_not_flipped(truth):
    """Seen from the side: every right joint is a centimetre beside the left one."""
    narrow = truth.copy()
    for name in (name for name in LANDMARK_NAMES if name.startswith("left_")):
        left, right = (LANDMARK_NAMES.index(name.replace("left", s)) for s in ("left", "right"))
        narrow[:, right] = narrow[:, left] + [0.01, 0, 0]
    assert score_motion(narrow, narrow + 0.001).flips == 0


def test_absent_and_far_frames_are_lost(truth):
    estimate = truth.copy()
    estimate[0] = np.nan
    estimate[1, 1:] += 1.0
    assert score_motion(truth, estimate).lost == pytest.approx(2 / 12)
    assert score_motion(truth, np.full_like(truth, np.nan)).lost == 1


def test_files(tmp_path):
    take = waving(6)
    write_joints(take.select(np.array([0, 1, 4])), tmp_path / "joints.csv")
    joints = {name: take.landmarks()[:, k].tolist() for k, name in enumerate(LANDMARK_NAMES)}
    document = {"fps": 25, "unit": "m", "up": "z", "joints": joints}
    (tmp_path / "truth.json").write_text(json.dumps(document))
    read = read_truth(tmp_path / "truth.json")
    score = score_motion(read, read_joints(tmp_path / "joints.csv", len(read)))
    assert score.lost == pytest.approx(0.5) and score.mpjpe_mm < 0.01


@pytest.mark.parametrize(
    "content", ["", "{}", '{"joints": {}}', '{"unit": "mm", "joints": {}}', "[1]"]
)
def test_wrong_truth_is_said_in_one_line(tmp_path, content):
    (tmp_path / "truth.json").write_text(content)
    with pytest.raises(InputError, match=r"truth\.json"):
        read_truth(tmp_path / "truth.json")


def test_same_numbers_as_the_reviewers_script(shared, truth):
    spec = importlib.util.spec_from_file_location("reviewers", shared / "eval" / "score.py")
    assert spec is not None and spec.loader is not None
    reviewers = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(reviewers)
    random = np.random.default_rng(5)
    estimate = truth + random.normal(0, 0.08, truth.shape)
    estimate[2] = np.nan
    estimate[5:8, 3:] += random.normal(0, 0.3, (3, 12, 3))
    ours, theirs = score_motion(truth, estimate), reviewers.score(truth, estimate)
    for name, value in theirs.items():
        if name == "joint_root_mm":
            by_joint = [value[joint] for joint in LANDMARK_NAMES]
            np.testing.assert_allclose(ours.joint_root_mm, by_joint)
        else:
            assert getattr(ours, name) == pytest.approx(value), name


def test_jitter_is_the_third_difference_of_the_positions():
    still = waving(1).landmarks().repeat(8, 0)
    moved = still + 0.001 * (np.arange(8.0) ** 3)[:, None, None] * [1, 0, 0]
    score = score_motion(still, moved)
    assert score.jitter_mm == pytest.approx(6) and score.jitter_truth_mm == pytest.approx(0)
