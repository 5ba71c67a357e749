"""Mannequins of people of any measurements, in the demo's clothes."""

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from silhouette_core.body.mesh_measurements import measure_body
from silhouette_core.body.model import BodyModel
from voxelpose.demo.mannequin import BONE_NAMES, RING, SHIRT, STATURE_M, TROUSERS, Mannequin, metres

_TABLES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
_TRUNK = ("pelvis", "belly", "chest")  # bones at the girths of hip, waist and chest


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
        standard,
        vertices_m=vertices,
        joints_m=joints,
        head_top_m=points[-1],
        stride=shape.stride,
        stature_m=measurements.stature_m,
    )


class _Shape:
    """Map from points of the standard actor to points of a person."""

    def __init__(self, standard: Mannequin, person: Measurements) -> None:
        tables = _TABLES
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
