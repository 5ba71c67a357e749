"""voxelpose fit."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from tyro.conf import Positional, arg

from voxelpose.cli.arguments import camera_names, frame_range


@dataclass(frozen=True)
class Fit:
    """The arguments of `voxelpose fit`."""

    help: ClassVar[str] = """Fits a body to every frame of a recording and writes its motion.

RECORDING holds a video per camera, calibration.toml and, best, background/ with the empty view.
OUT gets joints.csv, motion.bvh, motion.safetensors, summary.json, overlay videos and contact_sheet.png.

  voxelpose fit walk --out walk_fit --stature 1.75
  voxelpose fit walk --out walk_fit --frames 0:100 --overwrite
"""

    recording: Annotated[Positional[Path], arg(metavar="RECORDING")]
    """Recording folder."""
    out: Annotated[Path, arg(metavar="OUT")]
    """Folder to be made for the results."""
    stature: Annotated[float | None, arg(metavar="M", help_behavior_hint="")] = None
    """Height of the person in metres. Left out: subject.toml's, else estimated."""
    chest: Annotated[float | None, arg(metavar="M", help_behavior_hint="")] = None
    """Chest girth in metres. Left out: subject.toml's, else usual for the stature."""
    sex: Literal["male", "female", "unknown"] = "unknown"
    """Whose proportions."""
    frames: Annotated[str | None, arg(metavar="A:B", help_behavior_hint="")] = None
    """First frame and one past the last. Left out: all."""
    cameras: Annotated[str | None, arg(metavar="NAME,NAME", help_behavior_hint="")] = None
    """Cameras to use, by name. Left out: all."""
    unit: Annotated[
        Literal["m", "cm", "mm"] | None, arg(metavar="m|cm|mm", help_behavior_hint="")
    ] = None
    """Unit of the calibration's lengths, where the file does not say it."""
    fps: Annotated[float | None, arg(metavar="N", help_behavior_hint="")] = None
    """Frames per second, where the recording does not say it or says it wrongly."""
    overwrite: bool = False
    """Replace an earlier result in OUT, once the new one is whole."""
    interference: bool = True
    """Match body parts whose movable areas overlap at once; --no-interference matches one after the
    other.
    """
    smooth: bool = True
    """Smooth the motion over time, without lag."""
    background: Literal["refined", "paper"] = "refined"
    """How silhouettes are found: Okada and Stenger 5.1 as written, or refined against shadows and
    noise.
    """
    voxel: Annotated[float | None, arg(metavar="M", help_behavior_hint="")] = None
    """Edge of a voxel in metres. Left out: chosen by the program."""
    tolerance: Annotated[int, arg(metavar="N")] = 0
    """How many cameras may see background where there is body: 1 forgives one bad camera."""
    threads: Annotated[int | None, arg(metavar="N", help_behavior_hint="")] = None
    """Processor threads. Left out: all."""
    estimator: Annotated[str, arg(metavar="NAME")] = "multiview"
    """Which of the installed estimators runs."""
    pictures: bool = True
    """Draw the overlay videos and the contact sheet."""

    def run(self) -> int:
        """Fits."""
        from voxelpose.cli.progress import Progress

        with Progress() as progress:
            progress.note_compilation()
            progress.stage("opening")
            from silhouette_core.estimator import Settings
            from voxelpose.fitting import Output, fit
            from voxelpose.recording.folder import Recording

            options: dict[str, bool | int | float | str] = {}
            if not self.interference:
                options["interference"] = False
            if self.voxel is not None:
                options["voxel_size_m"] = self.voxel
            if self.tolerance:
                options["tolerance"] = self.tolerance
            settings = Settings(
                self.stature,
                self.chest,
                self.sex,
                self.background,
                self.smooth,
                self.threads,
                options,
            )
            recording = Recording.open(
                self.recording,
                frame_range(self.frames),
                camera_names(self.cameras),
                self.unit,
                self.fps,
            )
            result = fit(
                recording,
                Output(self.out, self.overwrite, self.pictures),
                settings,
                self.estimator,
                progress,
            )
        from voxelpose.cli.summary import print_result

        print_result(result)
        return 0
