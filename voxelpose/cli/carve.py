"""voxelpose carve."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import arg

from silhouette_core import setting_types
from voxelpose.cli import arguments


@dataclass(frozen=True)
class Carve:
    """
    Carves the visual hull of one frame and writes it as a PLY file.

    Its volume is printed, and the number and the size of its voxels.

      voxelpose carve walk --frame 40 --out hull.ply
      voxelpose carve walk --frame 40 --out hull.ply --voxel 0.01 --style voxels
    """

    recording: arguments.RecordingFolder
    out: Annotated[Path, arg(metavar="FILE")]
    """PLY file to be written, in metres."""
    frame: Annotated[int, arg(metavar="N")] = 0
    """Number of the frame."""
    voxel: arguments.OptionalLength = None
    """Edge of a voxel in metres. Default: the volume's longest edge divided by --resolution."""
    resolution: Annotated[int, arg(metavar="N")] = 192
    """Number of voxels along the longest edge of the volume."""
    volume: Annotated[
        tuple[float, float, float, float, float, float] | None, arguments.optional("X Y Z X Y Z")
    ] = None
    """Minimum and maximum corner of the volume, metres. Default: from the silhouettes."""
    tolerance: Annotated[setting_types.Tolerance, arg(metavar="N")] = 0
    """Number of cameras that may see background where a voxel is kept."""
    outside: Literal["keep", "carve"] = "keep"
    """Whether a voxel outside a camera's image is kept."""
    style: Literal["surface", "voxels"] = "surface"
    """Triangle mesh, or centres of the voxels as points."""
    cameras: arguments.Cameras = None
    unit: arguments.Unit = None
    label: arguments.Label = None
    overwrite: arguments.OverwriteFile = False

    def run(self) -> None:
        """Carves the frame."""
        from voxelpose.hull import CarveSettings, carve_recording
        from voxelpose.multiview.carving.carver import CarveRule

        settings = CarveSettings(
            frame=self.frame,
            voxel_size_m=self.voxel,
            resolution=self.resolution,
            volume_m=self.volume,
            rule=CarveRule(self.tolerance, self.outside),
            style=self.style,
            cameras=arguments.camera_names(self.cameras),
            unit=self.unit,
            label=self.label,
        )
        hull = carve_recording(self.recording, self.out, settings, self.overwrite)
        for words in hull.notes:
            print(f"note: {words}")
        if hull.without_background:
            print(
                f"no empty view of {', '.join(hull.without_background)}: it was estimated"
                " from the recording's own frames"
            )
        shape = " x ".join(str(n) for n in hull.grid.shape)
        print(
            f"{self.out}: {hull.volume_l:.1f} litres, {int(hull.occupancy.sum())} of {shape} voxels"
            f" of {hull.grid.voxel_size_m:.4g} m"
        )
