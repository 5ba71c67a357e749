"""Contents of one frame of a result, before they are drawn."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from voxelpose.export.hypotheses import Hypothesis
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.view.images.canvas import Colour


@dataclass(frozen=True, eq=False)
class CameraFrame:
    """Picture and silhouette of one camera.

    Attributes:
        camera: without distortion, of the picture's size.
        picture: (h, w, 3) uint8 RGB, undistorted; None where the recording is missing or holds
            silhouettes only.
        mask: (h, w) bool, the silhouette; None where the recording is missing.
        unknown: (h, w) bool, where nothing is known; None: nowhere.
    """

    camera: Camera
    picture: NDArray[np.uint8] | None = None
    mask: NDArray[np.bool_] | None = None
    unknown: NDArray[np.bool_] | None = None


@dataclass(frozen=True, eq=False)
class CarvedHull:
    """Hull of the body.

    Attributes:
        occupancy: (nx, ny, nz) bool.
        vertices_m: (V, 3) float64, vertices of its surface in the world.
        faces: (F, 3) int64, triangles of its surface.
        unexplained_m: (n, 3) float64, centres of the voxels that no part of the fitted body covers.
        distance_m: (n,) float64, distance of each of those from the inside of the body.
    """

    grid: VoxelGrid
    occupancy: NDArray[np.bool_]
    vertices_m: NDArray[np.float64]
    faces: NDArray[np.int64]
    unexplained_m: NDArray[np.float64]
    distance_m: NDArray[np.float64]

    def litres(self, voxels: NDArray[np.bool_]) -> float:
        """Volume of the true ones of some voxels, litres."""
        return 1000 * float(np.count_nonzero(voxels)) * self.grid.voxel_size_m**3


@dataclass(frozen=True, eq=False)
class BodyState:
    """The fitted body.

    Attributes:
        vertices_m: (V, 3) float64, its skin in the world.
        joints_m: (J, 3) float64, the ends of the bones.
        bones: lines of the skeleton, see `skeleton_bones`.
        part_names: P names.
        overlap: (P,) float64, fraction of each part inside the hull; NaN where unknown.
        outline_agreement: of the frame, from 0 to 1; None where the estimator gave none.
    """

    vertices_m: NDArray[np.float64]
    joints_m: NDArray[np.float64]
    bones: list[tuple[int, int, Colour]]
    part_names: tuple[str, ...]
    overlap: NDArray[np.float64]
    outline_agreement: float | None


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that one frame shows.

    Attributes:
        time_s: its time, seconds.
        hull: None without silhouettes of two cameras.
        body: None where no pose was found.
        hypotheses: other poses that one camera leaves open, the likeliest first.
        notes: what is missing, in words.
    """

    frame: int
    time_s: float
    camera_frames: tuple[CameraFrame, ...]
    hull: CarvedHull | None
    body: BodyState | None
    hypotheses: tuple[Hypothesis, ...]
    notes: tuple[str, ...]
