"""The demo's actor: a clothed mannequin of rigid tubes and balls.

It shares nothing with the fitted bodies: neither mesh nor skinning, other proportions (longer legs,
broader shoulders), and shirt, trousers, shoes and hair over the skin. Body frame as everywhere: z
up, facing -y, left toward +x; at rest the arms hang.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from voxelpose.demo import demo_table
from voxelpose.people_marks import rgb

STATURE_M = 1680 / 1000
COLOURS_BGR = np.array(
    [rgb(code)[::-1] for code in "#deb696 #34221c #b26040 #3a4a5c #2c2828".split()], float
)
"""Skin, hair, shirt, trousers, shoes."""
_COLOUR_NAMES = ("skin", "hair", "shirt", "trousers", "shoes")
SKIN, HAIR, SHIRT, TROUSERS, SHOES = range(len(_COLOUR_NAMES))

_SIDES = ("left", "right")
_PARENT = {"pelvis": "", "belly": "pelvis", "chest": "belly", "neck": "chest", "head": "neck"} | {
    f"{side}_{bone}": parent.format(side)
    for side in _SIDES
    for bone, parent in (
        ("upper_arm", "chest"),
        ("forearm", "{}_upper_arm"),
        ("hand", "{}_forearm"),
        ("thigh", "pelvis"),
        ("shin", "{}_thigh"),
        ("foot", "{}_shin"),
    )
}
BONE_NAMES = tuple(_PARENT)
_PARENTS = tuple(BONE_NAMES.index(parent) if parent else -1 for parent in _PARENT.values())
_LANDMARKS = {"pelvis": "pelvis", "neck": "neck"} | {
    f"{side}_{joint}": f"{side}_{bone}"
    for side in _SIDES
    for joint, bone in (
        ("hip", "thigh"),
        ("knee", "shin"),
        ("ankle", "foot"),
        ("shoulder", "upper_arm"),
        ("elbow", "forearm"),
        ("wrist", "hand"),
    )
}
_MIRROR = np.array([-1, 1, 1])
RING = 24
"""Vertices of each ring of a tube."""


def metres(table: Any) -> NDArray[np.float64]:
    """Lengths of mannequin.toml, which has millimetres, in metres."""
    return np.array(table) / 1000


@dataclass(frozen=True, eq=False)
class Mannequin:
    """The actor at rest."""

    vertices_m: NDArray[np.float64]  # (V, 3)
    faces: NDArray[np.int32]  # (F, 3), outward oriented; every tube and ball is closed
    face_colour: NDArray[np.int32]  # (F,) index into `COLOURS_BGR`
    vertex_bone: NDArray[np.int32]  # (V,) index into `BONE_NAMES`: rigid pieces, no blending
    joints_m: NDArray[np.float64]  # (B, 3), the near end of every bone
    head_top_m: NDArray[np.float64]  # (3,), the vertex of the head
    stride: float = 1.0  # length of the legs over the standard actor's, which scales the way walked
    stature_m: float = STATURE_M  # barefoot, without hair

    @classmethod
    def build(cls) -> "Mannequin":
        """Assembles the standard actor, 1.68 m tall."""
        tables = demo_table("mannequin")
        pieces = [
            (tube["bone"], _COLOUR_NAMES.index(tube["colour"]), _tube(metres(tube["rows"])))
            for tube in tables["tubes"]
        ]
        for ball in tables["balls"]:
            mesh = _ball(metres(ball["centre"]), metres(ball["radii"]))
            pieces.append((ball["bone"], _COLOUR_NAMES.index(ball["colour"]), mesh))
        pieces.append(("left_foot", SHOES, _shoe(metres(tables["shoe"]["rows"]))))
        pieces += [
            (bone.replace("left", "right"), colour, (vertices * _MIRROR, faces[:, ::-1]))
            for bone, colour, (vertices, faces) in pieces
            if bone.startswith("left")
        ]
        joints = {bone: metres(joint) for bone, joint in tables["joints"].items()}
        joints |= {
            bone.replace("left", "right"): _MIRROR * joint
            for bone, joint in joints.items()
            if bone.startswith("left")
        }
        bones, colours, meshes = zip(*pieces, strict=True)
        vertices, faces = zip(*meshes, strict=True)
        counts = [len(part) for part in vertices]
        starts = np.cumsum([0, *counts[:-1]])
        return cls(
            np.vstack(vertices),
            np.vstack(
                [part + start for part, start in zip(faces, starts, strict=True)], dtype="i4"
            ),
            np.repeat(np.array(colours, np.int32), [len(part) for part in faces]),
            np.repeat(np.array([*map(BONE_NAMES.index, bones)], np.int32), counts),
            np.array([joints[bone] for bone in BONE_NAMES]),
            metres(tables["head_top"]),
        )

    def pose(
        self, pelvis_m: NDArray[np.float64], rotations: dict[str, Rotation]
    ) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]:
        """Poses the actor so that the lower shoe stands on the floor.

        Args:
            pelvis_m: (2,) x and y of the pelvis in the world, for the standard actor's legs.
            rotations: rotation of each bone relative to its parent; missing bones stay at rest.

        Returns:
            Vertices (V, 3) in the world, and the true position (3,) of each of the 15 HumanEva
            joints.
        """
        world_from_bone, rest, origins = [], self.joints_m, np.zeros_like(self.joints_m)
        for k, (name, parent) in enumerate(zip(BONE_NAMES, _PARENTS, strict=True)):
            turn = rotations.get(name, Rotation.identity())
            world_from_bone.append(turn if parent < 0 else world_from_bone[parent] * turn)
            origins[k] = (
                (*(self.stride * pelvis_m), 0)
                if parent < 0
                else origins[parent] + world_from_bone[parent].apply(rest[k] - rest[parent])
            )
        matrices = np.stack([rotation.as_matrix() for rotation in world_from_bone])
        local = self.vertices_m - rest[self.vertex_bone]
        vertices = origins[self.vertex_bone] + np.einsum(
            "vij,vj->vi", matrices[self.vertex_bone], local
        )
        lift = np.array([0, 0, -vertices[:, 2].min()])
        joints = {name: origins[BONE_NAMES.index(bone)] + lift for name, bone in _LANDMARKS.items()}
        head = BONE_NAMES.index("head")
        joints["head_top"] = origins[head] + matrices[head] @ (self.head_top_m - rest[head]) + lift
        return vertices + lift, joints


def _loft(rings: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Triangulates rings (n, RING, 3) and closes both ends."""
    count = len(rings)
    vertices = np.vstack([rings.reshape(-1, 3), rings[0].mean(0), rings[-1].mean(0)])
    i = np.arange(RING)
    j = (i + 1) % RING
    faces = [np.column_stack([count * RING + 0 * i, j, i])]
    for row in range(0, (count - 1) * RING, RING):
        faces += [
            np.column_stack([row + i, row + j, row + RING + j]),
            np.column_stack([row + i, row + RING + j, row + RING + i]),
        ]
    last = (count - 1) * RING
    faces.append(np.column_stack([count * RING + 1 + 0 * i, last + i, last + j]))
    whole = np.vstack(faces)
    corners = vertices[whole] - vertices.mean(0)
    inside_out = (
        np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() < 0
    )
    return vertices, (whole[:, ::-1] if inside_out else whole).astype(np.int32)


