"""voxelpose library build, voxelpose library info."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from tyro.conf import Positional, UseAppendAction, arg


@dataclass(frozen=True)
class Build:
    """The arguments of `voxelpose library build`."""

    help: ClassVar[
        str
    ] = """Makes a pose library and its silhouette tree from recorded motion, once per body.

MOTION are BVH files, exponential-map files, or folders of them. Interrupted, it goes on where it was when it is called again.

  voxelpose library build mocap --out me.vplib --stature 1.75
  voxelpose library build mocap --out all.vplib --stature 1.75 --leave-out 007_01 --poses 60000
"""

    motion: Annotated[Positional[tuple[Path, ...]], arg(metavar="MOTION...")]
    """Recorded motion: files, or folders of them."""
    out: Annotated[Path, arg(metavar="LIB")]
    """File to be made. An earlier library of this name is replaced once the new one is whole; an
    interrupted build goes on where it was.
    """
    stature: Annotated[float, arg(metavar="M")] = 1.75
    """Height of the person in metres."""
    chest: Annotated[float | None, arg(metavar="M", help_behavior_hint="")] = None
    """Chest girth in metres. Left out: usual for the stature."""
    sex: Literal["male", "female", "unknown"] = "unknown"
    """Whose proportions."""
    poses: Annotated[int, arg(metavar="N")] = 60000
    """How many poses, seen from all sides, at most. Recorded poses that differ little are left out
    until it fits.
    """
    yaw_step: Annotated[float, arg(metavar="DEG")] = 15.0
    """Angle between the sides from which a pose is seen."""
    pitch: Annotated[UseAppendAction[tuple[float, ...]], arg(metavar="DEG")] = ()
    """How far the camera looks down; may be given several times. Left out: 8."""
    mirror: bool = True
    """Add the mirror image of every pose."""
    weighting: Literal["xor", "wxor", "nwxor", "balanced"] = "xor"
    """Silhouette distance by which the tree is made: Okada and Stenger's eq. (6), (7)-(8) or (9),
    or ours. Tracking may use another.
    """
    names: Annotated[Path | None, arg(metavar="MAP.toml", help_behavior_hint="")] = None
    """Whose joint is which, for a skeleton with names of its own."""
    leave_out: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME")] = ()
    """A clip not to be used, by its file's name; may be given several times."""
    threads: Annotated[int | None, arg(metavar="N", help_behavior_hint="")] = None
    """Processor threads. Left out: all."""

    def run(self) -> int:
        """Builds."""
        from voxelpose.cli.progress import Progress

        with Progress() as progress:
            progress.note_compilation()
            progress.stage("opening")
            from silhouette_core.body.model import BodyModel
            from silhouette_core.body.sizes import BodySizes
            from silhouette_core.jit import set_threads
            from silhouette_core.library.from_motion import make_library, read_clips
            from silhouette_core.library.pose_library import LibrarySettings

            set_threads(self.threads)
            pitches = self.pitch or LibrarySettings.pitches_deg
            settings = LibrarySettings(
                poses=self.poses,
                yaw_step_deg=self.yaw_step,
                pitches_deg=pitches,
                mirror=self.mirror,
                weighting=self.weighting,
            )
            model = BodyModel.from_sizes(BodySizes(self.stature, self.chest, self.sex))
            clips = read_clips(self.motion, model, self.names, self.leave_out, progress)
            library = make_library(clips, model, self.out, settings, progress)
        from silhouette_core.library.summary import summary

        print(summary(library, self.out))
        return 0


@dataclass(frozen=True)
class Info:
    """The arguments of `voxelpose library info`."""

    help: ClassVar[str] = """Says what a pose library holds.

  voxelpose library info me.vplib
  voxelpose library info me.vplib --png sheet.png
"""

    library: Annotated[Positional[Path], arg(metavar="LIB")]
    """The library."""
    png: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None
    """Also draw a contact sheet of its silhouettes."""

    def run(self) -> int:
        """Tells."""
        from silhouette_core.library.store import read_library
        from silhouette_core.library.summary import summary

        library = read_library(self.library)
        print(summary(library, self.library))
        if self.png is not None:
            from silhouette_core.library.tree_sheet import write_sheet

            write_sheet(library, self.png)
            print(f"contact sheet: {self.png}")
        return 0


SUBCOMMANDS = {"build": Build, "info": Info}
