"""Fig. 5 of paper A: turning on the spot, a golf swing toward the camera, pointing with one hand;
followed, scored and shown.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from calib.errors import InputError
from silhouette_core.estimator import Settings
from silhouette_core.progress import Reporter
from voxelpose import __version__
from voxelpose.demo.filming import make_recording
from voxelpose.evaluation import Score, markdown_table, score_motion
from voxelpose.export.joints import read_joints
from voxelpose.fitting import Output, fit
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import read_truth
from voxelpose.results import SUMMARY, as_json

TABLE = "table.md"
PERFORMED = ("golf", "pointing")


@dataclass(frozen=True)
class Sequence:
    """A recording to be followed.

    Attributes:
        folder: the recording; its truth.json is what it is scored against.
        stature_m: of the person; None: as subject.toml says.
        camera: its name, where there are several.
    """

    folder: Path
    stature_m: float | None = None
    camera: str | None = None


def performed(folder: Path, frames: int | None = None) -> dict[str, Sequence]:
    """Films the demo's mannequin, whose body is none that is fitted, at the golf swing and
    pointing.
    """
    return {
        name: Sequence(make_recording(folder / name, frames, performance=name))
        for name in PERFORMED
    }


def run_figure(
    sequences: Mapping[str, Sequence], library: Path | None, folder: Path, reporter: Reporter
) -> dict[str, Score]:
    """Follows the sequences as `voxelpose track` does and scores them.

    Args: sequences: by name. library: a pose library; None: the default one. folder: gets a result
        folder per sequence, whose contact_sheet.png is the figure, table.md and summary.json.
        reporter: told of every stage.

    Returns:
        A score per sequence.

    Raises:
        InputError: a recording cannot be followed, or has no truth.
    """
    options = {} if library is None else {"library": str(library)}
    scores: dict[str, Score] = {}
    for name, sequence in sequences.items():
        truth = read_truth(sequence.folder / "truth.json")
        recording = Recording.open(
            sequence.folder, cameras=None if sequence.camera is None else (sequence.camera,)
        )
        if len(recording.rig) != 1:
            raise InputError(
                f"{sequence.folder} has {len(recording.rig)} cameras: choose one with --camera NAME"
            )
        settings = Settings(stature_m=sequence.stature_m, options=options)
        fit(recording, Output(folder / name), settings, "monocular", reporter)
        scores[name] = score_motion(truth, read_joints(folder / name / "joints.csv", len(truth)))
    (folder / TABLE).write_text(markdown_table(scores), encoding="utf-8")
    about = {
        "voxelpose": __version__,
        "sequences": {name: vars(score) for name, score in scores.items()},
    }
    (folder / SUMMARY).write_text(as_json(about), encoding="utf-8")
    return scores
