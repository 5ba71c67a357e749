"""voxelpose fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from tyro.conf import arg

from voxelpose.cli.arguments import Cameras, OptionalLength, camera_names
from voxelpose.cli.estimation import EstimationArguments


@dataclass(frozen=True, kw_only=True)
class Fit(EstimationArguments):
    """Arguments of `voxelpose fit`."""

    help: ClassVar[str] = """Estimates the motion of a person from several cameras.

RECORDING holds a video per camera, calibration.toml and, if possible, background/ with videos or
images of the empty view. OUT receives joints.csv, motion.bvh, motion.safetensors, summary.json,
overlay videos and contact_sheet.png.

  voxelpose fit walk --out walk_fit --stature 1.75
  voxelpose fit walk --out walk_fit --frames 0:100 --overwrite
  voxelpose fit walk --out walk_fit --filter savgol --cutoff 10 --gap-limit 0.2s
  voxelpose fit run --out run_fit --body walk_fit
  voxelpose fit run --out run_fit --body 92A5
  voxelpose fit walk --out walk_fit --segmenter selfie_segmentation.tflite
"""

    cameras: Cameras = None
    interference: bool = True
    """Match body parts jointly where their movable areas overlap; else one after the other."""
    voxel: OptionalLength = None
    """Edge of a voxel in metres. Default: chosen by the program."""
    tolerance: Annotated[int, arg(metavar="N")] = 0
    """Number of cameras that may see background where the body is; 1 tolerates one bad camera."""
    repair: Literal["auto", "say", "off"] = "auto"
    """Cameras that were turned or come late, by the silhouettes: put right where that is sure, only
    say so, or do not look."""
    estimator: Annotated[str, arg(metavar="NAME")] = "multiview"
    """Estimator to run; `voxelpose doctor` lists those that are installed."""

    def run(self) -> int:
        """Estimates the motion; returns the exit code."""
        options: dict[str, bool | int | float | str] = {}
        if not self.interference:
            options["interference"] = False
        if self.voxel is not None:
            options["voxel_size_m"] = self.voxel
        if self.tolerance:
            options["tolerance"] = self.tolerance
        if self.repair != "auto":
            options["repair"] = self.repair
        return self.estimate(camera_names(self.cameras), options, self.estimator)
