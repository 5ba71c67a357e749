"""Recordings and results of bodies that are no person's, without an estimator; and what is asked
of a fit.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from examples.bodies.example_motions import example_motion
from silhouette_core.estimator import Estimate, Settings
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import read_motion, write_motion
from tests.sources import ring, write_staged
from voxelpose.fitting import Output, write_estimate
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import TRUE_MOTION
from voxelpose.results import Result

TURNED_DEG = 3.0


def write_example_result(
    folder: Path, name: str, frames: int = 4, pictures: bool = True
) -> tuple[Motion, Motion]:
    """Writes the recording FOLDER/NAME of an example with its truth, and the result
    FOLDER/NAME_fit, which lacks the first frame and whose last joint angle is wrong by TURNED_DEG.

    Returns: The true motion, and that of the result.
    """
    truth = example_motion(name, frames)
    write_staged(folder / name, truth, ring(3, (320, 240)))
    write_motion(truth, folder / name / TRUE_MOTION)
    motion = turned(truth).select(slice(1, None))
    quality = {
        "part_overlap": np.full((len(motion), len(motion.model.names)), 0.8),
        "outline_agreement": np.full(len(motion), 0.95),
    }
    estimate = Estimate(replace(motion, quality=quality), {"search": np.full(frames, 0.01)}, {})
    output = Output(folder / f"{name}_fit", pictures=pictures)
    result = write_estimate(Recording.open(folder / name), output, estimate, Settings())
    return truth, result.motion


def turned(motion: Motion) -> Motion:
    """A motion whose last joint angle is larger by TURNED_DEG."""
    angles = motion.angles_rad.copy()
    angles[:, -1] += np.radians(TURNED_DEG)
    return replace(motion, angles_rad=angles)


def assert_found(
    recording: Path, folder: Path, frames: int, most_deg: float, most_mm: float
) -> None:
    """The motion that `film_example` has filmed is found in every frame."""
    result, truth = Result.open(folder), read_motion(recording / TRUE_MOTION)
    motion = result.motion
    assert len(motion) == frames and motion.model.names == truth.model.names
    turns = np.degrees(np.abs(motion.angles_rad - truth.angles_rad))
    assert turns.mean() < most_deg
    mm = 1000 * np.linalg.norm(motion.landmarks() - truth.landmarks(), axis=2)
    assert mm.mean() < most_mm
    if truth.model.tree.root_fixed:
        np.testing.assert_allclose(motion.root_m, motion.root_m[:1].repeat(frames, 0), atol=1e-3)
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["body"]["parts"] == len(truth.model.names)
    assert "joint_error_mm" not in summary["quality"] and summary["verdict"]["level"] == "reliable"
