"""voxelpose calibrate sync."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from tyro.conf import Positional, arg

from calib.errors import InputError
from voxelpose.cli.arguments import camera_names

if TYPE_CHECKING:
    from voxelpose.calibration.sync import Sync


@dataclass(frozen=True)
class CalibrationSync:
    """The arguments of `voxelpose calibrate sync`."""

    help: ClassVar[
        str
    ] = """Finds by how much cameras are out of step, from whoever moves before them.

No clap and no flash is needed. Videos may differ in length and in rate. With --out it writes when every frame was taken; put that
beside the videos as timestamps.csv, and all commands take the frames that belong together.

  voxelpose calibrate sync walk
  voxelpose calibrate sync walk --out walk/timestamps.csv
"""

    recording: Annotated[Positional[Path], arg(metavar="RECORDING")]
    """Recording folder."""
    out: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None
    """Table of times to be written (cam_id,frame_time). Left out: offsets are printed only."""
    reference: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="")] = None
    """Camera whose clock counts. Left out: the first."""
    most: Annotated[float, arg(metavar="S")] = 2.0
    """The largest offset that is looked for, in seconds."""
    seconds: Annotated[float, arg(metavar="S")] = 12.0
    """How much of the recording is looked at, from its middle."""
    rates: Annotated[str | None, arg(metavar="NAME=N,...", help_behavior_hint="")] = None
    """Frames per second of cameras whose files do not say it or say it wrongly, as in
    cam_1=30,cam_2=15.
    """
    cameras: Annotated[str | None, arg(metavar="NAME,NAME", help_behavior_hint="")] = None
    """Cameras to use, by name. Left out: all."""
    unit: Annotated[
        Literal["m", "cm", "mm"] | None, arg(metavar="m|cm|mm", help_behavior_hint="")
    ] = None
    """Unit of the calibration's lengths, where the file does not say it."""
    overwrite: bool = False
    """Replace FILE if it exists."""

    def run(self) -> int:
        """Synchronises."""
        from voxelpose.cli.progress import Progress

        if self.out is not None and self.out.exists() and not self.overwrite:
            raise InputError(f"{self.out} exists: choose another name, or say --overwrite")
        with Progress() as progress:
            progress.stage("opening")
            from voxelpose.calibration.sync import SyncSettings, sync_recording

            settings = SyncSettings(
                self.most, self.seconds, self.reference, camera_rates(self.rates), self.unit
            )
            sync = sync_recording(self.recording, settings, camera_names(self.cameras), progress)
        print_sync(sync)
        if self.out is not None:
            if not sync.found.agreed:
                raise InputError(
                    f"the cameras agree at no offset, so {self.out} was not written: calibrate"
                    " first, then synchronise"
                )
            sync.write(self.out)
            print(
                f"{self.out}: when every frame was taken; as timestamps.csv in the recording all"
                " commands use it"
            )
        return 0


def camera_rates(text: str | None) -> dict[str, float] | None:
    """Reads cam_1=30,cam_2=15."""
    if text is None:
        return None
    rates = {}
    for item in text.split(","):
        name, _, rate = item.partition("=")
        try:
            rates[name.strip()] = float(rate)
        except ValueError:
            raise InputError(
                f"--rates {text} is not understood: give frames per second by camera, as in"
                " cam_1=30,cam_2=15"
            ) from None
    return rates


def print_sync(sync: Sync) -> None:
    """Prints a line per camera."""
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    table = Table(
        "camera", "fps", "late by, frames", "ms", "+- ms (95 %)", box=None, padding=(0, 2, 0, 0)
    )
    for line in sync.found.offsets:
        if line.camera == sync.found.reference:
            table.add_row(line.camera, f"{sync.fps[line.camera]:g}", "its clock counts", "", "")
        else:
            sure = f"{2000 * line.error_s:.1f}" if line.error_s == line.error_s else "?"
            table.add_row(
                line.camera,
                f"{sync.fps[line.camera]:g}",
                f"{line.frames:+.2f}",
                f"{1000 * line.late_s:+.1f}",
                sure,
            )
    console.print(table)
    found = sync.found
    console.print(
        f"outlines met within {found.before_px:.1f} px as filmed, {found.after_px:.1f} px with"
        " these offsets",
        soft_wrap=True,
    )
    if not found.agreed:
        words = (
            "the cameras agree at no offset: the offsets above rest on how fast outlines move, and"
            " are rough; check the calibration first"
        )
        console.print(words, soft_wrap=True)
    for note in sync.notes:
        console.print(f"note: {note}", soft_wrap=True)
