"""Commands arm-swing and figure-5."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from tyro.conf import Positional, arg

from calib.errors import InputError
from voxelpose.cli.arguments import (
    Frames,
    OptionalFile,
    OptionalLength,
    OptionalName,
    OverwriteResult,
    Threads,
    camera_names,
)


@dataclass(frozen=True)
class ArmSwing:
    """Arguments of `python -m papers arm-swing`."""

    help: ClassVar[str] = """Repeats the arm-swing experiment of Okada and Stenger (section 7).

RECORDING shows a person in profile whose right arm swings forth and back, with the true joint
positions in truth.json or --truth. Without RECORDING, the demo's mannequin is rendered. The arm is
tracked with {wXOR, nwXOR} and {DM1, DM2} as in the paper, or with --additions by this program's
filter, and every swing is counted as Success, Error (tracked at a wrong angle) or Fail (Fig. 4).
OUT receives table.md (with the paper's numbers), angles.png (true and estimated angles),
summary.json, and the mannequin's recording/.

  python -m papers arm-swing --out swing
  python -m papers arm-swing RECORDING --stature 1.75 --no-ours --out swing
"""

    out: Annotated[Path, arg(metavar="OUT")]
    """Folder to be made for the results."""
    recording: Annotated[
        Positional[Path | None], arg(metavar="RECORDING", help_behavior_hint="")
    ] = None
    """Recording folder. Default: the demo's mannequin swings its arm."""
    truth: OptionalFile = None
    """True joint positions. Default: truth.json of the recording."""
    library: Annotated[Path | None, arg(metavar="LIB", help_behavior_hint="")] = None
    """Pose library. Default: one like the paper's, about 3,400 samples in profile, is made."""
    stature: OptionalLength = None
    """Height of the person in metres. Default: from subject.toml."""
    camera: OptionalName = None
    """Name of the camera, where there are several."""
    frames: Frames = None
    sigma: Annotated[float, arg(metavar="FRACTION")] = 0.05
    """Standard deviation in eq. (10), as a fraction of the silhouette's weight; for all methods."""
    prior: Literal["normalised", "kernel"] = "normalised"
    """Eq. (4) normalised over the library, as in `voxelpose track`, or its exponential alone."""
    additions: bool = False
    """Track with what this program adds: refined silhouettes, shifts, restarts of lost tracks."""
    arm: Literal["near", "far"] = "near"
    """Without RECORDING: side on which the arm swings, near the camera or far (as the paper)."""
    degraded: bool = True
    """Repeat with degraded silhouettes: rough contours, holes."""
    ours: bool = True
    """Repeat with this program's own estimator, as in `voxelpose track`."""
    overwrite: OverwriteResult = False
    threads: Threads = None

    def run(self) -> int:
        """Runs the experiment; returns the exit code."""
        from voxelpose.cli.terminal import Progress
        from voxelpose.results import ResultWriter

        with (
            ResultWriter(self.out, self.overwrite, self.recording) as folder,
            Progress() as progress,
        ):
            if not self.sigma > 0:
                raise InputError(
                    f"--sigma {self.sigma:g} is impossible: give a positive fraction, as in 0.05"
                )
            progress.note_compilation()
            progress.stage("opening")
            from papers.arm_swing import Reading
            from papers.swing_report import swing_table
            from papers.swing_study import Study, run_study
            from silhouette_core.jit import set_threads
            from voxelpose.demo.room import make_recording
            from voxelpose.recording.folder import Recording, frame_range
            from voxelpose.recording.truth import TRUTH

            set_threads(self.threads)
            source = self.recording
            if source is None:
                performance = "arm_swing" if self.arm == "near" else "far_arm_swing"
                source = make_recording(folder / "recording", performance=performance)
            frames = frame_range(self.frames)
            recording = Recording.open(source, frames, camera_names(self.camera))
            truth = self.truth or source / TRUTH
            reading = Reading(self.sigma, self.prior == "normalised", self.additions)
            study = Study(
                truth, self.stature, self.library, self.degraded, self.ours, reading=reading
            )
            rows = run_study(recording, study, folder, progress)
        print(swing_table(rows), end="")
        print(f"\n{self.out}: table.md, angles.png (true and estimated angle), summary.json")
        return 0


@dataclass(frozen=True)
class Figure5:
    """Arguments of `python -m papers figure-5`."""

    help: ClassVar[str] = """Repeats Fig. 5 of Okada and Stenger: turn, golf swing, pointing.

The golf swing toward the camera and the pointing with one hand are performed by the demo's
mannequin, whose shape differs from the fitted model. The turn is RECORDING, if given, with its
truth.json. Every sequence is tracked as by `voxelpose track` and scored.
OUT receives table.md, a result folder per sequence, whose contact_sheet.png shows the result, and
recordings/ with the mannequin's sequences.

  python -m papers figure-5 --out figure_5
  python -m papers figure-5 turn1 --stature 1.75 --library me.vplib --out figure_5
"""

    out: Annotated[Path, arg(metavar="OUT")]
    """Folder to be made for the results."""
    recording: Annotated[
        Positional[Path | None], arg(metavar="RECORDING", help_behavior_hint="")
    ] = None
    """Recording of a person who turns on the spot. Default: none."""
    library: Annotated[Path | None, arg(metavar="LIB", help_behavior_hint="")] = None
    """Pose library made by `voxelpose library build`. Default: the program's own."""
    stature: OptionalLength = None
    """Height in metres of the person in RECORDING. Default: from subject.toml, else 1.70."""
    camera: OptionalName = None
    """Name of RECORDING's camera, where there are several."""
    overwrite: OverwriteResult = False

    def run(self) -> int:
        """Runs the experiment; returns the exit code."""
        from voxelpose.cli.terminal import Progress
        from voxelpose.results import ResultWriter

        with (
            ResultWriter(self.out, self.overwrite, self.recording) as folder,
            Progress() as progress,
        ):
            progress.note_compilation()
            progress.stage("opening")
            from papers.figure_5 import Sequence, performed, run_figure
            from voxelpose.evaluation import markdown_table

            sequences = (
                {}
                if self.recording is None
                else {"turning": Sequence(self.recording, self.stature, self.camera)}
            )
            sequences |= performed(folder / "recordings")
            scores = run_figure(sequences, self.library, folder, progress)
        print(markdown_table(scores), end="")
        print(
            f"\n{self.out}: table.md, and per sequence contact_sheet.png, overlay video and motion"
        )
        return 0


SUBCOMMANDS = {"arm-swing": ArmSwing, "figure-5": Figure5}
