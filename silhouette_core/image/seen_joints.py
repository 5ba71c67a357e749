r"""What the points of the pose network say of the joints of a person, as evidence beside modes.

The 15 joints are affine combinations of the 33 points of the network, in the picture and in metres.
In the picture they are exact to some centimetres; the metres tell less well how far they lie before
or behind the pelvis. So every joint is observed, relative to the pelvis, as a Gaussian that is
longest along its viewing ray.

A mode of the learned proposal is a Gaussian, too. Its evidence is the density of the difference,

.. math:: w = N(y - \mu;\, 0,\, \Lambda^{-1} + \Lambda_y^{-1})^c

to the power :math:`c` since a frame's points err together, and what both say is their product, of
precision :math:`\Lambda + c \Lambda_y`.

Source: textbook (products of Gaussians); joint_points.toml is written by
`python -m benchmarks.seen_joints`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.fitted_weights import fitted_weights
from silhouette_core.image.pose_network import POINTS, PersonSeen
from silhouette_core.tuning import SEEN_JOINTS

FILE = Path(__file__).with_suffix(".toml")
"""Weights of the points, and deviations of the joints: across the ray and along it, for points that
are seen and for points that are not."""


@dataclass(frozen=True, eq=False)
class SeenJoints:
    """Joints of a person as the network sees them.

    Attributes:
        rays: (15, 3) viewing rays in axes of the camera, of depth 1.
        relative_m: (15, 3) from the pelvis, axes of the camera, as large as the network thinks.
        visibility: (15,) 0 to 1.
    """

    rays: NDArray[np.float64]
    relative_m: NDArray[np.float64]
    visibility: NDArray[np.float64]

    @classmethod
    def of(cls, person: PersonSeen, camera: Camera) -> SeenJoints | None:
        """Joints of somebody seen by a camera; None where the network is not sure of the person, or
        the lens shows no such place.
        """
        if person.presence < SEEN_JOINTS.presence:
            return None
        pixels = camera.undistort(person.points_px)
        if not np.isfinite(pixels).all():
            return None
        matrix = np.linalg.inv(camera.pinhole(1.0).matrix)
        rays = np.column_stack([pixels, np.ones(len(pixels))]) @ matrix.T
        return cls.from_points(rays, person.points_m, person.visibility, joint_weights())

    @classmethod
    def from_points(
        cls,
        rays: NDArray[np.float64],
        points_m: NDArray[np.float64],
        visibility: NDArray[np.float64],
        weights: NDArray[np.float64],
    ) -> SeenJoints:
        """Joints of the network's points.

        Args:
            rays: (33, 3) viewing rays in axes of the camera, of depth 1.
            points_m: (33, 3) m, axes of the camera.
            visibility: (33,) 0 to 1.
            weights: (15, 33), each joint's summing to 1.
        """
        joints_m, share = weights @ points_m, np.abs(weights)
        seen = share @ visibility / share.sum(axis=1)
        return cls(weights @ rays, joints_m - joints_m[0], seen)

    def placed(self, depth_m: float) -> NDArray[np.float64]:
        """Joints (15, 3) relative to the pelvis, m, axes of the camera, with the pelvis at a depth:
        the metres are scaled to the size that the picture has there.
        """
        across = (self.rays - self.rays[0])[:, :2] * depth_m
        thought = self.relative_m[:, :2] - self.rays[:, :2] * self.relative_m[:, 2:]
        scale = float((across * thought).sum() / max((thought**2).sum(), 1e-9))
        depths = depth_m + scale * self.relative_m[:, 2]
        return self.rays * np.maximum(depths, 0.1)[:, None] - self.rays[0] * depth_m

    def precision(self) -> NDArray[np.float64]:
        """(15, 3, 3) of the joints relative to the pelvis, 1/m², axes of the camera."""
        across, along = joint_deviations(self.visibility)
        unit = self.rays / np.linalg.norm(self.rays, axis=1, keepdims=True)
        rank = unit[:, :, None] * unit[:, None, :]
        return rank / along[:, None, None] ** 2 + (np.eye(3) - rank) / across[:, None, None] ** 2


def joint_weights() -> NDArray[np.float64]:
    """Weights (15, 33) of the points, each joint's summing to 1."""
    return fitted_weights(FILE)["points"].reshape(len(LANDMARK_NAMES), POINTS)


def joint_deviations(
    visibility: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Deviations (15,) of the joints across their rays and along them, m."""
    weights, hidden = fitted_weights(FILE), 1 - visibility
    across, along = (
        0.001 * (weights[f"{kind}_mm"] + hidden * weights[f"{kind}_hidden_mm"])
        for kind in ("across", "along")
    )
    return across, along


def evidence(
    seen: SeenJoints,
    camera: Camera,
    depth_m: float,
    relative_m: NDArray[np.float64],
    precision: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Evidence of M Gaussian modes, nats, and their products with what is seen.

    Args:
        seen: joints in the frame.
        camera: that sees them.
        depth_m: of the pelvis along its optical axis.
        relative_m: (M, 15, 3) means relative to the pelvis, in the world.
        precision: (M, 15, 3, 3) of the joints, 1/m².

    Returns:
        Evidence (M,), means (M, 15, 3) and precisions (M, 15, 3, 3) of the products.
    """
    rotation = camera.rotation  # camera from world
    observed = seen.placed(depth_m) @ rotation
    trust = SEEN_JOINTS.independence
    own = rotation.T @ seen.precision() @ rotation
    away = observed - relative_m
    whole = np.linalg.inv(np.linalg.inv(precision[:, 1:]) + np.linalg.inv(own[1:]))
    square = np.einsum("mli,mlij,mlj->ml", away[:, 1:], whole, away[:, 1:])
    # Student's t, as of the modes themselves: a point may be another thing's.
    freedom = SEEN_JOINTS.freedom
    density = 0.5 * np.log(np.linalg.det(whole)) - 0.5 * (freedom + 3) * np.log1p(square / freedom)
    weight = (freedom + 3) / (freedom + square)
    added = SEEN_JOINTS.pull * own[None, 1:] * weight[..., None, None]
    together = precision.copy()
    together[:, 1:] += added
    means = relative_m.copy()
    means[:, 1:] += np.einsum(
        "mlij,mljk,mlk->mli", np.linalg.inv(together[:, 1:]), added, away[:, 1:]
    )
    return trust * density.sum(axis=1), means, together
