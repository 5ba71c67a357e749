"""Commands arm-swing and figure-5."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from tyro.conf import Positional, arg

from calib.errors import InputError
from voxelpose.cli.arguments import OptionalLength, OptionalName, OverwriteResult, Threads


@dataclass(frozen=True)
class ArmSwing:
    """Arguments of `python -m papers arm-swing`."""

    help: ClassVar[str] = """Repeats the arm-swing experiment of Okada and Stenger (section 7).

For every seed a person of another build than the library's is drawn and filmed in profile, who
swings the right arm 24 times, no swing like another: once on the far side of the trunk, as in the
paper, and once on the near one. The arm is tracked with {wXOR, nwXOR}, each with the tree of its
own distance, and {DM1, DM2}, with (4) read in three ways; sigma of (10) is for every row the one
that errs least on other people. Every swing counts as Success, Error (tracked at a wrong angle) or
Fail (Fig. 4). OUT receives table.md (with the paper's numbers), angles.png (true and estimated
angles), costs.png (distance over the arm's angle) and summary.json.

  python -m papers arm-swing --out swing
"""

    out: Annotated[Path, arg(metavar="OUT")]
    """Folder to be made for the results."""
    seeds: Annotated[int, arg(metavar="N")] = 5
    """Number of people on either side."""
    swings: Annotated[int, arg(metavar="N")] = 24
    """Swings of each."""
    samples: Annotated[int, arg(metavar="N")] = 3417
    """Largest number of samples of each library; the paper's has 3,417."""
    wide: bool = False
    """People with thin arms and wide trunks only."""
    sigma: Annotated[float | None, arg(metavar="FRACTION", help_behavior_hint="")] = None
    """Sigma of (10) for all rows, as a fraction of the silhouette's weight. Default: for every row
    the one of four that errs least on other people."""
    overwrite: OverwriteResult = False
    threads: Threads = None

    def run(self) -> int:
        """Runs the experiment; returns the exit code."""
        from voxelpose.cli.terminal import Progress
        from voxelpose.results import ResultWriter

        with ResultWriter(self.out, self.overwrite) as folder, Progress() as progress:
            if min(self.seeds, self.swings) < 1:
                raise InputError("--seeds and --swings must be 1 or more")
            if self.sigma is not None and not self.sigma > 0:
                raise InputError(
                    f"--sigma {self.sigma:g} is impossible: give a positive fraction, as in 0.05"
                )
            progress.note_compilation()
            progress.stage("opening")
            from papers.swing_report import swing_table
            from papers.swing_study import SIGMAS, Study, run_study
            from silhouette_core.jit import set_threads

            set_threads(self.threads)
            seeds = tuple(range(1, self.seeds + 1))
            sigmas = SIGMAS if self.sigma is None else (self.sigma,)
            study = Study(seeds, self.swings, self.samples, self.wide, sigmas)
            sides = run_study(study, folder, progress)
        print(swing_table(sides), end="")
        print(f"\n{self.out}: table.md, angles.png, costs.png, summary.json")
        return 0


@dataclass(frozen=True)
class Figure5:
    """Arguments of `python -m papers figure-5`."""

    help: ClassVar[str] = """Repeats Fig. 5 of Okada and Stenger: turn, golf swing, pointing.

The golf swing toward the camera and the pointing with one hand are performed by the demo's
mannequin, whose shape differs from the fitted model. The turn is RECORDING, if given, with its
truth.json. Every sequence is tracked as by `voxelpose track`, with and without --method paper.
OUT receives table.md, a result folder per sequence and method, whose contact_sheet.png shows the
result, and recordings/ with the mannequin's sequences.

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
    """Pose library made by `voxelpose library build`. Default: each method's own."""
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
            from papers.figure_5 import Sequence, figure_tables, performed, run_figure

            sequences = (
                {}
                if self.recording is None
                else {"turning": Sequence(self.recording, self.stature, self.camera)}
            )
            sequences |= performed(folder / "recordings")
            scores = run_figure(sequences, self.library, folder, progress)
        print(figure_tables(scores), end="")
        print(
            f"\n{self.out}: table.md, and per sequence contact_sheet.png, overlay video and motion"
        )
        return 0


SUBCOMMANDS = {"arm-swing": ArmSwing, "figure-5": Figure5}
