"""voxelpose experiment arm-swing, voxelpose experiment figure-5."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from tyro.conf import Positional, arg

from calib.errors import InputError
from voxelpose.cli.arguments import camera_names, frame_range


@dataclass(frozen=True)
class ArmSwing:
    """The arguments of `voxelpose experiment arm-swing`."""

    help: ClassVar[
        str
    ] = """Repeats the arm-swing experiment of Okada and Stenger (section 7, Fig. 4).

RECORDING shows somebody in profile whose right arm swings to and fro; truth.json in it, or --truth, says how. Without one, the demo's
mannequin is filmed. The arm is followed with {wXOR, nwXOR} and {DM1, DM2} as in the paper, without anything this program adds, and every
swing is counted: Success, Error (followed at a wrong angle) or Fail.
OUT gets table.md (beside the paper's numbers), angles.png (true and estimated angle), summary.json, and the mannequin's recording/.

  voxelpose experiment arm-swing --out swing
  voxelpose experiment arm-swing RECORDING --stature 1.75 --no-ours --out swing
"""

    out: Annotated[Path, arg(metavar="OUT")]
    """Folder to be made for the results."""
    recording: Annotated[
        Positional[Path | None], arg(metavar="RECORDING", help_behavior_hint="")
    ] = None
    """Recording folder. Left out: the demo's mannequin swings its arm."""
    truth: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None
    """True joint positions. Left out: truth.json of the recording."""
    library: Annotated[Path | None, arg(metavar="LIB", help_behavior_hint="")] = None
    """Pose library. Left out: one like the paper's is made, about 3,400 samples in profile, the
    right arm moved in many ways.
    """
    stature: Annotated[float | None, arg(metavar="M", help_behavior_hint="")] = None
    """Height of the person in metres. Left out: subject.toml's."""
    camera: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="")] = None
    """Which camera's pictures, where there are several."""
    frames: Annotated[str | None, arg(metavar="A:B", help_behavior_hint="")] = None
    """First frame and one past the last. Left out: all."""
    sigma: Annotated[float, arg(metavar="SHARE")] = 0.05
    """Standard deviation of the silhouette distance, eq. (10), as a share of the silhouette's
    weight; the same for all methods.
    """
    prior: Literal["normalised", "kernel"] = "normalised"
    """How a pose passes its probability on: eq. (4) normalised over the library, as `voxelpose
    track` has it, or its exponential alone.
    """
    arm: Literal["near", "far"] = "near"
    """Without RECORDING: whether the mannequin's arm swings on the camera's side of its trunk, or
    beyond it, as in the paper.
    """
    degraded: bool = True
    """Also with silhouettes that are spoilt: rough contours, holes."""
    ours: bool = True
    """Also with this program's own estimator, as `voxelpose track` runs it."""
    overwrite: bool = False
    """Replace an earlier result in OUT, once the new one is whole."""
    threads: Annotated[int | None, arg(metavar="N", help_behavior_hint="")] = None
    """Processor threads. Left out: all."""

    def run(self) -> int:
        """Runs the experiment."""
        from voxelpose.cli.progress import Progress
        from voxelpose.results import ResultWriter

        with (
            ResultWriter(self.out, self.overwrite, self.recording) as folder,
            Progress() as progress,
        ):
            if not self.sigma > 0:
                raise InputError(
                    f"--sigma {self.sigma:g} is impossible: give a positive share, as in 0.05"
                )
            progress.note_compilation()
            progress.stage("opening")
            from silhouette_core.jit import set_threads
            from voxelpose.experiments.arm_swing import Reading
            from voxelpose.experiments.swing_report import swing_table
            from voxelpose.experiments.swing_study import Study, run_study
            from voxelpose.recording.folder import Recording

            set_threads(self.threads)
            filmed = self.recording or _film(
                folder / "recording", "arm_swing" if self.arm == "near" else "far_arm_swing"
            )
            recording = Recording.open(filmed, frame_range(self.frames), camera_names(self.camera))
            truth = self.truth or filmed / "truth.json"
            reading = Reading(self.sigma, self.prior == "normalised")
            study = Study(
                truth, self.stature, self.library, self.degraded, self.ours, reading=reading
            )
            rows = run_study(recording, study, folder, progress)
        print(swing_table(rows), end="")
        print(f"\n{self.out}: table.md, angles.png (true and estimated angle), summary.json")
        return 0


@dataclass(frozen=True)
class Figure5:
    """The arguments of `voxelpose experiment figure-5`."""

    help: ClassVar[
        str
    ] = """Repeats Fig. 5 of Okada and Stenger: a turn, a golf swing toward the camera, pointing with one hand.

The golf swing and the pointing are performed by the demo's mannequin, whose body is none that is fitted; the turn is RECORDING, if given,
with its truth.json. Each is followed as `voxelpose track` does and scored.
OUT gets table.md, and per sequence a result folder: look at its contact_sheet.png; recordings/ holds the mannequin's.

  voxelpose experiment figure-5 --out figure_5
  voxelpose experiment figure-5 turn1 --stature 1.75 --library me.vplib --out figure_5
"""

    out: Annotated[Path, arg(metavar="OUT")]
    """Folder to be made for the results."""
    recording: Annotated[
        Positional[Path | None], arg(metavar="RECORDING", help_behavior_hint="")
    ] = None
    """Recording of somebody who turns on the spot. Left out: without it."""
    library: Annotated[Path | None, arg(metavar="LIB", help_behavior_hint="")] = None
    """Pose library, from `voxelpose library build`. Left out: the default one."""
    stature: Annotated[float | None, arg(metavar="M", help_behavior_hint="")] = None
    """Height in metres of the person in RECORDING. Left out: subject.toml's, else 1.70."""
    camera: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="")] = None
    """Which of RECORDING's cameras, where there are several."""
    overwrite: bool = False
    """Replace an earlier result in OUT, once the new one is whole."""

    def run(self) -> int:
        """Runs the experiment."""
        from voxelpose.cli.progress import Progress
        from voxelpose.results import ResultWriter

        with (
            ResultWriter(self.out, self.overwrite, self.recording) as folder,
            Progress() as progress,
        ):
            progress.note_compilation()
            progress.stage("opening")
            from voxelpose.evaluation import markdown_table
            from voxelpose.experiments.figure_5 import Sequence, performed, run_figure

            sequences = (
                {}
                if self.recording is None
                else {"turning": Sequence(self.recording, self.stature, self.camera)}
            )
            scores = run_figure(
                sequences | performed(folder / "recordings"), self.library, folder, progress
            )
        print(markdown_table(scores), end="")
        print(
            f"\n{self.out}: table.md, and per sequence contact_sheet.png, overlay video and motion"
        )
        return 0


def _film(folder: Path, performance: str) -> Path:
    from voxelpose.demo.filming import make_recording

    return make_recording(folder, performance=performance)


SUBCOMMANDS = {"arm-swing": ArmSwing, "figure-5": Figure5}
