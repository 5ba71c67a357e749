"""voxelpose export."""

from __future__ import annotations

import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from calib.errors import InputError
from voxelpose.cli import arguments
from voxelpose.cli.terminal import message

if TYPE_CHECKING:
    from silhouette_core.motion.motion import Motion

_FORMATS = "bvh,glb,trc,c3d,csv,npz"


@dataclass(frozen=True)
class Export:
    """Writes a result in the formats of other programs.

      bvh  motion.bvh: skeleton, for Blender, Maya, MotionBuilder
      glb  motion.glb: animated body, for Blender, three.js, game engines
      trc  motion.trc, motion.mot: points and joint coordinates, for OpenSim
      opensim  opensim_*: setup files that scale a model and run inverse kinematics
      c3d  motion.c3d: points, for motion capture software and MATLAB
      csv  joints.csv, joints_wide.csv, angles.csv: positions and anatomical angles
      npz  motion.npz: all data as NumPy arrays
      html  motion.html: a page that plays bodies and cameras, without a server

      voxelpose export walk_fit
      voxelpose export walk_fit --to glb,csv --out for_the_lab
      voxelpose export walk_fit --to html
      voxelpose export walk_fit --to opensim --out for_opensim
      voxelpose export walk_fit --to trc --out at_12_hz --filter butterworth --cutoff 12

    Filter and gaps are those of the result; any of --filter, --cutoff, --filter-order, --gap-limit
    and --gap-method makes the files, not the result, from its unfiltered poses. export.json says
    how. Of several people person_1 and so on receive a file each; motion.glb and motion.html hold
    all of them.
    """

    result: Annotated[Positional[Path], arg(metavar="RESULT")]
    """Folder of a result."""
    to: Annotated[str, arg(metavar="NAME,NAME")] = _FORMATS
    """Formats to write: of those above; by default all but html and opensim."""
    out: Annotated[Path | None, arguments.optional("FOLDER")] = None
    """Folder to write to. Default: RESULT, where an earlier export is replaced."""
    overwrite: bool = False
    """Replace files of the same names in FOLDER."""
    filter: Annotated[
        Literal["butterworth", "savgol", "gaussian", "none"] | None, arg(help_behavior_hint="")
    ] = None
    """Another low-pass filter than the result's."""
    cutoff: Annotated[float | None, arguments.optional("HZ")] = None
    """Another cut-off."""
    filter_order: Annotated[int | None, arguments.optional("N")] = None
    """Another order of the filter."""
    gap_limit: Annotated[str | None, arguments.optional("N|SECONDSs")] = None
    """Another longest gap that is filled, frames or seconds."""
    gap_method: Annotated[Literal["linear", "pchip", "none"] | None, arg(help_behavior_hint="")] = (
        None
    )
    """Another method of filling gaps."""

    def run(self) -> None:
        """Writes the files and prints their names."""
        from voxelpose.export.formats import export_motion
        from voxelpose.export.player_scene import Stage
        from voxelpose.results import open_people

        formats = [name.strip().lower() for name in self.to.split(",") if name.strip()]
        if not formats:
            raise InputError(f"--to names no format: give some of {_FORMATS}")
        results = open_people(self.result)
        motions = [self._conditioned(one.motion) for one in results]
        overwrite, first = self.overwrite or self.out is None, results[0]
        stage = Stage.from_cameras(self.result.resolve().name, first.rig, first.motion)
        for path in export_motion(motions, self.out or self.result, formats, overwrite, stage):
            print(path)

    def _conditioned(self, motion: Motion) -> Motion:
        """The motion with another filter, where one is asked for."""
        from silhouette_core.motion.conditioning import Conditioning, conditioned, filter_warning

        asked = {
            "filter": self.filter,
            "cutoff_hz": self.cutoff,
            "filter_order": self.filter_order,
            "gap_limit": self.gap_limit,
            "gap_method": self.gap_method,
        }
        asked = {name: value for name, value in asked.items() if value is not None}
        if not asked:
            return motion
        if motion.conditioning is None:
            raise InputError(
                f"{self.result} does not record its filter, nor its unfiltered poses, as results of"
                " earlier versions do not: fit again, or leave out --filter, --cutoff,"
                " --filter-order, --gap-limit and --gap-method"
            )
        usual = asdict(motion.conditioning)
        if "filter" in asked and asked["filter"] != usual["filter"]:
            usual["filter_order"] = None  # that of another filter
        motion = conditioned(motion, Conditioning(**usual | asked))
        if warning := filter_warning(motion):
            print(f"note: {message(warning)}", file=sys.stderr)
        return motion
