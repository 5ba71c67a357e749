"""Limbs recombined: an arm or a leg from one recorded pose on the body of another.

No library holds every pose, but most arms and most legs are in it. With the rest of the body held,
every recorded placement of a limb is drawn and weighed on the same silhouette distance as the
tree's nodes. Beyond paper A.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.filter.evidence import relative_weights
from silhouette_core.filter.kernels.limb_silhouette import weigh_placements
from silhouette_core.filter.window import SIZE, Window
from silhouette_core.image.distance import Weighting
from silhouette_core.image.raster import render_parts
from silhouette_core.refinement.pose import Pose
from silhouette_core.refinement.silhouette_error import posed_mesh

_PARTS = {
    "arm": ("clavicle", "upper_arm", "forearm", "hand", "thumb", "fingers"),
    "leg": ("thigh", "shin", "foot", "toes"),
}
LIMB_NAMES = ("left_leg", "right_leg", "left_arm", "right_arm")


@dataclass(frozen=True, eq=False)
class LimbShape:
    """The mesh of one limb, cut out of a body.

    Attributes: name: of `LIMB_NAMES`. dofs: (d,) int64, the joint angles that place it. parts: (p,)
        int64, its parts. vertices_m: (v, 3), skin_parts, skin_weights: (v, 4), faces: (f, 3),
        face_part: (f,): of the limb alone. rest_faces: (F - f, 3), rest_part: (F - f,): the body
        without it.
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
    def of(cls, model: BodyModel, name: str) -> LimbShape:
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
    """An observed silhouette's weights as a sum to be made small.

    Attributes: signed: (h, w) float64, d_P (1 - 2 P), relative to the silhouette
        (`relative_weights`): summed over a drawn silhouette and added
            to `base`, it is the silhouette distance.
        base: of the empty drawing.
        matrix: (3, 3) of the virtual camera at this resolution; rotation (3, 3), translation_m
            (3,): virtual from world.
    """

    signed: NDArray[np.float64]
    base: float
    matrix: NDArray[np.float64]
    rotation: NDArray[np.float64]
    translation_m: NDArray[np.float64]

    @classmethod
    def of(
        cls, window: Window, weighting: Weighting = "nwxor", reduction: int = 2
    ) -> SignedWeights:
        """Weighs a window's silhouette at full, half or quarter resolution (`reduction` 1, 2, 4)."""
        picture, weights = relative_weights(window, weighting, reduction)
        center = (window.axis_px + 0.5) / reduction - 0.5
        focal = window.focal_px / reduction
        matrix = np.array([[focal, 0.0, center[0]], [0.0, focal, center[1]], [0.0, 0.0, 1.0]])
        rotation = np.ascontiguousarray(window.world_from_virtual.T)
        return cls(
            np.where(picture, -weights, weights).astype(float),
            float(weights[picture].sum()),
            matrix,
            rotation,
            -rotation @ window.center_m,
        )

    def distance(self, model: BodyModel, pose: Pose) -> float:
        """Returns the silhouette distance of a whole pose, eq. (7)-(9)."""
        return self.base + float(
            self.signed[self._drawn(model, pose, model.faces, model.face_part)].sum()
        )

    def limb_distances(
        self, model: BodyModel, limb: LimbShape, pose: Pose, angles_rad: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Measures a pose with its limb placed in other ways.

        Args:
            model: the body.
            limb: cut out of it.
            pose: all but the limb's own angles is taken from it.
            angles_rad: (K, d), the limb's angles.

        Returns:
            (K,) silhouette distances of the whole body.
        """
        covered = self._drawn(model, pose, limb.rest_faces, limb.rest_part)
        whole = np.tile(pose.angles_rad, (len(angles_rad), 1))
        whole[:, limb.dofs] = angles_rad
        totals = np.empty(len(whole))
        weigh_placements(
            model.parents,
            model.joints_m,
            model.dof_part,
            model.dof_axis,
            pose.root_rotation,
            pose.root_m,
            whole,
            limb.vertices_m,
            limb.skin_parts,
            limb.skin_weights,
            limb.faces,
            limb.face_part,
            self.rotation,
            self.translation_m,
            self.matrix,
            self.signed,
            covered,
            totals,
        )
        return self.base + float(self.signed[covered].sum()) + totals

    def part_areas(self, model: BodyModel, pose: Pose) -> NDArray[np.float64]:
        """Returns the area of every part (27,), A_j of eq. (3), in pixels of the library's full
        resolution.
        """
        in_camera = posed_mesh(model, pose) @ self.rotation.T + self.translation_m
        parts, _ = render_parts(
            in_camera, model.faces, model.face_part, self.matrix, self.signed.shape[::-1]
        )
        return (
            np.bincount(parts.ravel(), minlength=len(model.names) + 1)[1:]
            * (SIZE[0] / parts.shape[1]) ** 2
        )

    def _drawn(
        self, model: BodyModel, pose: Pose, faces: NDArray[np.int32], face_part: NDArray[np.int32]
    ) -> NDArray[np.bool_]:
        in_camera = posed_mesh(model, pose) @ self.rotation.T + self.translation_m
        # An opened body shows its inside: both faces are drawn.
        parts, _ = render_parts(in_camera, faces, face_part, self.matrix, self.signed.shape[::-1])
        return parts > 0