def _circle() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    angle = np.arange(RING) * 2 * np.pi / RING
    return np.cos(angle), np.sin(angle)


def _tube(rows: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    cosine, sine = _circle()
    # A little squarer than an ellipse.
    square = (np.abs(cosine) ** 2.4 + np.abs(sine) ** 2.4) ** (-1 / 2.4)
    # Twice as many rings, smoothly in between, so that the outline does not show corners.
    fine = np.linspace(0, len(rows) - 1, 2 * len(rows) - 1)
    z, x, y, width, front, back = (
        np.interp(fine, np.arange(len(rows)), column)[:, None] for column in rows.T
    )
    across = x + width * square * cosine
    deep = y + np.where(sine < 0, front, back) * square * sine
    return _loft(np.stack([across, deep, np.broadcast_to(z, across.shape)], -1))


def _ball(
    centre: NDArray[np.float64], radii: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    cosine, sine = _circle()
    polar = np.linspace(0.05, np.pi - 0.05, 13)[:, None]
    unit = np.stack(
        [np.sin(polar) * cosine, np.sin(polar) * sine, np.broadcast_to(np.cos(polar), (13, RING))],
        -1,
    )
    return _loft(centre + unit * radii)


def _shoe(rows: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    cosine, sine = _circle()
    y, width, height = (column[:, None] for column in rows.T)
    flat = (np.abs(cosine) ** 3 + np.abs(sine) ** 3) ** (-1 / 3)
    across = 0.107 + width * flat * cosine
    up = 0.5 * height + 0.5 * height * flat * sine
    return _loft(np.stack([across, np.broadcast_to(y, across.shape), up], -1))
