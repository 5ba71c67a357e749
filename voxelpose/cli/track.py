"""voxelpose track."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from tyro.conf import Positional, arg

from voxelpose.cli.arguments import frame_range


@dataclass(frozen=True)
class Track:
    """The arguments of `voxelpose track`."""

    help: ClassVar[
        str
    ] = """Follows one person in the pictures of one camera and writes the motion, as `voxelpose fit` does for several.

RECORDING holds a video per camera and, best, calibration.toml and background/ with the empty view.
Without a calibration a usual camera is assumed; without a library one is made from the program's own motions at first use.
OUT gets what a fit gives, and hypotheses.csv: the five likeliest poses of every frame with their probabilities.

  voxelpose track walk --camera cam_1 --out walk_track --stature 1.75
  voxelpose track walk --camera cam_1 --library dancers.vplib --start any --out walk_track
"""

    recording: Annotated[Positional[Path], arg(metavar="RECORDING")]
    """Recording folder."""
    out: Annotated[Path, arg(metavar="OUT")]
    """Folder to be made for the results."""
    camera: Annotated[str, arg(metavar="NAME")]
    """Which camera's pictures."""
    library: Annotated[Path | None, arg(metavar="LIB", help_behavior_hint="")] = None
    """Pose library, from `voxelpose library build`. Left out: the default one."""
    stature: Annotated[float | None, arg(metavar="M", help_behavior_hint="")] = None
    """Height of the person in metres. Left out: subject.toml's, else 1.70; all lengths grow with
    it.
    """
    chest: Annotated[float | None, arg(metavar="M", help_behavior_hint="")] = None
    """Chest girth in metres. Left out: subject.toml's, else usual for the stature."""
    sex: Literal["male", "female", "unknown"] = "unknown"
    """Whose proportions."""
    start: Literal["facing", "any"] = "facing"
    """What is believed of the first frame: upright and mostly facing the camera, or nothing."""
    frames: Annotated[str | None, arg(metavar="A:B", help_behavior_hint="")] = None
    """First frame and one past the last. Left out: all."""
    unit: Annotated[
        Literal["m", "cm", "mm"] | None, arg(metavar="m|cm|mm", help_behavior_hint="")
    ] = None
    """Unit of the calibration's lengths, where the file does not say it."""
    fps: Annotated[float | None, arg(metavar="N", help_behavior_hint="")] = None
    """Frames per second, where the recording does not say it or says it wrongly."""
    overwrite: bool = False
    """Replace an earlier result in OUT, once the new one is whole."""
    smooth: bool = True
    """Look ahead: the likeliest course through the whole video, smoothed. --no-smooth decides every
    frame from the past alone.
    """
    refine: bool = True
    """Recombine limbs and draw the body onto the contour; --no-refine gives the library's poses as
    they are.
    """
    weighting: Literal["balanced", "xor", "wxor", "nwxor"] = "balanced"
    """How disagreeing pixels are weighed: Okada and Stenger's eq. (6), (7)-(8), (9), or (9) with
    the outside weighed as the inside.
    """
    motion_model: Literal["DM1", "DM2"] = "DM2"
    """DM2 lets hidden parts move farther, DM1 does not."""
    background: Literal["refined", "paper"] = "refined"
    """How silhouettes are found: Okada and Stenger 5.1 as written, or refined against shadows and
    noise.
    """
    threads: Annotated[int | None, arg(metavar="N", help_behavior_hint="")] = None
    """Processor threads. Left out: all."""
    pictures: bool = True
    """Draw the overlay video and the contact sheet."""

    def run(self) -> int:
        """HypothesisTracker."""
        from voxelpose.cli.progress import Progress

        with Progress() as progress:
            progress.note_compilation()
            progress.stage("opening")
            from silhouette_core.estimator import Settings
            from voxelpose.fitting import Output, track
            from voxelpose.recording.folder import Recording

            options: dict[str, bool | int | float | str] = {
                "start": self.start,
                "refine": self.refine,
                "weighting": self.weighting,
                "motion_model": self.motion_model,
            }
            if self.library is not None:
                options["library"] = str(self.library)
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
                self.recording, frame_range(self.frames), (self.camera,), self.unit, self.fps
            )
            if recording.calibration_path is None:
                progress.note(
                    f"{self.recording} holds no calibration: a level camera of 53 degrees is"
                    " assumed, and distances are guesses"
                )
            result = track(
                recording, Output(self.out, self.overwrite, self.pictures), settings, progress
            )
        from voxelpose.cli.summary import print_result

        print_result(result)
        return 0
