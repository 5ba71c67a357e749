"""voxelpose library build and info."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, UseAppendAction, arg

from voxelpose.cli import arguments
from voxelpose.cli.terminal import Progress


@dataclass(frozen=True)
class Build:
    """Builds a pose library from motion capture, for one body.

    MOTION are BVH files, exponential-map files, or folders of them; with the --body of a robot or
    an animal, results or motion files of that body. An interrupted build resumes when the same
    command is run again.

      voxelpose library build mocap --out me.vplib --stature 1.75
      voxelpose library build mocap --out all.vplib --stature 1.75 --leave-out 007_01 --poses 60000
      voxelpose library build mocap --out man.vplib --body 92A5
      voxelpose library build arm_fit --out arm.vplib --body arm.urdf --pitch 20
    """

    motion: Annotated[
        Positional[tuple[Path, ...]], arg(metavar="MOTION...", help_behavior_hint="(required)")
    ]
    """Motion capture files, or folders of them."""
    out: Annotated[Path, arg(metavar="LIB")]
    """File to be made. An earlier library of this name is replaced once the new one is complete."""
    stature: Annotated[float, arg(metavar="M")] = 1.75
    """Height of the person in metres, unless --body states it."""
    chest: arguments.OptionalLength = None
    """Chest girth in metres. Default: average for the stature."""
    sex: arguments.Sex = "unknown"
    body: arguments.BodyName = None
    poses: Annotated[int, arg(metavar="N")] = 60000
    """Maximum number of samples: poses times views. Similar poses are left out until it is met."""
    yaw_step: Annotated[float, arg(metavar="DEG")] = 15.0
    """Angle between the views of a pose, around the vertical axis."""
    pitch: Annotated[UseAppendAction[tuple[float, ...]], arg(metavar="DEG")] = ()
    """Angle by which the camera looks down; may be given several times. Default: 8."""
    mirror: bool = True
    """Add the mirror image of every pose."""
    names: Annotated[Path | None, arguments.optional("MAP.toml")] = None
    """Names of the joints, for a skeleton whose names are not recognised."""
    leave_out: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME")] = ()
    """Clip that is not used, by the name of its file; may be given several times."""
    threads: arguments.Threads = None

    def run(self) -> None:
        """Builds the library."""
        with Progress() as progress:
            progress.note_compilation()
            progress.stage("opening")
            from silhouette_core.body.model import BodyModel
            from silhouette_core.body.sizes import BodySizes
            from silhouette_core.jit import set_threads
            from silhouette_core.monocular.making.from_motion import make_library, read_clips
            from silhouette_core.monocular.making.learning_settings import LearningSettings
            from silhouette_core.monocular.proposal.shipped import shipped_proposal
            from silhouette_core.monocular.tree.pose_library import LibrarySettings
            from silhouette_core.motion.body_source import load_body

            set_threads(self.threads)
            settings = LibrarySettings(
                poses=self.poses,
                yaw_step_deg=self.yaw_step,
                pitches_deg=self.pitch or LibrarySettings.pitches_deg,
                mirror=self.mirror,
            )
            model = (
                BodyModel.from_sizes(BodySizes(self.stature, self.chest, self.sex))
                if self.body is None
                else load_body(self.body)
            )
            clips = read_clips(self.motion, model, self.names, self.leave_out, progress)
            learning, proposal = LearningSettings.of_begun(), shipped_proposal()
            library = make_library(clips, model, self.out, settings, progress, learning, proposal)
        from silhouette_core.monocular.tree.summary import summary

        print(summary(library, self.out))


@dataclass(frozen=True)
class Info:
    """
    Describes a pose library.

    Its size, its poses and its body are printed.

      voxelpose library info me.vplib
      voxelpose library info me.vplib --png sheet.png
    """

    library: Annotated[Positional[Path], arg(metavar="LIB")]
    """The library."""
    png: arguments.OptionalFile = None
    """PNG to be written: a contact sheet of its silhouettes."""

    def run(self) -> None:
        """Prints the description."""
        from silhouette_core.monocular.tree.store import read_library
        from silhouette_core.monocular.tree.summary import summary

        library = read_library(self.library)
        print(summary(library, self.library))
        if self.png is not None:
            from silhouette_core.monocular.tree.summary import write_sheet

            write_sheet(library, self.png)
            print(f"contact sheet: {self.png}")


SUBCOMMANDS = {"build": Build, "info": Info}
