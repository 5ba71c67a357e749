"""Shape space of bodies: every axis of `SHAPE_AXES` moves joints and surface linearly."""

from dataclasses import dataclass

import numpy as np

from silhouette_core.body.joints import LANDMARK_PART, PARENTS, PART_NAMES, without_side
from silhouette_core.body.sizes import SHAPE_AXES, ShapeAxis
from silhouette_core.tuning import MEASURING

_SMOOTHED = 4  # how often the length of clothing directions is averaged with the neighbours


@dataclass(frozen=True, eq=False)
class ShapeSpace:
    """Linear space of bodies around a body at rest. K shape axes, V vertices; metres."""

    joints_m: np.ndarray  #: (27, 3) float64, joints of the body in the middle of the space.
    vertices_m: np.ndarray  #: (V, 3) float64, its vertices.
    landmarks_m: np.ndarray  #: (15, 3) float64, its landmarks.
    joints_change: np.ndarray  #: (K, 27, 3) float64, change of the joints per unit deviation.
    vertices_change: np.ndarray  #: (K, V, 3) float64, change of the vertices.
    landmarks_change: np.ndarray  #: (K, 15, 3) float64, change of the landmarks.

    @classmethod
    def from_rest(
        cls,
        joints: np.ndarray,
        vertices: np.ndarray,
        landmarks: np.ndarray,
        parts: np.ndarray,
        weights: np.ndarray,
        faces: np.ndarray,
    ) -> "ShapeSpace":
        """Shape space around a body at rest.

        A part's surface is scaled about the part's own joint, and so are the joints that it
        carries; clothes move the surface outward. Vertices blend between parts by their
        skin weights, so that no seam opens.
        """
        changes = []
        outward, tall = clothing_directions(vertices, faces), np.ptp(vertices[:, 2])
        for axis in SHAPE_AXES:
            covered = np.array([without_side(name) in axis.parts for name in PART_NAMES])
            if axis.is_clothing:  # as thick as the body is tall; it moves no joint
                share = (weights * covered[parts]).sum(1, keepdims=True)
                skin = tall * share * outward
                changes.append((np.zeros_like(joints), skin, np.zeros_like(landmarks)))
            else:
                changes.append(_change(axis, covered, joints, vertices, landmarks, parts, weights))
        stacked = (np.stack(change) for change in zip(*changes, strict=True))
        return cls(joints, vertices, landmarks, *stacked)

    @classmethod
    def rigid(cls, joints: np.ndarray, vertices: np.ndarray, landmarks: np.ndarray) -> "ShapeSpace":
        """Space without axes, of a body whose shape is given."""
        none = (np.zeros((0, *points.shape)) for points in (joints, vertices, landmarks))
        return cls(joints, vertices, landmarks, *none)

    def apply(self, shape: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Joints (27, 3), vertices (V, 3) and landmarks (15, 3) at deviations `shape` (K,)."""
        return (
            self.joints_m + np.tensordot(shape, self.joints_change, 1),
            self.vertices_m + np.tensordot(shape, self.vertices_change, 1),
            self.landmarks_m + np.tensordot(shape, self.landmarks_change, 1),
        )

    def scaled(self, factor: float) -> "ShapeSpace":
        """Space with every length multiplied by `factor`."""
        return ShapeSpace(*(factor * getattr(self, name) for name in self.__dataclass_fields__))


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Outward unit normals (V, 3) of vertices (V, 3), weighted by the area of the faces (F, 3)."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    face_normals = np.cross(b - a, c - a)
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, faces[:, k], face_normals)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def clothing_directions(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Directions (V, 3) in which clothes move the vertices (V, 3) of a body of faces (F, 3).

    The unit normals; shorter in hollows such as crotch and armpits, across which clothes hang and
    where the surface would fold over itself.
    """
    normals = vertex_normals(vertices, faces)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    count = np.bincount(edges[:, 0], minlength=len(vertices))
    along = vertices[edges[:, 1]] - vertices[edges[:, 0]]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    rise = (normals[edges[:, 0]] * along).sum(1)
    hollow = np.bincount(edges[:, 0], rise, len(vertices)) / count
    length = np.clip(1 - MEASURING.hollow * hollow, 0, 1)
    for _ in range(_SMOOTHED):
        beside = np.bincount(edges[:, 0], length[edges[:, 1]], len(vertices))
        length = 0.5 * length + 0.5 * beside / count
    return normals * length[:, None]


def bone_directions(joints: np.ndarray) -> np.ndarray:
    """Unit vectors (27, 3) along the parts, from each joint to the next one.

    A part without a child continues the direction of its parent.
    """
    children = [np.flatnonzero(p == PARENTS) for p in range(len(PARENTS))]
    direction = np.zeros_like(joints)
    for p, descendants in enumerate(children):
        name = PART_NAMES[p]
        if name in ("pelvis", "hand", "head") or not len(descendants):
            direction[p] = joints[p] - joints[PARENTS[p]] if PARENTS[p] >= 0 else (0, 0, 1)
        else:
            direction[p] = joints[descendants[0]] - joints[p]
        if name.endswith(("foot", "toes")):
            direction[p] = (0, -1, 0)
    return direction / np.linalg.norm(direction, axis=1, keepdims=True)


def _change(
    axis: ShapeAxis,
    covered: np.ndarray,
    joints: np.ndarray,
    vertices: np.ndarray,
    landmarks: np.ndarray,
    skin_parts: np.ndarray,
    skin_weights: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    stretch = np.zeros((len(joints), 3, 3))
    for p in np.flatnonzero(covered):
        direction = bone_directions(joints)[p]
        along = np.outer(direction, direction)
        kinds = {"length": along, "girth": np.eye(3) - along}
        kinds |= {name: np.diag(unit) for name, unit in zip("xyz", np.eye(3), strict=True)}
        stretch[p] = kinds[axis.along]
    moved = np.zeros_like(joints)
    for p, parent in enumerate(PARENTS):
        if parent >= 0:
            moved[p] = moved[parent] + (
                stretch[parent] @ (joints[p] - joints[parent]) if axis.joints else 0.0
            )
    flesh = stretch if axis.flesh else np.zeros_like(stretch)
    offsets = vertices[:, None] - joints[skin_parts]
    skin = (
        skin_weights[..., None]
        * (moved[skin_parts] + np.einsum("vkij,vkj->vki", flesh[skin_parts], offsets))
    ).sum(1)
    marks = moved[LANDMARK_PART] + np.einsum(
        "lij,lj->li", stretch[LANDMARK_PART], landmarks - joints[LANDMARK_PART]
    )
    return moved, skin, marks
