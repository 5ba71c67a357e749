"""Quantities that several formats share: named points, frames, y-up axes."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.motion.dynamics import is_person_tree
from silhouette_core.motion.motion import Motion

Y_UP_FROM_WORLD = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)
"""Axes of BVH and glTF: (x, y, z) becomes (x, z, -y). A body that faces -y in the world then faces
+z, its left hand toward +x in both.
"""


def part_ends(model: BodyModel) -> NDArray[np.float64]:
    """End point (P, 3) m of every part in the rest pose: the mean of the 5 % of the part's vertices
    that are farthest from its joint; for the head, the landmark head_top.
    """
    ends = model.joints_m.copy()
    for part in range(len(model.names)):
        points = _surface(model, part)
        if len(points):
            distance = np.linalg.norm(points - model.joints_m[part], axis=1)
            ends[part] = points[distance >= np.quantile(distance, 0.95)].mean(axis=0)
    if "head_top" in model.tree.landmark_names and "head" in model.names:
        top = model.tree.landmark_names.index("head_top")
        ends[model.names.index("head")] = model.landmarks_m[top]
    return ends


def named_points(motion: Motion) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    """K names and positions (T, K, 3) m, world, of points of the fitted body that marker formats
    hold in place of markers: the joints of joints.csv, the joints of the other parts under the
    parts' names, and of a person `_heel`, `_toe_tip` and `_finger_tip` of both sides.
    """
    model = motion.model
    names: list[str] = list(model.tree.landmark_names)
    parts, rest = list(model.tree.landmark_part), list(model.joint_centres_m)
    at_joint = {
        part
        for part, point in zip(parts, model.landmarks_m, strict=True)
        if np.allclose(point, model.joints_m[part])
    }
    for part, name in enumerate(model.names):
        if part not in at_joint:
            names.append(name)
            parts.append(part)
            rest.append(model.joints_m[part])
    ends = part_ends(model)
    for side in ("left", "right") if is_person_tree(model.tree) else ():
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
    """Returns the numbers of all frames from the first to the last pose, with or without a pose."""
    return np.arange(motion.frames[0], motion.frames[-1] + 1)


def ascii_names(names: Sequence[str]) -> list[str]:
    """Names in formats that hold ASCII words alone; the second of one name gets a number."""
    words: dict[str, None] = {}
    for name in names:
        plain = "".join(c if c.isascii() and (c.isalnum() or c in "_-.:") else "_" for c in name)
        word, number = plain, 1
        while word in words:
            number += 1
            word = f"{plain}_{number}"
        words[word] = None
    return list(words)


def _surface(model: BodyModel, part: int) -> NDArray[np.float64]:
    return model.vertices_m[np.unique(model.faces[model.face_part == part])]
