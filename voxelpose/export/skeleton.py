"""What several formats need of a motion: turns against the parent, named points, and y up."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.motion.motion import Motion

Y_UP_FROM_WORLD = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""For BVH and glTF: (x, y, z) becomes (x, z, -y). A body that faces -y then faces +z, its left hand
still toward +x.
"""


def local_rotations(motion: Motion) -> NDArray[np.float64]:
    """Returns (T, P, 3, 3), every part's rotation against its parent, the root's in the world; z
    up. Rest is the identity.
    """
    rotation, _ = motion.parts()
    local = rotation.copy()
    for part, parent in enumerate(motion.model.parents):
        if parent >= 0:
            local[:, part] = np.swapaxes(rotation[:, parent], 1, 2) @ rotation[:, part]
    return local


def part_ends(model: BodyModel) -> NDArray[np.float64]:
    """Returns (P, 3) where each part's own surface ends, at rest, metres: the mean of its twentieth
    farthest from its joint.
    """
    ends = model.joints_m.copy()
    for part in range(len(model.names)):
        points = _surface(model, part)
        if len(points):
            distance = np.linalg.norm(points - model.joints_m[part], axis=1)
            ends[part] = points[distance >= np.quantile(distance, 0.95)].mean(axis=0)
    ends[model.names.index("head")] = model.landmarks_m[LANDMARK_NAMES.index("head_top")]
    return ends


def named_points(motion: Motion) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    """Places the points that marker formats carry.

    Args:
        motion: T poses.

    Returns: K names and (T, K, 3) positions in the world, metres: the 15 joints of joints.csv, the
        joints of the other parts under the parts' names, and `_heel`, `_toe_tip` and `_finger_tip`
        of both sides. They are points of the fitted body, not markers.
    """
    model = motion.model
    names: list[str] = list(LANDMARK_NAMES)
    parts, rest = list(model.landmark_part), list(model.landmarks_m)
    known = {
        part
        for part, point in zip(parts, rest, strict=True)
        if np.allclose(point, model.joints_m[part])
    }
    for part, name in enumerate(model.names):
        if part not in known:
            names.append(name)
            parts.append(part)
            rest.append(model.joints_m[part])
    ends = part_ends(model)
    for side in ("left", "right"):
        foot, toes, fingers = (
            model.names.index(f"{side}_{name}") for name in ("foot", "toes", "fingers")
        )
        sole = _surface(model, foot)
        names += [f"{side}_heel", f"{side}_toe_tip", f"{side}_finger_tip"]
        parts += [foot, toes, fingers]
        rest += [
            sole[sole[:, 1] >= np.quantile(sole[:, 1], 0.95)].mean(axis=0),
            ends[toes],
            ends[fingers],
        ]
    rotation, origin = motion.parts()
    local = np.array(rest) - model.joints_m[parts]
    return tuple(names), origin[:, parts] + np.einsum("tkij,kj->tki", rotation[:, parts], local)


def every_frame(motion: Motion) -> NDArray[np.int64]:
    """Returns the numbers of all frames from the first to the last pose, the lost ones between them
    included.
    """
    return np.arange(motion.frames[0], motion.frames[-1] + 1)


def _surface(model: BodyModel, part: int) -> NDArray[np.float64]:
    return model.vertices_m[np.unique(model.faces[model.face_part == part])]
