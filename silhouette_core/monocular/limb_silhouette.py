"""Silhouette distance of an arm or a leg from one recorded pose on the body of another.

No library holds every pose, but most arms and most legs are in it. With the rest of the body fixed,
every recorded placement of a limb is drawn and weighed with the same silhouette distance as the
tree's nodes. Beyond paper A.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.image.distance import Weighting
from silhouette_core.image.raster import NEAR_M, render_many, render_parts
from silhouette_core.image.spans import Rectangle
from silhouette_core.monocular.tree.evidence import relative_weights
from silhouette_core.monocular.window import SIZE, Window
from silhouette_core.motion.kernels.kinematics import pose_many
from silhouette_core.motion.pose import Pose
from silhouette_core.scoring.backend import Backend
from silhouette_core.scoring.cpu import CPU
from silhouette_core.scoring.silhouette_error import posed_meshes

_PARTS = {
    "arm": ("clavicle", "upper_arm", "forearm", "hand", "thumb", "fingers"),
    "leg": ("thigh", "shin", "foot", "toes"),
}
LIMB_NAMES = ("left_leg", "right_leg", "left_arm", "right_arm")


@dataclass(frozen=True, eq=False)
class LimbShape:
    """The mesh of one limb, cut out of a body.

    Attributes:
        name: Of `LIMB_NAMES`.
        dofs: (d,) int64, the joint angles that place it.
        parts: (p,) int64, its parts.
        vertices_m: (v, 3), its vertices at rest.
        skin_parts: (v, 4), the parts that move each vertex.
        skin_weights: (v, 4), by how much.
        faces: (f, 3), its faces.
        face_part: (f,), their parts.
        rest_faces: (F - f, 3), the faces of the body without it.
        rest_part: (F - f,), their parts.
    """

    name: str
    dofs: NDArray[np.int64]
    parts: NDArray[np.int64]
    vertices_m: NDArray[np.float64]
    skin_parts: NDArray[np.int32]
    skin_weights: NDArray[np.float64]
    faces: NDArray[np.int32]
    face_part: NDArray[np.int32]
    rest_faces: NDArray[np.int32]
    rest_part: NDArray[np.int32]

    @classmethod
    def from_model(cls, model: BodyModel, name: str) -> LimbShape:
        """Cuts a limb out of a body."""
        side, _, kind = name.partition("_")
        parts = np.array([model.names.index(f"{side}_{part}") for part in _PARTS[kind]])
        own = np.isin(model.face_part, parts)
        used, faces = np.unique(model.faces[own], return_inverse=True)
        return cls(
            name,
            np.flatnonzero(np.isin(model.dof_part, parts)),
            parts,
            model.vertices_m[used],
            model.skin_parts[used],
            model.skin_weights[used],
            faces.reshape(-1, 3).astype(np.int32),
            model.face_part[own],
            model.faces[~own],
            model.face_part[~own],
        )


@dataclass(frozen=True, eq=False)
class SignedWeights:
    """Pixel weights whose sum under a drawn silhouette is its distance from the observed one.

    Attributes:
        signed: (h, w) float64, d_P (1 - 2 P), relative to the silhouette (`relative_weights`).
        base: Distance of the empty silhouette.
        matrix: (3, 3) of the virtual camera at this resolution.
        rotation: (3, 3), virtual camera from world.
        translation_m: (3,), virtual camera from world.
        backend: Scores the poses.
    """

    signed: NDArray[np.float64]
    base: float
    matrix: NDArray[np.float64]
    rotation: NDArray[np.float64]
    translation_m: NDArray[np.float64]
    backend: Backend = CPU

    @classmethod
    def from_window(
        cls,
        window: Window,
        weighting: Weighting = "nwxor",
        reduction: int = 2,
        backend: Backend = CPU,
        bounds_px: Rectangle | None = None,
    ) -> SignedWeights:
        """Weighs a window's silhouette at full, half or quarter size (`reduction` 1, 2, 4).

        `bounds_px` is the library's rectangle, see `pixel_weights`; None: the window.
        """
        mask, weights = relative_weights(window, weighting, reduction, bounds_px)
        center = (window.axis_px + 0.5) / reduction - 0.5
        focal = window.focal_px / reduction
        matrix = np.array([[focal, 0.0, center[0]], [0.0, focal, center[1]], [0.0, 0.0, 1.0]])
        rotation = np.ascontiguousarray(window.world_from_virtual.T)
        return cls(
            np.where(mask, -weights, weights).astype(float),
            float(weights[mask].sum()),
            matrix,
            rotation,
            -rotation @ window.center_m,
            backend,
        )

    @property
    def mask(self) -> NDArray[np.bool_]:
        """The silhouette (h, w)."""
        return self.signed < 0

    def distances(self, model: BodyModel, poses: Sequence[Pose]) -> NDArray[np.float64]:
        """Silhouette distances (K,) of whole poses, eq. (7)-(9)."""
        meshes = self._in_camera(model, poses)
        drawn = self.backend.drawn_weights(
            self.signed, meshes, model.faces, self.matrix, cull_back=True
        )
        return self.base + drawn

    def limb_distances(
        self, model: BodyModel, limb: LimbShape, pose: Pose, angles_rad: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Silhouette distances of a pose with its limb placed in other ways.

        Args:
            model: The body.
            limb: Cut out of it.
            pose: All but the limb's own angles is taken from it.
            angles_rad: (K, d), the limb's angles.

        Returns:
            (K,) silhouette distances of the whole body.
        """
        # An opened body shows its inside: both faces are drawn.
        covered = self._parts(model, pose, limb.rest_faces, limb.rest_part) > 0
        whole = np.tile(pose.angles_rad, (len(angles_rad), 1))
        whole[:, limb.dofs] = angles_rad
        meshes = np.empty((len(whole), *limb.vertices_m.shape))
        pose_many(
            model.parents,
            model.joints_m,
            model.dof_part,
            model.dof_axis,
            self.rotation @ pose.root_rotation,
            self.rotation @ pose.root_m + self.translation_m,
            whole,
            limb.vertices_m,
            limb.skin_parts,
            limb.skin_weights,
            meshes,
        )
        free = np.where(covered, 0.0, self.signed)
        added = self.backend.drawn_weights(free, meshes, limb.faces, self.matrix, cull_back=True)
        return self.base + float(self.signed[covered].sum()) + added

    def part_areas(self, drawn: NDArray[np.uint8], parts: int) -> NDArray[np.float64]:
        """Area of every part (K, parts), A_j of eq. (3), in pixels of the library's full
        resolution, in K part images (K, h, w), see `part_images`.
        """
        counts = [np.bincount(one.ravel(), minlength=parts + 1)[1:] for one in drawn]
        return np.array(counts) * (SIZE[0] / self.signed.shape[1]) ** 2

    def covered(self, model: BodyModel, poses: Sequence[Pose]) -> NDArray[np.bool_]:
        """Pixels (K, h, w) that the body covers in K poses."""
        return self.part_images(model, poses) > 0

    def uncovered(
        self, poses: Sequence[Pose], drawn: NDArray[np.uint8], most_m: float
    ) -> NDArray[np.float64]:
        """How far the silhouette stands out of the body in K poses (K,), m: the largest distance of
        its pixels from the drawn body, `part_images`, at most `most_m`.
        """
        mask = self.mask.view(np.uint8)
        left, top, width, height = cv2.boundingRect(mask)
        far = np.empty(len(poses))
        for k, (pose, covered) in enumerate(zip(poses, drawn > 0, strict=True)):
            depth = float(self.rotation[2] @ pose.root_m + self.translation_m[2])
            m_per_px = max(depth, NEAR_M) / float(self.matrix[0, 0])
            near = max(1, int(np.ceil(most_m / m_per_px)))  # what is farther away is too far
            rows = slice(max(top - near, 0), top + height + near)
            columns = slice(max(left - near, 0), left + width + near)
            part = np.ascontiguousarray(~covered[rows, columns]).view(np.uint8)
            away = cv2.distanceTransform(part, cv2.DIST_L2, cv2.DIST_MASK_5)
            px = cv2.minMaxLoc(away, mask=np.ascontiguousarray(mask[rows, columns]))[1]
            far[k] = min(px * m_per_px, most_m)
        return far

    def part_images(self, model: BodyModel, poses: Sequence[Pose]) -> NDArray[np.uint8]:
        """Part images (K, h, w) of K poses: 0 for background, part number + 1 elsewhere."""
        meshes, size = self._in_camera(model, poses), self.signed.shape[::-1]
        return render_many(meshes, model.faces, model.face_part, self.matrix, size)

    def _in_camera(self, model: BodyModel, poses: Sequence[Pose]) -> NDArray[np.float64]:
        """Meshes (K, V, 3) of poses in the virtual camera."""
        return posed_meshes(model, poses) @ self.rotation.T + self.translation_m

    def _parts(
        self, model: BodyModel, pose: Pose, faces: NDArray[np.int32], face_part: NDArray[np.int32]
    ) -> NDArray[np.uint8]:
        mesh, size = self._in_camera(model, [pose])[0], self.signed.shape[::-1]
        return render_parts(mesh, faces, face_part, self.matrix, size)[0]
