"""voxelpose calibrate check."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from tyro.conf import arg

from calib.errors import InputError
from voxelpose.cli.arguments import (
    Cameras,
    Fps,
    Frames,
    OptionalFile,
    OverwriteFile,
    RecordingFolder,
    Unit,
    camera_names,
    refuse_existing,
)
from voxelpose.cli.terminal import plain, rich_console

if TYPE_CHECKING:
    from voxelpose.calibration.check import Check


@dataclass(frozen=True)
class CalibrateCheck:
    """Arguments of `voxelpose calibrate check`."""

    help: ClassVar[str] = """Checks from silhouettes that calibration and videos agree.

Names a camera that was moved, exchanged with another, cropped, scaled or padded, or is out of step,
and by how much. No board is needed: a person who moves in view of all cameras is enough.
Exit code 0: all cameras agree; 1: one does not.

  voxelpose calibrate check walk
  voxelpose calibrate check walk --png check.png
  voxelpose calibrate check walk --repair repaired
"""

    recording: RecordingFolder
    repair: Annotated[Path | None, arg(metavar="OUT", help_behavior_hint="")] = None
    """Folder to be made for a repaired calibration.toml (and timestamps.csv, if needed)."""
    png: OptionalFile = None
    """PNG to be written: every camera with the outlines that the others predict."""
    moments: Annotated[int, arg(metavar="N")] = 12
    """Number of time steps to check, spread over the recording."""
    most_late: Annotated[int, arg(metavar="FRAMES")] = 12
    """Largest time offset of a camera that is searched for."""
    frames: Frames = None
    cameras: Cameras = None
    unit: Unit = None
    fps: Fps = None
    overwrite: OverwriteFile = False

    def run(self) -> int:
        """Checks the recording; returns the exit code."""
        from voxelpose.cli.terminal import Progress

        refuse_existing([self.png], self.overwrite, "--png")
        if self.repair is not None and self.repair.exists():
            raise InputError(f"{self.repair} exists: give --repair another name")
        with Progress() as progress:
            progress.stage("opening")
            from voxelpose.calibration.check import CheckSettings, check_recording, write_repair
            from voxelpose.recording.folder import Recording, frame_range

            settings = CheckSettings(self.moments, self.most_late)
            frames, names = frame_range(self.frames), camera_names(self.cameras)
            recording = Recording.open(self.recording, frames, names, self.unit, self.fps)
            check = check_recording(recording, settings, progress)
        print_check(check)
        if self.png is not None:
            from calib.atomic import write_whole
            from voxelpose.calibration.pictures import draw_check
            from voxelpose.view.images.canvas import png

            write_whole(self.png, png(draw_check(check)))
            print(f"{self.png}: every camera with the outlines that the others predict")
        if self.repair is not None:
            if check.agreement.agrees:
                print("nothing to repair")
            else:
                write_repair(check, recording, self.repair)
                print(
                    f"{self.repair}: repaired; copy its files into a copy of the recording, check"
                    " that, and fit it"
                )
        return 0 if check.agreement.agrees else 1


def print_check(check: Check) -> None:
    """Prints one line per camera, the faults and their remedies."""
    from rich.table import Table

    from voxelpose.calibration.check import remedy, verdict_on

    console = rich_console()
    table = Table(
        "camera", "off by, px", "the others, px", "planes", "", box=None, padding=(0, 2, 0, 0)
    )
    for line in check.agreement.table:
        verdict = verdict_on(check, line.camera)
        if verdict == "does not agree":
            verdict = f"[red]{verdict}[/red]"
        table.add_row(
            plain(line.camera),
            f"{line.error_px:.1f}",
            f"{line.others_px:.1f}",
            str(line.planes),
            verdict,
        )
    console.print(table)
    console.print(plain(check.agreement.summary), soft_wrap=True)
    for repair in check.repairs:
        console.print(f"[bold]{plain(repair.summary)}[/bold]", soft_wrap=True)
        console.print(f"  {plain(remedy(check, repair.camera))}", soft_wrap=True)
    if check.after is not None:
        console.print(f"with that put right: {plain(check.after.summary)}", soft_wrap=True)
    if not check.agreement.agrees and not check.repairs and len(check.agreement.table) > 2:
        console.print(
            "calibrate again; if the videos were not started together, first `voxelpose calibrate"
            " sync`",
            soft_wrap=True,
        )
    for note in check.notes:
        console.print(f"note: {plain(note)}", soft_wrap=True)
