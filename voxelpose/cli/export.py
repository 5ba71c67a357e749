"""voxelpose export."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from tyro.conf import Positional, arg

_FORMATS = "bvh,glb,trc,c3d,csv,npz"


@dataclass(frozen=True)
class Export:
    """The arguments of `voxelpose export`."""

    help: ClassVar[str] = """Writes a result in the formats of other programs.
  bvh  motion.bvh: the skeleton, for Blender, Maya, MotionBuilder
  glb  motion.glb: the moving body, for Blender, three.js, game engines
  trc  motion.trc, motion.mot: points and joint coordinates, for OpenSim
  c3d  motion.c3d: points, for motion capture software and MATLAB
  csv  joints.csv, joints_wide.csv, and angles.csv: anatomical, degrees
  npz  motion.npz: everything as NumPy arrays

  voxelpose export walk_fit
  voxelpose export walk_fit --to glb,csv --out for_the_lab
"""

    result: Annotated[Positional[Path], arg(metavar="RESULT")]
    """Folder of a fit."""
    to: Annotated[str, arg(metavar="NAME,NAME")] = _FORMATS
    """Formats to write."""
    out: Annotated[Path | None, arg(metavar="FOLDER", help_behavior_hint="")] = None
    """Where to write. Left out: into RESULT, where an earlier export is replaced."""
    overwrite: bool = False
    """Replace files of the same names in FOLDER."""

    def run(self) -> int:
        """Exports."""
        from calib.errors import InputError
        from voxelpose.export.formats import export_motion
        from voxelpose.results import Result

        formats = [name.strip().lower() for name in self.to.split(",") if name.strip()]
        if not formats:
            raise InputError(f"--to names no format: give some of {_FORMATS}")
        motion = Result.open(self.result).motion
        for path in export_motion(
            motion, self.out or self.result, formats, self.overwrite or self.out is None
        ):
            print(path)
        return 0
