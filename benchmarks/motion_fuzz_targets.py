"""A short motion in files of every format, and the result of a fit: for
`benchmarks.fuzz_targets`.
"""

import contextlib
import io
import json
import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from benchmarks.calibration_fuzz_targets import small_rig
from benchmarks.scene import silhouettes
from calib.files import write_rig
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.estimator import Estimate, Settings
from silhouette_core.motion.conditioning import Conditioning, conditioned
from silhouette_core.motion.keyposes.notation import movements
from silhouette_core.motion.keyposes.perform import perform
from silhouette_core.motion.motion import Motion

_FRAMES = 12


@cache
def small_motion() -> Motion:
    model = BodyModel.from_sizes(BodySizes(1.75))
    motion = perform(movements()["wave"], model).select(slice(0, 2 * _FRAMES, 2))
    frames = np.arange(_FRAMES)
    quality = {
        "part_overlap": np.full((_FRAMES, len(model.names)), 0.9),
        "part_unsupported": np.zeros((_FRAMES, len(model.names)), bool),
        "outline_agreement": np.full(_FRAMES, 0.85),
        "camera_agreement": np.full((_FRAMES, 2), 0.85),
        "joint_error_mm": np.full((_FRAMES, len(LANDMARK_NAMES)), 30.0),
        "landmark_confidence": np.full((_FRAMES, len(LANDMARK_NAMES)), 0.8),
        "right_probability": np.full(_FRAMES, 0.9),
        "unexplained": np.full(_FRAMES, 0.1),
    }
    return replace(motion, fps=25.0, frames=frames, time_s=frames / 25, quality=quality)


def make_bvh(path: Path) -> None:
    from voxelpose.export.bvh import write_bvh

    write_bvh(small_motion(), path)


def make_expmap(path: Path) -> None:
    motion, model = small_motion(), small_motion().model
    parents = model.tree.parents.tolist()
    joints = model.joints_m * 100
    offsets = [joints[k] - (joints[p] if p >= 0 else 0) for k, p in enumerate(parents)]
    skeleton = {
        "parent": parents,
        "offset": np.array(offsets).round(3).tolist(),
        "fps": 25.0,
        "names": list(model.names),
        "root_scale": 1.0,
    }
    path.with_name("skeleton.json").write_text(json.dumps(skeleton))
    turns = np.random.default_rng(0).normal(0, 0.1, (len(motion), 3 * len(parents)))
    rows = np.column_stack([motion.root_m * 100, turns])
    np.savetxt(path, rows, "%.5f", ",")


def use_clip(path: Path) -> None:
    from silhouette_core.motion.mocap.load import load_motions

    for motion in load_motions([path], small_motion().model):
        motion.landmarks()


def make_estimate(truth: Path) -> None:
    from voxelpose.export.tables import write_joints
    from voxelpose.export.trc import write_trc
    from voxelpose.recording.truth import write_truth

    motion = small_motion()
    write_joints(motion, truth.with_name("joints.csv"))
    write_truth(truth.with_suffix(".json"), motion.landmarks(), 25.0, 1.75)
    write_trc(motion, truth.with_suffix(".trc"))
    write_joints(motion, truth.with_suffix(".csv"))


def use_estimate(truth: Path) -> None:
    from voxelpose.evaluation import evaluate, markdown_table

    markdown_table({"a": evaluate(truth.with_name("joints.csv"), truth)})


def make_hypotheses(path: Path) -> None:
    from voxelpose.export.tables import write_hypotheses

    joints = small_motion().landmarks()
    poses = [(k, np.array([0.7, 0.3]), joints[[k, 0]]) for k in range(_FRAMES)]
    write_hypotheses(poses, path)


def use_hypotheses(path: Path) -> None:
    from voxelpose.export.tables import read_hypotheses

    read_hypotheses(path)


def make_names(path: Path) -> None:
    from silhouette_core.motion.mocap.names import NEEDED

    lines = [f'{role} = ["{role}", "Other"]' for role in NEEDED]
    path.write_text("\n".join([*lines, 'toes = "{left}_toes"']) + "\n")


