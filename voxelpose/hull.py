"""Visual hull of one frame of a recording folder."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from calib.errors import InputError
from silhouette_core.image.silhouettes import Silhouettes
from voxelpose.multiview.carving.bounds import (
    check_tolerance,
    grid_within,
    place_grid,
    require_foreground,
)
from voxelpose.multiview.carving.carver import CarveRule, carve
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.hull_mesh import write_ply
from voxelpose.recording.folder import Recording


@dataclass(frozen=True)
class CarveSettings:
    """Settings of carving a frame and writing its hull."""

    frame: int = 0  #: Number of the frame.
    voxel_size_m: float | None = None
    """Edge of a voxel, m; None divides the volume's longest edge by `resolution`."""
    resolution: int = 192  #: Voxels along the longest edge where no size is given.
    volume_m: tuple[float, float, float, float, float, float] | None = None
    """Low corner x, y, z and high corner x, y, z, world, m; None finds the volume."""
    rule: CarveRule = field(default_factory=CarveRule)
    """Condition under which a voxel is occupied."""
    style: Literal["surface", "voxels"] = "surface"
    """"surface" writes a triangle mesh, "voxels" the centres of the occupied voxels."""
    cameras: tuple[str, ...] | None = None  #: Names of the cameras to use; None means all.
    unit: str | None = None  #: Unit of the calibration's lengths where its file does not say.
    label: str | None = None  #: Labels of the person in masks/; None finds them.

    def __post_init__(self) -> None:
        if self.frame < 0:
            raise InputError(f"frame {self.frame} is impossible: the first is 0")
        if self.voxel_size_m is not None and not (
            np.isfinite(self.voxel_size_m) and self.voxel_size_m > 0
        ):
            raise InputError(
                f"voxels of {self.voxel_size_m:g} m are impossible: give a positive size"
            )
        if self.resolution < 1:
            raise InputError(
                f"a resolution of {self.resolution} voxels is impossible: give at least 1"
            )


@dataclass(frozen=True, eq=False)
class Hull:
    """A carved frame."""

    grid: VoxelGrid  #: Positions of the voxels.
    occupancy: NDArray[np.bool_]  #: (nx, ny, nz) bool.
    rig: Rig  #: The cameras used.
    masks: dict[str, NDArray[np.bool_]]  #: (h, w) bool by camera name.
    without_background: tuple[str, ...] = ()
    """Cameras without frames of the empty scene, whose background was estimated from the recording
    itself."""
    notes: tuple[str, ...] = ()  #: What is worth telling about the recording's files.

    @property
    def volume_l(self) -> float:
        """Volume of the occupied voxels, litres."""
        return float(np.count_nonzero(self.occupancy)) * self.grid.voxel_size_m**3 * 1000


def carve_recording(
    folder: Path | str,
    out: Path | str | None = None,
    settings: CarveSettings | None = None,
    overwrite: bool = False,
) -> Hull:
    """Visual hull of one frame of a recording, written to a file if one is named.

    Args:
        folder: The recording folder; see docs/recordings.md.
        out: PLY file to write; None writes nothing.
        settings: Frame, volume, resolution and rule.
        overwrite: Whether `out` may exist.

    Raises:
        InputError: Input is missing or inconsistent, or no voxel is occupied; nothing is written.
    """
    settings = settings or CarveSettings()
    if out is not None and Path(out).exists() and not overwrite:
        raise InputError(f"{out} exists: choose another name, or say --overwrite")
    cameras = None if settings.cameras is None else list(settings.cameras)
    # A single frame needs no frame rate: any value does for folders of images.
    recording = Recording.open(
        folder, (settings.frame, settings.frame + 1), cameras, settings.unit, 1.0, settings.label
    )
    silhouettes = Silhouettes(recording)
    _, _, frames = next(iter(recording))
    rig, masks = recording.rig, silhouettes.of(frames)
    unknown = silhouettes.unknown_of(rig.names)
    if settings.volume_m is None:
        voxel_size_m, resolution = settings.voxel_size_m, settings.resolution
        grid = place_grid(rig, masks, voxel_size_m, resolution, settings.rule, unknown)
    else:
        check_tolerance(settings.rule.tolerance, len(rig))
        require_foreground(rig, [masks[name] for name in rig.names], settings.rule.tolerance)
        low, high = np.array(settings.volume_m[:3]), np.array(settings.volume_m[3:])
        grid = grid_within(
            low,
            high,
            settings.voxel_size_m or max(float((high - low).max()), 1e-9) / settings.resolution,
        )
    occupancy = carve(rig, masks, grid, settings.rule, unknown)
    if not occupancy.any():
        raise InputError(
            "no voxel is left: choose smaller voxels, another volume, or tolerate a bad camera"
            " (--tolerance 1)"
        )
    if out is not None:
        write_ply(out, grid, occupancy, settings.style)
    return Hull(grid, occupancy, rig, masks, silhouettes.without_background, recording.notes)
