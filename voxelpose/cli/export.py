"""voxelpose export."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from tyro.conf import Positional, arg

from calib.errors import InputError

_FORMATS = "bvh,glb,trc,c3d,csv,npz"


@dataclass(frozen=True)
class Export:
    """Arguments of `voxelpose export`."""

    help: ClassVar[str] = """Writes a result in the formats of other programs.

  bvh  motion.bvh: skeleton, for Blender, Maya, MotionBuilder
  glb  motion.glb: animated body, for Blender, three.js, game engines
  trc  motion.trc, motion.mot: points and joint coordinates, for OpenSim
  c3d  motion.c3d: points, for motion capture software and MATLAB
  csv  joints.csv, joints_wide.csv, angles.csv: positions and anatomical angles
  npz  motion.npz: all data as NumPy arrays

  voxelpose export walk_fit
  voxelpose export walk_fit --to glb,csv --out for_the_lab
"""

    result: Annotated[Positional[Path], arg(metavar="RESULT")]
    """Folder of a result."""
    to: Annotated[str, arg(metavar="NAME,NAME")] = _FORMATS
    """Formats to write."""
    out: Annotated[Path | None, arg(metavar="FOLDER", help_behavior_hint="")] = None
    """Folder to write to. Default: RESULT, where an earlier export is replaced."""
    overwrite: bool = False
    """Replace files of the same names in FOLDER."""

    def run(self) -> int:
        """Writes the files and prints their names; returns the exit code."""
        from voxelpose.export.formats import export_motion
        from voxelpose.results import Result

        formats = [name.strip().lower() for name in self.to.split(",") if name.strip()]
        if not formats:
            raise InputError(f"--to names no format: give some of {_FORMATS}")
        motion = Result.open(self.result).motion
        overwrite = self.overwrite or self.out is None
        for path in export_motion(motion, self.out or self.result, formats, overwrite):
            print(path)
        return 0
