"""voxelpose calibrate sync."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

from tyro.conf import arg

from calib.errors import InputError
from voxelpose.cli.arguments import (
    Cameras,
    OptionalFile,
    OptionalName,
    OverwriteFile,
    RecordingFolder,
    Unit,
    camera_names,
    refuse_existing,
)
from voxelpose.cli.terminal import plain, rich_console

if TYPE_CHECKING:
    from voxelpose.calibration.sync import Sync


@dataclass(frozen=True)
class CalibrateSync:
    """Arguments of `voxelpose calibrate sync`."""

    help: ClassVar[str] = """Estimates the time offsets of cameras from a person's movement.

No clap and no flash is needed; videos may differ in length and rate. With --out, the time of every
frame is written; save the file as timestamps.csv in the recording, and all commands use the frames
that match in time.

  voxelpose calibrate sync walk
  voxelpose calibrate sync walk --out walk/timestamps.csv
"""

    recording: RecordingFolder
    out: OptionalFile = None
    """Table of times to be written (cam_id,frame_time). Default: offsets are only printed."""
    reference: OptionalName = None
    """Camera to which the offsets refer. Default: the first."""
    most: Annotated[float, arg(metavar="S")] = 2.0
    """Largest offset that is searched for, in seconds."""
    seconds: Annotated[float, arg(metavar="S")] = 12.0
    """Length of the part of the recording to use, around its middle."""
    rates: Annotated[str | None, arg(metavar="NAME=N,...", help_behavior_hint="")] = None
    """Frames per second, where files do not state it correctly, as in cam_1=30,cam_2=15."""
    cameras: Cameras = None
    unit: Unit = None
    overwrite: OverwriteFile = False

    def run(self) -> int:
        """Estimates the offsets; returns the exit code."""
        from voxelpose.cli.progress import Progress

        refuse_existing([self.out], self.overwrite)
        with Progress() as progress:
            progress.stage("opening")
            from voxelpose.calibration.sync import SyncSettings, sync_recording

            settings = SyncSettings(
                self.most, self.seconds, self.reference, camera_rates(self.rates), self.unit
            )
            sync = sync_recording(self.recording, settings, camera_names(self.cameras), progress)
        print_sync(sync)
        if self.out is not None:
            if not sync.result.agreed:
                raise InputError(
                    f"the cameras agree at no offset, so {self.out} was not written: calibrate"
                    " first, then synchronise"
                )
            sync.write(self.out)
            print(
                f"{self.out}: time of every frame; as timestamps.csv in the recording, all commands"
                " use it"
            )
        return 0


def camera_rates(text: str | None) -> dict[str, float] | None:
    """Reads frames per second by camera name, as in cam_1=30,cam_2=15.

    Raises:
        InputError: the text is not understood.
    """
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
    """Prints one line per camera."""
    from rich.table import Table

    console = rich_console()
    table = Table(
        "camera", "fps", "late by, frames", "ms", "+- ms (95 %)", box=None, padding=(0, 2, 0, 0)
    )
    for line in sync.result.offsets:
        named = plain(line.camera), f"{sync.fps[line.camera]:g}"
        if line.camera == sync.result.reference:
            table.add_row(*named, "its clock counts", "", "")
        else:
            interval = f"{2000 * line.error_s:.1f}" if line.error_s == line.error_s else "?"
            table.add_row(
                *named,
                f"{line.frames:+.2f}",
                f"{1000 * line.offset_s:+.1f}",
                interval,
            )
    console.print(table)
    found = sync.result
    console.print(
        f"outlines met within {found.before_px:.1f} px as filmed, {found.after_px:.1f} px with"
        " these offsets",
        soft_wrap=True,
    )
    if not found.agreed:
        console.print(
            "the cameras agree at no offset: the offsets above follow from the speed of the"
            " outlines only, and are rough; check the calibration first",
            soft_wrap=True,
        )
    for note in sync.notes:
        console.print(f"note: {note}", soft_wrap=True)
