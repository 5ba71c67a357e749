"""voxelpose calibrate sync."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from msgspec import Meta

from calib.errors import InputError
from voxelpose.cli import arguments
from voxelpose.cli.terminal import Progress, plain, print_table, rich_console

if TYPE_CHECKING:
    from silhouette_core.progress import Reporter
    from voxelpose.calibration.sync import Sync


_Seconds = Annotated[float, Meta(ge=1 / 100, le=100_000)]


@dataclass(frozen=True, kw_only=True)
class CalibrateSync(arguments.OptionalBoard):
    """Estimates the time offsets of cameras, calibrated or not.

    Videos may differ in length and rate. Offsets are found from the silhouettes of somebody who
    moves (with a calibration to about 1 ms, without one to 1 to 20 ms), from the speed of a carried
    board (1 to 2 ms; lenses must be known), or from sound that all cameras record, such as a clap
    (1 ms, and 3 ms for each metre that a camera is nearer to it than another). With --out, the time
    of every frame is written; save the file as timestamps.csv in the recording, and all commands
    use the frames that match in time.

      voxelpose calibrate sync walk
      voxelpose calibrate sync walk --out walk/timestamps.csv
      voxelpose calibrate sync walk --by sound --out walk/timestamps.csv
      voxelpose calibrate sync board_walk --by board --board 8x5 --intrinsics lenses.toml \\
        --out board_walk/timestamps.csv
    """

    groups: ClassVar = arguments.CALIBRATION_GROUPS
    recording: arguments.RecordingFolder
    out: arguments.OptionalFile = None
    """Table of times to be written (cam_id,frame_time). Default: offsets are only printed."""
    by: Literal["auto", "geometry", "board", "sound", "silhouettes"] = "auto"
    """What offsets are found from; geometry: silhouettes with a calibration. Default: the first of
    a board (if --board is given), geometry, sound and silhouettes that there is."""
    reference: arguments.OptionalName = None
    """Camera to which the offsets refer. Default: the first."""
    most: Annotated[_Seconds | None, arguments.optional("S")] = None
    """Largest offset that is searched for, in seconds. Default: 2 by geometry, 10 by silhouettes,
    20 by a board, 60 by sound."""
    seconds: Annotated[_Seconds | None, arguments.optional("S")] = None
    """Length of the part of the recording to use, around its middle. Default: 12 by geometry, 40 by
    silhouettes, 60 by a board; by sound the first 600."""
    intrinsics: arguments.OptionalFile = None
    """Calibration of the lenses, by which a board's speed is seen. Default: the recording's own."""
    rates: Annotated[str | None, arguments.optional("NAME=N,...")] = None
    """Frames per second, where files do not state it correctly, as in cam_1=30,cam_2=15."""
    cameras: arguments.Cameras = None
    unit: arguments.Unit = None
    label: arguments.Label = None
    overwrite: arguments.OverwriteFile = False

    def run(self) -> None:
        """Estimates the offsets."""
        arguments.refuse_existing([self.out], self.overwrite)
        with Progress() as progress:
            sync = self.calibrate(progress)
        print_sync(sync)
        if self.out is not None:
            self.write(sync)
            print(
                f"{self.out}: time of every frame; as timestamps.csv in the recording, all commands"
                " use it"
            )

    def calibrate(self, reporter: Reporter) -> Sync:
        """The offsets. InputError where nothing tells them."""
        reporter.stage("opening")
        from calib.files import read_rig
        from voxelpose.calibration.sync import SyncSettings, sync_recording

        lenses = None
        if self.intrinsics is not None:
            lenses = read_rig(self.intrinsics, self.unit, lenses=True)
        settings = SyncSettings(
            self.most,
            self.seconds,
            self.reference,
            camera_rates(self.rates),
            self.unit,
            None if self.by == "auto" else self.by,
            self.to_board(0.1),  # speeds are compared in shape, not in size: any square does
            lenses,
            self.label,
        )
        cameras = arguments.camera_names(self.cameras)
        return sync_recording(self.recording, settings, cameras, reporter)

    def write(self, sync: Sync) -> None:
        """Writes the time of every frame. InputError where the offsets are not sure."""
        from voxelpose.calibration.sync import sync_findings

        if self.out is not None:
            if not sync.result.agreed:
                raise InputError(f"{self.out} was not written: {sync_findings(sync)[0].remedy}")
            sync.write(self.out)


def camera_rates(text: str | None) -> dict[str, float] | None:
    """Frames per second by camera name in a text as cam_1=30,cam_2=15; else an InputError."""
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
    from voxelpose.calibration.sync import sync_findings

    rows = []
    for line in sync.result.offsets:
        cells = "its clock counts", "", ""
        if line.camera != sync.result.reference:
            interval = f"{2000 * line.error_s:.1f}" if line.error_s == line.error_s else "?"
            cells = f"{line.frames:+.2f}", f"{1000 * line.offset_s:+.1f}", interval
        rows.append((plain(line.camera), f"{sync.fps[line.camera]:g}", *cells))
    print_table(rows, "camera", "fps", "late by, frames", "ms", "+- ms (95 %)")
    console = rich_console(soft_wrap=True)
    lines = [finding.words for finding in sync_findings(sync)]
    for line in (*lines, *(f"note: {note}" for note in sync.notes)):
        console.print(plain(line))
