"""voxelpose export."""

from __future__ import annotations

import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from msgspec import Meta
from tyro.conf import Positional, arg

from calib.errors import InputError
from silhouette_core import setting_types
from voxelpose.cli import arguments
from voxelpose.cli.terminal import message

if TYPE_CHECKING:
    from silhouette_core.motion.motion import Motion

_FORMATS = "bvh,glb,trc,c3d,csv,npz"
_APART = "export"  # folder in a result of files that do not hold it as it is


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
      fbx  to_fbx.py makes FBX of motion.glb in Blender; run if Blender is there

      voxelpose export walk_fit
      voxelpose export walk_fit --to glb,csv --out for_the_lab
      voxelpose export walk_fit --to html
      voxelpose export walk_fit --to opensim --out for_opensim
      voxelpose export walk_fit --to trc --out at_12_hz --filter butterworth --cutoff 12
      voxelpose export walk_fit --to bvh,glb --skeleton mixamo --frames 10:90 --rate 30

    Filter and gaps are those of the result; any of --filter, --cutoff, --filter-order, --gap-limit
    and --gap-method makes the files, not the result, from its unfiltered poses. export.json says
    how. Of several people person_1 and so on receive a file each; motion.glb and motion.html hold
    all of them. RESULT/person_1 is that person alone.
    """

    result: Annotated[Positional[Path], arg(metavar="RESULT")]
    """Folder of a result."""
    to: Annotated[str, arg(metavar="NAME,NAME")] = _FORMATS
    """Formats to write: of those above; by default all but html, opensim and fbx."""
    out: Annotated[Path | None, arguments.optional("FOLDER")] = None
    """Folder to write to. Default: RESULT, or RESULT/export for some frames, another rate, place or
    skeleton; an earlier export there is replaced."""
    overwrite: bool = False
    """Replace files of the same names in FOLDER."""
    frames: arguments.Frames = None
    rate: Annotated[Annotated[float, Meta(ge=1, le=1000)] | None, arguments.optional("HZ")] = None
    """Another frame rate than the recording's."""
    in_place: bool = False
    """Keep the body above the origin, as if it moved on the spot."""
    skeleton: setting_types.SkeletonName = "voxelpose"
    """Names, axes and rest pose of BVH, GLB and FBX: as ours, or as another program expects."""
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

    groups: ClassVar[dict[str, str]] = {
        "basic": "result to out overwrite frames rate in_place skeleton",
        "output": "filter cutoff filter_order gap_limit gap_method",
    }

    def run(self) -> None:
        """Writes the files and prints their names."""
        paths, notes = self.write()
        for path in paths:
            print(path)
        for note in notes:
            print(f"note: {message(note)}", file=sys.stderr)

    def write(self) -> tuple[list[Path], list[str]]:
        """Writes the files; returns their paths, and notes. InputError where that cannot be."""
        from voxelpose.export.excerpt import Excerpt
        from voxelpose.export.formats import export_motion
        from voxelpose.export.player_scene import Stage
        from voxelpose.recording.folder import frame_range
        from voxelpose.results import names_of, open_people

        formats = [name.strip().lower() for name in self.to.split(",") if name.strip()]
        if not formats:
            raise InputError(f"--to names no format: give some of {_FORMATS}")
        results, notes = open_people(self.result), list[str]()
        motions = [self._conditioned(one.motion, notes) for one in results]
        excerpt = Excerpt(frame_range(self.frames), self.rate, self.in_place, self.skeleton)
        out = self.out or (self.result if excerpt == Excerpt() else self.result / _APART)
        overwrite, first = self.overwrite or self.out is None, results[0]
        stage = Stage.from_cameras(self.result.resolve().name, first.rig, first.motion)
        stage = replace(stage, people=tuple(names_of(results)))
        return export_motion(motions, out, formats, overwrite, stage, excerpt, notes), notes

    def _conditioned(self, motion: Motion, notes: list[str]) -> Motion:
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
            notes.append(warning)
        return motion
