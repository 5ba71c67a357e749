"""Fig. 5 of paper A: a turn on the spot, a golf swing toward the camera, pointing with one hand."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from calib.errors import InputError
from silhouette_core.estimator import Settings
from silhouette_core.motion.joint_files import read_joints
from silhouette_core.progress import Reporter
from voxelpose.demo.room import make_recording
from voxelpose.evaluation import Score, markdown_table, score_motion
from voxelpose.fitting import Output, fit
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import read_truth
from voxelpose.results import SUMMARY, as_json
from voxelpose.version import __version__

TABLE = "table.md"
PERFORMED = ("golf", "pointing")
METHODS = {"track": "monocular", "track --method paper": "tree"}
"""Estimator of each method."""


@dataclass(frozen=True)
class Sequence:
    """A recording to be tracked.

    Attributes:
        folder: the recording, with its truth.json.
        stature_m: of the person; None: from subject.toml.
        camera: its name, where there are several.
    """

    folder: Path
    stature_m: float | None = None
    camera: str | None = None


def performed(folder: Path, frames: int | None = None) -> dict[str, Sequence]:
    """Renders the golf swing and the pointing with the demo's mannequin."""
    return {
        name: Sequence(make_recording(folder / name, frames, performance=name))
        for name in PERFORMED
    }


def run_figure(
    sequences: Mapping[str, Sequence], library: Path | None, folder: Path, reporter: Reporter
) -> dict[str, Score]:
    """Tracks the sequences as `voxelpose track` does, by either method, and scores them.

    Args:
        sequences: by name.
        library: a pose library; None: each method's own.
        folder: receives table.md, summary.json and a result folder per sequence and method, whose
            contact_sheet.png is the figure.
        reporter: notified of every stage.

    Returns:
        A score per sequence and method.

    Raises:
        InputError: a recording cannot be tracked, or has no truth.
    """
    options = {} if library is None else {"library": str(library)}
    scores: dict[str, Score] = {}
    for name, sequence in sequences.items():
        truth = read_truth(sequence.folder / "truth.json")
        cameras = None if sequence.camera is None else (sequence.camera,)
        recording = Recording.open(sequence.folder, cameras=cameras)
        if len(recording.rig) != 1:
            raise InputError(
                f"{sequence.folder} has {len(recording.rig)} cameras: choose one with --camera NAME"
            )
        for method, estimator in METHODS.items():
            settings = Settings(stature_m=sequence.stature_m, options=options)
            result = folder / f"{name}_{estimator}"
            fit(recording, Output(result), settings, estimator, reporter)
            joints_m = read_joints(result / "joints.csv", len(truth))
            scores[f"{name}, {method}"] = score_motion(truth, joints_m)
    (folder / TABLE).write_text(figure_tables(scores), encoding="utf-8")
    about = {
        "voxelpose": __version__,
        "sequences": {name: vars(score) for name, score in scores.items()},
    }
    (folder / SUMMARY).write_text(as_json(about), encoding="utf-8")
    return scores


def figure_tables(scores: Mapping[str, Score]) -> str:
    """A Markdown table of the scores of each method."""
    own = [{k: one for k, one in scores.items() if k.endswith(f", {method}")} for method in METHODS]
    return "\n".join(map(markdown_table, own))
