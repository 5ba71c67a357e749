"""The multi-view estimator from videos to motion, on the demo's recording: a body that is not the
fitting model.
"""

import json
import time
from pathlib import Path

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.estimator import Settings
from silhouette_core.motion.kinematics import forward, landmarks
from silhouette_core.progress import SilentReporter
from tests.sources import GreySource, ring
from voxelpose.demo.room import make_recording
from voxelpose.evaluation import score_motion
from voxelpose.fitting import Output, fit
from voxelpose.multiview.multiview_estimator import MultiViewEstimator
from voxelpose.recording.folder import Recording

FRAMES = 3


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """Folder of three frames by four cameras: written videos with noise and shadow."""
    return make_recording(tmp_path_factory.mktemp("recording") / "walk", frames=FRAMES)


def watched(recording, out, estimator="multiview"):
    """Fits; returns the result, the stages as the architecture lists them, and how often all frames
    were read.
    """
    stages, read, iterated = [], [], Recording.__iter__

    class Recorder(SilentReporter):
        def stage(self, name, total=None):
            stages.append(name)

    def counted(recording):
        read.append(1)
        return iterated(recording)

    output, settings = Output(out, pictures=False), Settings(threads=2, network="off")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Recording, "__iter__", counted)
        result = fit(recording, output, settings, estimator, Recorder())
    return result, " → ".join(stages), len(read)


@pytest.fixture(scope="module")
def fitted(walk, tmp_path_factory):
    """Their result, stages and reads, and the seconds that the fit took."""
    started = time.perf_counter()
    found = watched(Recording.open(walk), tmp_path_factory.mktemp("fit") / "out")
    return *found, time.perf_counter() - started


@pytest.mark.slow
def test_a_short_recording_from_end_to_end(walk, fitted):
    """All frames posed, nobody mirrored, joints to 40 mm about the pelvis."""
    truth = json.loads((walk / "truth.json").read_text())["joints"]
    result, *_, seconds = fitted
    motion = result.motion
    assert motion.frames.tolist() == list(range(FRAMES))
    placed = landmarks(
        motion.model,
        *forward(motion.model, motion.root_m, motion.root_quaternion, motion.angles_rad),
    )
    score = score_motion(np.stack([truth[name] for name in LANDMARK_NAMES], axis=1), placed)
    assert score.lost == 0 and score.flips == 0
    # The mannequin has longer legs than people (hip joints at 0.537 of its stature).
    assert score.root_mm < 48 and score.mpjpe_mm < 45
    check_report(json.loads((result.folder / "summary.json").read_text()), motion)
    assert seconds < 180  # half a minute on two busy cores


@pytest.mark.slow
@pytest.mark.parametrize(("command", "cameras"), [("fit", None), ("track", ["cam_1"])])
def test_the_stages_are_those_of_the_architecture(walk, fitted, tmp_path, command, cameras):
    """In the order of docs/architecture.md, and all frames are read as often as it says."""
    architecture = (Path(__file__).parents[2] / "docs" / "architecture.md").read_text()
    row = next(line for line in architecture.splitlines() if line.startswith(f"| `{command}` | ba"))
    _, _, named, reads, _ = (cell.strip() for cell in row.split("|"))
    if cameras:
        fitted = watched(Recording.open(walk, cameras=cameras), tmp_path / "out", "monocular")
    assert fitted[1] == named
    assert fitted[2] == int(reads)


@pytest.mark.accuracy
def test_in_a_real_room_the_man_is_followed_and_not_the_board_on_the_floor(standing4, tmp_path):
    """The board's hull is the larger one, and z of this world points into the floor."""
    output = Output(tmp_path / "out", pictures=False)
    motion = fit(Recording.open(standing4, frames=(0, 4)), output, Settings(threads=2)).motion
    joints = dict(zip(LANDMARK_NAMES, motion.landmarks().transpose(1, 0, 2), strict=True))
    assert np.abs(joints["head_top"][:, 2] + 1.75).max() < 0.1
    assert np.abs(joints["pelvis"] - [0.3, -0.85, -0.85]).max() < 0.1
    for side in ("left", "right"):
        assert (np.abs(joints[f"{side}_ankle"][:, 2] + 0.1) < 0.08).all()
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["verdict"]["level"] == "reliable"


def check_report(summary, motion):
    assert summary["estimator"] == "multiview" and summary["frames"]["lost"] == []
    stages = {"silhouettes", "pose", "refinement", "quality", "proportions"}
    assert stages <= set(summary["seconds"]["stages"])
    assert summary["facts"]["stature_given"] is True
    assert abs(summary["facts"]["stature_m"] - summary["body"]["stature_m"]) < 0.05
    assert motion.quality["part_overlap"].shape == (FRAMES, 27)
    agreement = motion.quality["outline_agreement"]
    assert agreement.min() > 0.6 and agreement.max() <= 1
    assert (motion.quality["unexplained"] < 0.7).all()
    trunk = "pelvis", "thorax", "head", "left_thigh", "right_thigh"
    core = [motion.model.names.index(name) for name in trunk]
    assert not motion.quality["part_unsupported"][:, core].any()


@pytest.mark.parametrize(
    ("cameras", "options", "message"),
    [
        (2, {"voxels": 3}, "no option 'voxels'.*voxel_size_m"),
        (2, {"voxel_size_m": 2.5}, "voxel_size_m = '2.5' must be a number from 0.005 to 0.1"),
        (2, {"voxel_size_m": 0.0}, "must be a number from 0.005"),
        (2, {"body": "nobody"}, "there is no body nobody"),
        (1, {}, r"1 camera is too few.*voxelpose track .* --camera"),
        (3, {}, "foreground"),
    ],
)
def test_what_makes_no_sense_is_refused(cameras, options, message):
    source, settings = GreySource(ring(cameras), 3), Settings(options=options)
    with pytest.raises(InputError, match=message):
        MultiViewEstimator().estimate(source, settings, SilentReporter())
