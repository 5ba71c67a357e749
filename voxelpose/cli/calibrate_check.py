"""voxelpose calibrate check."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from tyro.conf import Positional, arg

from calib.errors import InputError
from voxelpose.cli.arguments import camera_names, frame_range

if TYPE_CHECKING:
    from voxelpose.calibration.check import Check


@dataclass(frozen=True)
class CalibrationCheck:
    """The arguments of `voxelpose calibrate check`."""

    help: ClassVar[
        str
    ] = """Checks from silhouettes alone whether cameras, calibration and videos agree.

Names a camera that was bumped or moved, swapped with another, letterboxed or scaled, or is out of step, and says by how much.
No board is needed: somebody who moves about in view of all cameras is enough. Exit code 0: all agree; 1: one does not.

  voxelpose calibrate check walk
  voxelpose calibrate check walk --png check.png
  voxelpose calibrate check walk --repair repaired      writes repaired/calibration.toml (and timestamps.csv)
"""

    recording: Annotated[Positional[Path], arg(metavar="RECORDING")]
    """Recording folder."""
    repair: Annotated[Path | None, arg(metavar="OUT", help_behavior_hint="")] = None
    """Folder to be made for a calibration in which the camera that is wrong has been put right."""
    png: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None
    """Picture to be written: every camera with what the others say of it."""
    moments: Annotated[int, arg(metavar="N")] = 12
    """How many frames are looked at, spread over the recording."""
    most_late: Annotated[int, arg(metavar="FRAMES")] = 12
    """How far out of step a camera may be to be noticed as such."""
    frames: Annotated[str | None, arg(metavar="A:B", help_behavior_hint="")] = None
    """First frame and one past the last. Left out: all."""
    cameras: Annotated[str | None, arg(metavar="NAME,NAME", help_behavior_hint="")] = None
    """Cameras to look at, by name. Left out: all."""
    unit: Annotated[
        Literal["m", "cm", "mm"] | None, arg(metavar="m|cm|mm", help_behavior_hint="")
    ] = None
    """Unit of the calibration's lengths, where the file does not say it."""
    fps: Annotated[float | None, arg(metavar="N", help_behavior_hint="")] = None
    """Frames per second, where the recording does not say it or says it wrongly."""
    overwrite: bool = False
    """Replace FILE if it exists."""

    def run(self) -> int:
        """Checks."""
        from voxelpose.cli.progress import Progress

        if self.png is not None and self.png.exists() and not self.overwrite:
            raise InputError(f"{self.png} exists: choose another name, or say --overwrite")
        if self.repair is not None and self.repair.exists():
            raise InputError(f"{self.repair} exists: choose another name")
        with Progress() as progress:
            progress.stage("opening")
            from voxelpose.calibration.check import CheckSettings, check_recording, write_repair
            from voxelpose.recording.folder import Recording

            settings = CheckSettings(self.moments, self.most_late)
            recording = Recording.open(
                self.recording,
                frame_range(self.frames),
                camera_names(self.cameras),
                self.unit,
                self.fps,
            )
            check = check_recording(recording, settings, progress)
        print_check(check)
        if self.png is not None:
            from voxelpose.calibration.check_picture import draw_check
            from voxelpose.calibration.files import write_png

            write_png(draw_check(check), self.png)
            print(f"{self.png}: every camera with what the others say of it")
        if self.repair is not None:
            if check.found.agrees:
                print("nothing to repair")
            else:
                write_repair(check, recording, self.repair)
                print(
                    f"{self.repair}: repaired; put what is in it into a copy of the recording,"
                    " check that, and fit it"
                )
        return 0 if check.found.agrees else 1


def print_check(check: Check) -> None:
    """Prints a line per camera, what is wrong, and the remedy."""
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    table = Table(
        "camera", "off by, px", "the others, px", "planes", "", box=None, padding=(0, 2, 0, 0)
    )
    swapped = {
        name
        for repair in check.repairs
        if repair.with_camera
        for name in (repair.camera, repair.with_camera)
    }
    for line in check.found.table:
        bad = line.camera in check.found.culprits or line.camera in swapped
        verdict = (
            "[red]does not agree[/red]"
            if bad
            else ("agrees" if check.found.agrees or check.found.culprits else "?")
        )
        table.add_row(
            line.camera, f"{line.error_px:.1f}", f"{line.others_px:.1f}", str(line.planes), verdict
        )
    console.print(table)
    console.print(check.found.words, soft_wrap=True)
    for repair in check.repairs:
        console.print(f"[bold]{repair.words}[/bold]", soft_wrap=True)
        console.print(f"  {remedy(check, repair.camera)}", soft_wrap=True)
    if check.after is not None:
        console.print(f"with that put right: {check.after.words}", soft_wrap=True)
    if not check.found.agrees and not check.repairs and len(check.found.table) > 2:
        console.print(
            "calibrate again; if the videos were not started together, first `voxelpose calibrate"
            " sync`",
            soft_wrap=True,
        )
    for note in check.notes:
        console.print(f"note: {note}", soft_wrap=True)


def remedy(check: Check, camera: str) -> str:
    """Returns what to do about a camera."""
    repair = next(repair for repair in check.repairs if repair.camera == camera)
    if repair.kind == "swapped":
        return f"rename the two videos (and backgrounds): {camera} <-> {repair.with_camera}"
    if repair.kind == "out of step":
        return "run with --repair for a timestamps.csv, or `voxelpose calibrate sync`"
    if repair.kind == "scaled":
        return (
            "record as you calibrated (same resolution, no black bars, no crop), or run with"
            f" --repair; but if {camera}'s picture is whole, heads or feet are missing from its"
            " silhouettes: look at --png"
        )
    if repair.kind == "unexplained":
        return f"look at {camera}'s silhouettes first; if they are good, calibrate it again"
    return "calibrate it again, or run with --repair"
