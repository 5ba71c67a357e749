"""Pixel weights of one frame's silhouette, and the silhouette distance of posed bodies from it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.checks import BoolArray, ByteArray, Float32Array, FloatArray
from silhouette_core.body.model import BodyModel
from silhouette_core.image.distance import distances_to, relative_depths
from silhouette_core.monocular.window import SIZE, Window
from silhouette_core.motion.pose import Pose
from silhouette_core.ranking import summable
from silhouette_core.scoring.backend import Backend
from silhouette_core.scoring.silhouette_error import posed_meshes

# Distance, as a fraction of the window's height, at which the balanced weight outside is 1: about
# half the width of a trunk.
_REACH = 12 / 240


def balanced_weights(mask: BoolArray) -> Float32Array:
    """Weights (h, w) float32 of the pixels of a silhouette (h, w) bool: inside as by eq. (9);
    outside the distance from it over a twentieth of the window's height, at most 1; all 1 where it
    has no contour. By (9) what is just outside costs next to nothing, so that a larger body always
    fits better; where the size is estimated as well, that must not be.
    """
    if not mask.any() or mask.all():
        return np.ones(mask.shape, np.float32)
    outside = distances_to(mask) / np.float32(_REACH * len(mask))
    return np.minimum(outside, np.float32(1.0)) + relative_depths(mask)


def relative_weights(window: Window, reduction: int) -> tuple[BoolArray, FloatArray]:
    """Balanced pixel weights of a window, relative to the whole silhouette's weight.

    The paper divides by the pixels of the region that holds both silhouettes, which is the same for
    all its pictures. Here the same person fills more or less of the window as the assumed distance
    changes, and the smaller picture would always seem to fit better.

    Args:
        reduction: 1, 2 or 4: how many times smaller than the window.

    Returns:
        The silhouette (h, w) bool at that resolution, and d_P (h, w) float64 over the sum of d_P in
        the silhouette, see `Window.weighed`.
    """
    mask, weights = window.weighed(reduction, balanced_weights)
    return mask, weights / max(float(weights[mask].sum()), 1e-6)


@dataclass(frozen=True, eq=False)
class SignedWeights:
    """Pixel weights whose sum under a drawn silhouette is its distance from the observed one."""

    signed: FloatArray  #: (h, w) float64, d_P (1 - 2 P), relative to all (`relative_weights`).
    base: float  #: Distance of the empty silhouette.
    matrix: FloatArray  #: (3, 3) of the virtual camera at this resolution.
    rotation: FloatArray  #: (3, 3), virtual camera from world.
    translation_m: FloatArray  #: (3,), virtual camera from world.
    backend: Backend  #: Scores the poses.

    @classmethod
    def from_window(cls, window: Window, backend: Backend, reduction: int) -> "SignedWeights":
        """Weighs a window's silhouette at full, half or quarter size (`reduction` 1, 2, 4)."""
        mask, weights = relative_weights(window, reduction)
        center = (window.axis_px + 0.5) / reduction - 0.5
        focal = window.focal_px / reduction
        matrix = np.array([[focal, 0.0, center[0]], [0.0, focal, center[1]], [0.0, 0.0, 1.0]])
        rotation = np.ascontiguousarray(window.world_from_virtual.T)
        signed = summable(np.where(mask, -weights, weights))
        return cls(
            signed,
            -float(signed[mask].sum()),
            matrix,
            rotation,
            -rotation @ window.center_m,
            backend,
        )

    @property
    def mask(self) -> BoolArray:
        """The silhouette (h, w)."""
        return self.signed < 0

    def distances(self, model: BodyModel, poses: Sequence[Pose]) -> FloatArray:
        """Silhouette distances (K,) of whole poses, eq. (7)-(9)."""
        meshes = self._in_camera(model, poses)
        return self.base + self.backend.drawn_weights(self.signed, meshes, model.faces, self.matrix)

    def part_areas(self, drawn: ByteArray, parts: int) -> FloatArray:
        """Area of every part (K, parts), A_j of eq. (3), in pixels of the library's full
        resolution, in K part images (K, h, w), see `part_images`.
        """
        counts = [np.bincount(one.ravel(), minlength=parts + 1)[1:] for one in drawn]
        return np.array(counts) * (SIZE[0] / self.signed.shape[1]) ** 2

    def part_images(self, model: BodyModel, poses: Sequence[Pose]) -> ByteArray:
        """Part images (K, h, w) of K poses: 0 for background, part number + 1 elsewhere."""
        meshes, size = self._in_camera(model, poses), self.signed.shape[::-1]
        return self.backend.part_images(meshes, model.faces, model.face_part, self.matrix, size)

    def _in_camera(self, model: BodyModel, poses: Sequence[Pose]) -> FloatArray:
        """Meshes (K, V, 3) of poses in the virtual camera."""
        return posed_meshes(model, poses) @ self.rotation.T + self.translation_m
