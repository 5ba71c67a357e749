"""Visual hull of one frame of a recording folder."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from calib.errors import InputError
from silhouette_core.image.silhouettes import Silhouettes
from voxelpose.multiview.carving.bounds import place_grid
from voxelpose.multiview.carving.carver import CarveRule, carve
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.hull_mesh import write_ply
from voxelpose.recording.folder import Recording

_RESOLUTION = 192  # voxels along the longest edge where no size is given


@dataclass(frozen=True)
class CarveSettings:
    """Settings of carving a frame and writing its hull."""

    frame: int = 0  #: Number of the frame.
    voxel_size_m: float | None = None
    """Edge of a voxel, m; None: a 192th of the longest edge of what the silhouettes allow."""
    rule: CarveRule = field(default_factory=CarveRule)
    """Condition under which a voxel is occupied."""
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
        settings: Frame, size of voxels and rule.
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
    grid = place_grid(rig, masks, settings.voxel_size_m, _RESOLUTION, settings.rule, unknown)
    occupancy = carve(rig, masks, grid, settings.rule, unknown)
    if not occupancy.any():
        raise InputError(
            "no voxel is left: choose smaller voxels, or tolerate a bad camera (--tolerance 1)"
        )
    if out is not None:
        write_ply(out, grid, occupancy)
    return Hull(grid, occupancy, rig, masks, silhouettes.without_background, recording.notes)
