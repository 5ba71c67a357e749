"""The demo's actor: a clothed mannequin of rigid tubes and balls.

It shares nothing with the fitted bodies: neither mesh nor skinning, other proportions (longer legs,
broader shoulders), and shirt, trousers, shoes and hair over the skin. Body frame as everywhere: z
up, facing -y, left toward +x; at rest the arms hang.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from silhouette_core.body.mesh_measurements import measure_body
from silhouette_core.body.model import BodyModel
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
_TRUNK = ("pelvis", "belly", "chest")  # bones at the girths of hip, waist and chest


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


@dataclass(frozen=True)
class Measurements:
    """Measurements of a person, metres, girths over the skin."""

    stature_m: float  # barefoot, without hair
    chest_girth_m: float
    waist_girth_m: float
    hip_girth_m: float
    legs: float = 1.0  # their length at this stature, over that of the standard actor's proportions
    arms: float = 1.0  # likewise
    shoulders: float = 1.0  # likewise the distance of their joints
    head: float = 1.0  # likewise
    cloth_m: float = 0.010  # thickness of shirt and trousers
    sole_m: float = 0.008  # thickness of the shoes' soles


def person_of(body: BodyModel) -> Measurements:
    """Stature and girths of a body; the proportions are those of the standard actor."""
    taken = measure_body(body).known()
    names = "stature_m", "chest_girth_m", "waist_girth_m", "hip_girth_m"
    return Measurements(**{name: taken[name] for name in names})


def tailor(measurements: Measurements) -> Mannequin:
    """Mannequin of the given measurements.

    Lengths are scaled along the bones. Girths at hip, waist and chest are met, and the limbs become
    thicker or thinner with them; arms hang farther out where the trunk is wide.

    Returns:
        The actor. Its joints move with the flesh around them, so that its truth stays exact.
    """
    standard = Mannequin.build()
    shape = _Shape(standard, measurements)
    points = np.vstack([standard.vertices_m, standard.joints_m, standard.head_top_m])
    bones = np.r_[standard.vertex_bone, : len(BONE_NAMES), BONE_NAMES.index("head")]
    clothed = np.zeros(len(points), bool)
    clothed[standard.faces[np.isin(standard.face_colour, (SHIRT, TROUSERS))]] = True
    for k, name in enumerate(BONE_NAMES):
        points[bones == k] = shape.moved(name, points[bones == k], clothed[bones == k])
    vertices, joints = np.split(points[:-1], [len(standard.vertices_m)])
    return replace(
        standard, vertices_m=vertices, joints_m=joints, head_top_m=points[-1], stride=shape.stride
    )


class _Shape:
    """Map from points of the standard actor to points of a person."""

    def __init__(self, standard: Mannequin, person: Measurements) -> None:
        tables = demo_table("mannequin")["tailoring"]
        self._standard_m, self._cloth_m = metres(tables["heights"]), metres(tables["cloth"])
        self._trunk_m = metres(tables["trunk_heights"])
        self._growths = {
            limb: (metres(tables[f"{limb}_heights"]), np.array(tables[f"{limb}_growth"]) / 100)
            for limb in ("leg", "arm")
        }
        self._person = person
        self._scale = person.stature_m / STATURE_M
        # Heads vary less than statures do.
        self._head = self._scale**0.4 * person.head
        _, floor, hip, neck, vertex, _ = tables["heights"]
        head = self._head * (vertex / 1000 - neck / 1000)
        legs = (person.stature_m - head) * ((hip - floor) / (neck - floor)) * person.legs
        top, sole = person.stature_m + person.sole_m, person.sole_m
        hair = float(metres(tables["hair"]))
        self.heights_m = np.array([0, sole, legs + sole, top - head, top, top + hair])
        self.stride = float(np.diff(self.heights_m)[1] / np.diff(self._standard_m)[1])
        girths = (person.hip_girth_m, person.waist_girth_m, person.chest_girth_m)
        share = np.array(tables["trunk_growth"]) / 100
        self._width, self._depth = np.array(
            [
                _scales(standard, bone, height, (girth + 2 * np.pi * person.cloth_m) / self._scale)
                for bone, height, girth in zip(_TRUNK, self._trunk_m, girths, strict=False)
            ]
        ).T[:, [0, 1, 2, 2, 2]] * share + (1 - share)
        self._joints = dict(zip(BONE_NAMES, standard.joints_m, strict=True))
        shoulder, elbow = (self._joints[f"left_{name}"] for name in ("upper_arm", "forearm"))
        self._shoulder_x = self._scale * (
            shoulder[0] * person.shoulders * (1 + 0.3 * (self._width[2] - 1))
        )
        self._shoulder_z = float(np.interp(shoulder[2], self._standard_m, self.heights_m))
        beside = self._scale * (0.165 * float(self._width[:3].max()) + 0.03) - self._shoulder_x
        upper_arm = self._scale * person.arms * (shoulder[2] - elbow[2])
        # Arms hang 8 degrees out in most key poses, and no more than 20 degrees farther.
        out = float(np.arcsin(np.clip(beside / upper_arm, 0, 1))) - np.radians(8.0)
        self._out = float(np.clip(out, 0, np.radians(20.0)))

    def moved(
        self, bone: str, points_m: NDArray[np.float64], clothed: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Moves points (n, 3) of a bone, with `clothed` (n,) the cloth over it."""
        side, name = bone.split("_", 1) if "_" in bone else ("", bone)
        mirror = np.array([-1.0 if side == "right" else 1.0, 1.0, 1.0])
        points = points_m * mirror
        if name in ("upper_arm", "forearm", "hand"):
            moved = self._arm(points, clothed)
        elif name in ("thigh", "shin", "foot"):
            moved = self._leg(points, clothed)
        else:
            growths = (
                np.interp(points[:, 2], self._trunk_m, g) for g in (self._width, self._depth)
            )
            factor = self._head if name == "head" else self._scale * np.column_stack([*growths])
            height = np.interp(points[:, 2], self._standard_m, self.heights_m)
            moved = np.column_stack([factor * points[:, :2], height])
        return moved * mirror

    def _arm(self, points: NDArray[np.float64], clothed: NDArray[np.bool_]) -> NDArray[np.float64]:
        shoulder = self._joints["left_upper_arm"]
        axis = self._axis(points[:, 2], ("hand", "forearm", "upper_arm"))
        growth = 1 + np.interp(points[:, 2], *self._growths["arm"]) * (self._width[2] - 1)
        flesh = self._offsets(points[:, :2] - axis, growth, clothed)
        across = self._scale * (axis - shoulder[:2]) + flesh
        down = self._scale * self._person.arms * (points[:, 2] - shoulder[2])
        hanging = np.column_stack([across, down])
        middle = np.array([self._shoulder_x, self._scale * shoulder[1], self._shoulder_z])
        return Rotation.from_euler("y", -self._out).apply(hanging) + middle

    def _leg(self, points: NDArray[np.float64], clothed: NDArray[np.bool_]) -> NDArray[np.float64]:
        axis = self._axis(points[:, 2], ("foot", "shin", "thigh"))
        growth = 1 + np.interp(points[:, 2], *self._growths["leg"]) * (self._width[0] - 1)
        apart = np.array([1 + 0.2 * (self._width[0] - 1), 1.0])
        flat = self._scale * apart * axis + self._offsets(points[:, :2] - axis, growth, clothed)
        return np.column_stack([flat, np.interp(points[:, 2], self._standard_m, self.heights_m)])

    def _axis(self, z: NDArray[np.float64], bones: tuple[str, ...]) -> NDArray[np.float64]:
        """Axis (n, 2) of a left limb at heights (n,), from its joints, the lowest first."""
        joints = np.array([self._joints[f"left_{bone}"] for bone in bones])
        return np.column_stack([np.interp(z, joints[:, 2], joints[:, k]) for k in (0, 1)])

    def _offsets(
        self, offset: NDArray[np.float64], growth: NDArray[np.float64], clothed: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Offsets (n, 2) from a limb's axis, thickened, with this person's cloth over it."""
        radius = np.linalg.norm(offset, axis=1)
        bare = np.where(clothed, np.maximum(radius - self._cloth_m, 0.4 * radius), radius)
        over = np.where(clothed, radius - bare, 0) * self._person.cloth_m / self._cloth_m
        target = self._scale * growth * bare + over
        return offset * (target / np.maximum(radius, 1e-9))[:, None]


def _scales(standard: Mannequin, bone: str, height_m: float, girth_m: float) -> tuple[float, float]:
    """Factors of width and depth that give the trunk a girth at a height of one of its bones."""
    tube = standard.vertices_m[standard.vertex_bone == BONE_NAMES.index(bone)][:-2]
    rings = tube.reshape(-1, RING, 3)
    ring = rings[np.abs(rings[:, 0, 2] - height_m).argmin(), :, :2]
    perimeter = np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1).sum()
    growth, (a, b) = girth_m / float(perimeter), np.ptp(ring, axis=0)
    depth = growth**1.3  # trunks grow more in depth than in width
    # The girth of a flat ellipse goes as the root of the mean square of its half axes.
    return float(np.sqrt(growth**2 * (a**2 + b**2) - (depth * b) ** 2) / a), float(depth)
