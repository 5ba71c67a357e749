"""The fitted body of a result at any frame."""

import numpy as np
from numpy.typing import NDArray

from silhouette_core.motion import kinematics
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.pose import Pose
from voxelpose.multiview.matching.body_volume import BodyVolume
from voxelpose.view.images.figure import skeleton_bones, skeleton_joints
from voxelpose.view.viewer.scene import BodyState


class FittedBody:
    """Skin, skeleton and volume of a motion's body.

    Attributes:
        volume: the body filled with points.
    """

    def __init__(self, motion: Motion, voxel_size_m: float) -> None:
        """Fills the body, one point per voxel of the given size."""
        self.motion = motion
        self.volume = BodyVolume.from_model(motion.model, voxel_size_m)
        self._parts = motion.parts()

    def row(self, frame: int) -> int | None:
        """Row of the motion that holds a frame, or None."""
        rows = np.flatnonzero(self.motion.frames == frame).tolist()
        return rows[0] if rows else None

    def state(self, row: int) -> BodyState:
        """The body in a row of the motion."""
        model, quality = self.motion.model, self.motion.quality
        placed = [array[row] for array in self._parts]
        overlap = quality.get("part_overlap")
        agreement = quality.get("outline_agreement")
        return BodyState(
            kinematics.skin(model, *placed),
            skeleton_joints(model, *placed),
            skeleton_bones(model),
            model.names,
            np.full(len(model.names), np.nan) if overlap is None else np.array(overlap[row], float),
            None if agreement is None else float(agreement[row]),
        )

    def pose(self, row: int) -> Pose:
        """The pose in a row of the motion."""
        motion = self.motion
        rotation = kinematics.rotation_matrices(motion.root_quaternion[row])
        return Pose(motion.root_m[row], rotation, motion.angles_rad[row])

    def points(self, row: int) -> NDArray[np.float64]:
        """Points (n, 3), metres, that fill the body in a row of the motion."""
        placed = zip(self.volume.part_points, *(array[row] for array in self._parts), strict=True)
        return np.concatenate(
            [points @ rotation.T + origin for points, rotation, origin in placed if len(points)]
        )
