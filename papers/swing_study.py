"""The arm-swing experiment from a recording to its files."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from calib.errors import InputError
from papers.arm_swing import (
    DEGRADATIONS,
    FLOOR,
    Reading,
    Row,
    SilhouetteVideo,
    Truth,
    near_side,
    run_methods,
)
from papers.degrade import Degradation
from papers.swing_library import SAMPLES, swing_library
from papers.swing_report import draw_angles, swing_table
from papers.swings import Criterion, arm_angles, split_swings
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.estimator import Settings, load_estimator
from silhouette_core.monocular.tree.pose_library import PoseLibrary, describe_body
from silhouette_core.monocular.tree.store import read_library
from silhouette_core.monocular.tuning import MOTION_MODEL
from silhouette_core.motion.kinematics import landmarks
from silhouette_core.progress import Reporter
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import read_truth
from voxelpose.results import SUMMARY, as_json
from voxelpose.version import __version__

TABLE, PLOT = "table.md", "angles.png"


@dataclass(frozen=True)
class Study:
    """Settings of the experiment.

    Attributes:
        truth: file of the true joints.
        stature_m: of the person; None: from the recording's subject.toml.
        library: a pose library; None: one is built for the experiment.
        degraded: whether degraded silhouettes are included.
        ours: whether the program's own estimator is included.
        samples: of the library that is built.
        reading: of what the paper does not state.
    """

    truth: Path
    stature_m: float | None = None
    library: Path | None = None
    degraded: bool = True
    ours: bool = True
    samples: int = SAMPLES
    reading: Reading = field(default_factory=Reading)


def run_study(recording: Recording, study: Study, folder: Path, reporter: Reporter) -> list[Row]:
    """Runs the experiment and writes table.md, angles.png and summary.json.

    Args:
        recording: of one camera, of a person in profile whose right arm swings.
        study: see Study.
        folder: where the files go.
        reporter: notified of every stage.

    Returns:
        The rows of the table.

    Raises:
        InputError: the recording, the truth or the library does not suit the experiment.
    """
    joints = read_truth(study.truth)
    if len(joints) < recording.first + recording.frame_count:
        raise InputError(
            f"{study.truth} has {len(joints)} frames and {recording.folder} more: give the truth of"
            " this recording"
        )
    joints = joints[recording.first : recording.first + recording.frame_count]
    truth_deg = arm_angles(joints)
    truth = Truth(truth_deg, split_swings(truth_deg))
    stature = study.stature_m or recording.subject.stature_m
    if stature is None:
        raise InputError(
            f"{recording.folder} has no subject.toml that says how tall the person is: add"
            " --stature"
        )
    additions = study.reading.additions
    video = SilhouetteVideo.from_recording(recording, stature, reporter, additions)
    library = _library(
        study,
        stature,
        near_side(joints, video.camera),
        video.pitch_deg,
        recording.subject.sex,
        reporter,
    )
    degradations = DEGRADATIONS if study.degraded else DEGRADATIONS[:1]
    rows = run_methods(video, truth, library, degradations, study.reading, reporter)
    shown = rows[:4]
    if study.ours:
        rows.insert(4, _ours(recording, study, stature, truth, reporter))
        shown = rows[:5]
    (folder / TABLE).write_text(swing_table(rows), encoding="utf-8")
    draw_angles(shown, truth, video.fps, folder / PLOT)
    about = {
        "voxelpose": __version__,
        "recording": recording.folder.resolve().name,
        "frames": len(video),
        "swings": len(truth.swings),
        "right_arm": "near" if near_side(joints, video.camera) else "far",
        "distance_m": video.distance_m,
        "criterion": asdict(Criterion()),
        "filter": asdict(study.reading)
        | {
            "floor": FLOOR if additions else 0.0,
            "m": MOTION_MODEL.magnification,
            "hidden_share": MOTION_MODEL.hidden_share,
        },
        "library": {
            "samples": len(library),
            "nodes": [len(level) for level in library.levels],
            "body": describe_body(library.model),
        },
        "rows": [
            {"method": row.method, "silhouettes": row.degradation, **row.counts, "paper": row.paper}
            | {"error_deg": row.error_deg, "lost": row.lost}
            for row in rows
        ],
        "true_deg": truth_deg,
        "estimated_deg": {f"{row.method}, {row.degradation}": row.angles_deg for row in rows},
    }
    (folder / SUMMARY).write_text(as_json(about), encoding="utf-8")
    return rows


def _library(
    study: Study, stature_m: float, near: bool, pitch_deg: float, sex: str, reporter: Reporter
) -> PoseLibrary:
    if study.library is None:
        return swing_library(
            BodyModel.from_sizes(BodySizes(stature_m, sex=sex)),
            near,
            pitch_deg,
            reporter,
            study.samples,
        )
    library = read_library(study.library)
    if abs(library.model.sizes.stature_m - stature_m) > 0.01:
        raise InputError(
            f"{study.library} was made for another body ({describe_body(library.model)}): build one"
            f" with voxelpose library build --stature {stature_m:g}"
        )
    return library


def _ours(
    recording: Recording, study: Study, stature_m: float, truth: Truth, reporter: Reporter
) -> Row:
    """Row of the program's own estimator, as `voxelpose track` runs it.

    It has balanced weights and DM2, estimates the distance, refines poses and uses later frames.
    """
    options = {"start": "any"} | ({"library": str(study.library)} if study.library else {})
    settings = replace(Settings(stature_m=stature_m, options=options), sex=recording.subject.sex)
    motion = load_estimator("monocular").estimate(recording, settings, reporter).motion
    joints = np.full((recording.frame_count, len(LANDMARK_NAMES), 3), np.nan)
    joints[motion.frames - recording.first] = landmarks(motion.model, *motion.parts())
    return truth.row("voxelpose track", Degradation(), arm_angles(joints))
