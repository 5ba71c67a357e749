"""Where the points of the pose network show the joints of a person in the picture.

The 15 joints are affine combinations of the 33 points of the network, exact to some centimetres
across their viewing rays. The metres that the network gives, too, are not used: 73 to 103 mm off,
they changed nothing on 22 rendered recordings of one camera.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calib.camera import Camera
from calib.checks import BoolArray, FloatArray
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.fitted_weights import fitted_weights
from silhouette_core.image.pose_network import FILE, POINTS, PersonSeen


@dataclass(frozen=True, eq=False)
class SeenJoints:
    """Joints of a person as the network sees them."""

    rays: FloatArray  #: (15, 3) viewing rays in axes of the camera, of depth 1.
    visibility: FloatArray  #: (15,) 0 to 1.

    @classmethod
    def of(cls, person: PersonSeen, camera: Camera) -> "SeenJoints | None":
        """Joints of somebody seen by a camera; None where the network is not sure of the person, or
        the lens shows no such place.
        """
        rays = point_rays(person, camera)
        if not person.is_sure or not np.isfinite(rays).all():
            return None
        return cls.from_points(rays, person.visibility, joint_weights())

    @classmethod
    def from_points(
        cls, rays: FloatArray, visibility: FloatArray, weights: FloatArray
    ) -> "SeenJoints":
        """Joints of the network's points.

        Args:
            rays: (33, 3) viewing rays in axes of the camera, of depth 1.
            visibility: (33,) 0 to 1.
            weights: (15, 33), each joint's summing to 1.
        """
        share = np.abs(weights)
        return cls(weights @ rays, share @ visibility / share.sum(axis=1))


def joints_of_silhouette(
    people: Mapping[int, PersonSeen], camera: Camera, mask: BoolArray
) -> SeenJoints | None:
    """Joints of who shares most with a silhouette (h, w) bool of a camera; None where nobody does,
    or as of `SeenJoints.of`.
    """
    size, scale = mask.shape[::-1], mask.shape[1] / camera.size[0]
    shared = {k: int((mask & (one.odds(size, scale) > 0)).sum()) for k, one in people.items()}
    best = max(shared, key=lambda k: shared[k], default=None)
    if best is None or not shared[best]:
        return None
    return SeenJoints.of(people[best], camera)


def point_rays(person: PersonSeen, camera: Camera) -> FloatArray:
    """Viewing rays (33, 3) of the points in camera axes, of depth 1; NaN where there are none."""
    pixels = camera.undistort(person.points_px)
    matrix = np.linalg.inv(camera.pinhole(1.0).matrix)
    return np.column_stack([pixels, np.ones(len(pixels))]) @ matrix.T


def deviations_m(visibility: FloatArray) -> FloatArray:
    """Deviations (..., 15) of joints across their rays, by their visibility (..., 15)."""
    weights = fitted_weights(FILE)
    return 0.001 * (weights["across_mm"] + (1 - visibility) * weights["across_hidden_mm"])


def joint_weights() -> FloatArray:
    """Weights (15, 33) of the points, each joint's summing to 1."""
    return fitted_weights(FILE)["points"].reshape(len(LANDMARK_NAMES), POINTS)
