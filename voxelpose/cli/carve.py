"""voxelpose carve."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from silhouette_core import setting_types
from voxelpose.cli import arguments


@dataclass(frozen=True)
class Carve:
    """
    Carves the visual hull of one frame and writes it as a PLY file.

    Its volume is printed, and the number and the size of its voxels.

      voxelpose carve walk --frame 40 --out hull.ply
      voxelpose carve walk --frame 40 --out hull.ply --voxel 0.01
    """

    recording: arguments.RecordingFolder
    out: Annotated[Path, arg(metavar="FILE")]
    """PLY file to be written, in metres."""
    frame: Annotated[int, arg(metavar="N")] = 0
    """Number of the frame."""
    voxel: arguments.OptionalLength = None
    """Edge of a voxel in metres. Default: a 192th of the hull's longest edge."""
    tolerance: Annotated[setting_types.Tolerance, arg(metavar="N")] = 0
    """Number of cameras that may see background where a voxel is kept."""
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
            rule=CarveRule(self.tolerance),
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
