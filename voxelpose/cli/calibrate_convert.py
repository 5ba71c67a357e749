"""voxelpose calibrate convert."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from tyro.conf import Positional, arg

from calib.errors import InputError
from voxelpose.cli.arguments import (
    OptionalFile,
    OverwriteFile,
    Unit,
    refuse_existing,
    two_numbers,
    up_direction,
)

if TYPE_CHECKING:
    from calib.camera import Rig
    from calib.upright import UprightFrame


@dataclass(frozen=True)
class CalibrateConvert:
    """Arguments of `voxelpose calibrate convert`."""

    help: ClassVar[str] = """Converts a calibration into another format; lengths become metres.

Formats of IN are recognised by content: TOML of aniposelib, Pose2Sim, Caliscope and FreeMoCap;
OpenCV FileStorage; EasyMocap's folder; Qualisys .qca.txt; JSON of cameras or of 3x4 matrices. The
suffix of OUT selects the format: .toml, .yml, .xml, .json, .txt (Qualisys), none (EasyMocap).

  voxelpose calibrate convert Calib.qca.txt calibration.toml
  voxelpose calibrate convert freemocap.toml calibration.toml --unit mm
  voxelpose calibrate convert projections.json calibration.yml --unit m --size 780x582
  voxelpose calibrate convert board.toml calibration.toml --up cameras
  voxelpose calibrate convert board.toml calibration.toml --up person --result walk_fit
"""

    source: Annotated[Positional[Path], arg(metavar="IN")]
    """Calibration to be read: a file or a folder."""
    out: Annotated[Positional[Path], arg(metavar="OUT")]
    """Calibration to be written."""
    unit: Unit = None
    size: Annotated[str | None, arg(metavar="WIDTHxHEIGHT", help_behavior_hint="")] = None
    """Image size in pixels, where IN does not state it."""
    to: Literal["anipose", "easymocap", "json", "opencv", "projections", "qualisys"] | None = None
    """Format of OUT, where its suffix would select another."""
    up: Annotated[str | None, arg(metavar="AXIS|cameras|person", help_behavior_hint="")] = None
    """What becomes z: an axis of IN (-z, y ...), what is up for the cameras, or in --result."""
    result: Annotated[Path | None, arg(metavar="RESULT", help_behavior_hint="")] = None
    """Result of a fit with IN, for --up person: up and the floor as found there."""
    picture: OptionalFile = None
    """PNG to be written: the cameras from above and from the side."""
    overwrite: OverwriteFile = False

    def run(self) -> int:
        """Converts the calibration; returns the exit code."""
        from calib.files import read_rig, write_rig
        from calib.files.notes import read_notes
        from calib.upright import axis_name

        refuse_existing([self.out, self.picture], self.overwrite)
        size = self.size and two_numbers(self.size, "--size", "width and height, as in 1920x1080")
        rig = read_rig(self.source, self.unit, size or None)
        notes = read_notes(self.source)
        frame = self._upright_frame(rig)
        if frame is not None:
            rig = frame.rig(rig)
            notes["up"] = "z"
        write_rig(rig, self.out, self.to, notes)
        print(f"{self.out}: {len(rig)} cameras ({', '.join(rig.names)}), in metres")
        if frame is not None:
            floor = f", the floor at {frame.floor_m:.2f} m along it" if frame.floor_m else ""
            print(f"z is now up, which was {axis_name(frame.up)}{floor}")
        if self.picture is not None:
            from calib.atomic import write_whole
            from voxelpose.calibration.pictures import rig_picture
            from voxelpose.view.images.canvas import png

            write_whole(self.picture, png(rig_picture(rig)))
            print(f"{self.picture}: the cameras from above and from the side")
        return 0

    def _upright_frame(self, rig: Rig) -> UprightFrame | None:
        """Returns the frame that becomes the world; None where IN's world stays."""
        from calib.upright import UprightFrame, up_candidates
        from voxelpose.results import Result

        if (self.up == "person") != (self.result is not None):
            raise InputError(
                "--up person needs --result, the result of a fit with this calibration, and no"
                " other --up does"
            )
        if self.result is not None:
            return Result.open(self.result).motion.upright_frame
        if self.up == "cameras":
            return UprightFrame.from_up(up_candidates(rig)[0])
        up = up_direction(self.up)
        return None if up is None else UprightFrame.from_up(up)
