"""voxelpose calibrate convert."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from tyro.conf import Positional, arg

from voxelpose.cli.arguments import (
    OptionalFile,
    OverwriteFile,
    Unit,
    refuse_existing,
    two_numbers,
)


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
    picture: OptionalFile = None
    """PNG to be written: the cameras from above and from the side."""
    overwrite: OverwriteFile = False

    def run(self) -> int:
        """Converts the calibration; returns the exit code."""
        from calib.files import read_rig, write_rig
        from voxelpose.calibration.files import notes_of

        refuse_existing([self.out, self.picture], self.overwrite)
        size = self.size and two_numbers(self.size, "--size", "width and height, as in 1920x1080")
        rig = read_rig(self.source, self.unit, size or None)
        write_rig(rig, self.out, self.to, notes_of(self.source))
        print(f"{self.out}: {len(rig)} cameras ({', '.join(rig.names)}), in metres")
        if self.picture is not None:
            from voxelpose.calibration.files import write_png
            from voxelpose.calibration.rig_picture import rig_picture

            write_png(rig_picture(rig), self.picture)
            print(f"{self.picture}: the cameras from above and from the side")
        return 0
