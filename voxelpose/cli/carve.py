"""voxelpose carve."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from tyro.conf import Positional, arg

from calib.errors import InputError
from voxelpose.cli.arguments import camera_names


@dataclass(frozen=True)
class Carve:
    """The arguments of `voxelpose carve`."""

    help: ClassVar[
        str
    ] = """Carves one frame of a recording: the visual hull of its silhouettes, as a PLY file.

  voxelpose carve walk --frame 40 --out hull.ply
  voxelpose carve walk --frame 40 --out hull.ply --voxel 0.01 --style voxels
"""

    recording: Annotated[Positional[Path], arg(metavar="RECORDING")]
    """Recording folder."""
    out: Annotated[Path, arg(metavar="FILE")]
    """PLY file to be written, in metres."""
    frame: Annotated[int, arg(metavar="N")] = 0
    """Number of the frame."""
    voxel: Annotated[float | None, arg(metavar="M", help_behavior_hint="")] = None
    """Edge of a voxel in metres. Left out: the volume's longest edge over --resolution."""
    resolution: Annotated[int, arg(metavar="N")] = 192
    """Voxels along the longest edge of the volume."""
    volume: Annotated[
        tuple[float, float, float, float, float, float] | None,
        arg(metavar="X Y Z X Y Z", help_behavior_hint=""),
    ] = None
    """Low and high corner of the volume in the world, metres. Left out: found from the silhouettes."""
    tolerance: Annotated[int, arg(metavar="N")] = 0
    """How many cameras may see background where a voxel stays."""
    outside: Literal["keep", "carve"] = "keep"
    """Whether a voxel outside a camera's picture may stay."""
    style: Literal["surface", "voxels"] = "surface"
    """A triangle mesh, or the centres of the voxels as points."""
    cameras: Annotated[str | None, arg(metavar="NAME,NAME", help_behavior_hint="")] = None
    """Cameras to use, by name. Left out: all."""
    unit: Annotated[
        Literal["m", "cm", "mm"] | None, arg(metavar="m|cm|mm", help_behavior_hint="")
    ] = None
    """Unit of the calibration's lengths, where the file does not say it."""
    overwrite: bool = False
    """Replace FILE if it exists."""

    def run(self) -> int:
        """Carves."""
        from voxelpose.carving.carver import CarveRule
        from voxelpose.carving.hull import CarveSettings, carve_recording

        if self.tolerance < 0:
            raise InputError(f"--tolerance {self.tolerance} is impossible: give 0 or more cameras")
        settings = CarveSettings(
            frame=self.frame,
            voxel_size_m=self.voxel,
            resolution=self.resolution,
            volume_m=self.volume,
            rule=CarveRule(self.tolerance, self.outside),
            style=self.style,
            cameras=camera_names(self.cameras),
            unit=self.unit,
        )
        hull = carve_recording(self.recording, self.out, settings, self.overwrite)
        if hull.without_background:
            print(
                f"no empty view of {', '.join(hull.without_background)}: the temporal median served"
                " as background"
            )
        shape = " x ".join(str(n) for n in hull.grid.shape)
        print(
            f"{self.out}: {hull.volume_l:.1f} litres, {int(hull.occupancy.sum())} of {shape} voxels"
            f" of {hull.grid.voxel_size_m:.4g} m"
        )
        return 0