def use_names(path: Path) -> None:
    from silhouette_core.motion.mocap.names import find_roles

    find_roles("clip.bvh", small_motion().model.names, path)


@cache
def recorded() -> tuple:
    """Estimate and settings of a result."""
    stages = {"silhouettes": np.full(_FRAMES, 0.01), "search": np.array([0.5])}
    facts = {"voxel_size_m": 0.03, "half_turn_ratio": 2.5, "seams_mm": [12.0, None], "note": "a"}
    settings = Settings(stature_m=1.75, options={"voxel_size_m": 0.03, "tolerance": 0})
    seen = small_motion().select(np.r_[0:5, 6:_FRAMES])
    return Estimate(conditioned(seen, Conditioning(gap_limit=2)), stages, facts), settings


def make_result(out: Path) -> None:
    from voxelpose.fitting import Output, write_estimate
    from voxelpose.recording.folder import Recording

    place = out.with_name("recording")
    for camera, mask in zip(small_rig(), silhouettes(small_rig()), strict=True):
        (place / camera.name).mkdir(parents=True)
        for number in range(_FRAMES):
            picture = np.where(mask[..., None], np.uint8(200), np.uint8([60, 70, 50]))
            coded = cv2.imencode(".png", picture)[1].tobytes()
            (place / camera.name / f"{number:03}.png").write_bytes(coded)
    write_rig(small_rig(), place / "calibration.toml")
    recording = Recording.open(place, fps=25.0)
    estimate, settings = recorded()
    write_estimate(recording, Output(out, pictures=False), estimate, settings)


def make_given(path: Path) -> None:
    """A motion that holds its body: no person's."""
    from examples.bodies.example_motions import example_motion
    from silhouette_core.motion.motion_file import write_motion

    write_motion(example_motion("desk_lamp", 3), path)


def use_motion(path: Path) -> None:
    from silhouette_core.motion.motion_file import read_motion
    from voxelpose.export.formats import export_motion

    motion = read_motion(path)
    motion.landmark_confidence()
    if len(motion):
        formats = ("bvh", "trc", "csv")
        export_motion(motion, path.with_name("exported"), formats, overwrite=True)


def make_corrected(out: Path) -> None:
    from voxelpose.corrections import ExchangeSides, FitAgain, Trim, write_corrections

    make_result(out)
    again = FitAgain((2, 4), "fitted_again_1.safetensors", "cam_1")
    shutil.copy(out / "motion.safetensors", out / again.poses)
    write_corrections(out, (Trim((1, 9)), ExchangeSides((3, 5), limbs="arms"), again))


def use_corrected(out: Path) -> None:
    from voxelpose.results import Result

    result = Result.open(out)
    len(result.motion), result.summary, result.settings


def export(path: Path) -> None:
    from voxelpose.export.formats import export_motion

    export_motion(small_motion(), path.parent, ("npz",), overwrite=True)


def use_result(out: Path) -> None:
    from voxelpose.batch.batch_tables import _lines  # the table of a batch
    from voxelpose.batch.jobs import Job
    from voxelpose.batch.run import Outcome
    from voxelpose.cli.summary import print_result
    from voxelpose.reliability import findings_of
    from voxelpose.report.page import _settings_table, _stages
    from voxelpose.report.verdict import headline
    from voxelpose.results import Result

    result = Result.open(out)
    with contextlib.redirect_stdout(io.StringIO()):
        print_result(result)
    headline(result, findings_of(result.summary, result.motion)), _stages(result.summary["seconds"])
    _settings_table(result.settings)
    outcome = Outcome(Job("a", "b", "fit", {}), "done", "", 1.0, result.summary, {})
    _lines(outcome)


def use_scenes(out: Path) -> None:
    from voxelpose.view.viewer.result_scenes import ResultScenes

    use_result(out)
    scenes = ResultScenes(out)
    try:
        if len(scenes.frames):
            scenes.bodies(int(scenes.frames[0]))
    finally:
        scenes.close()
