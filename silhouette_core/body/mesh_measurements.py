"""Measurements taken on a body's mesh at rest, as a tape takes them on a person.

Girths are those of a tape, which spans hollows: perimeters of the convex hull of a horizontal slice
through trunk and thighs, without the arms.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from calib.checks import FloatArray, IntArray
from silhouette_core.body.joints import ARM_PARTS, PART_NAMES
from silhouette_core.body.model import BodyModel, read_template

DENSITY_KG_M3 = 1000
"""Density of the whole body within its skin, the lungs' air included. Source: McConville et al.,
Anthropometric Relationships of Body and Body Segment Moments of Inertia (AFAMRL-TR-80-119, 1980),
who take 1 g/cm³ for the volumes that they measure; densities of 1.04 to 1.08, as weighing under
water gives them, leave the lungs out.
"""


@dataclass(frozen=True)
class BodyMeasurements:
    """Measurements of a person; None: not known. Metres and kilograms."""

    stature_m: float  #: from the soles to the vertex.
    chest_girth_m: float | None = None
    """At the nipples (ANSUR II and ISO 8559 chest or bust circumference)."""
    waist_girth_m: float | None = None  #: at the natural waist, between ribs and hip bone.
    hip_girth_m: float | None = None  #: The largest one (ANSUR II buttock circumference).
    arm_length_m: float | None = None  #: From the acromion over the elbow joint to the wrist joint.
    leg_length_m: float | None = None  #: From crotch to sole (ANSUR II crotch height; inside leg).
    shoulder_breadth_m: float | None = None  #: between the acromia (ANSUR II biacromial breadth).
    mass_kg: float | None = None  #: volume times `DENSITY_KG_M3`.

    def known(self) -> dict[str, float]:
        """The measurements that are known, by name."""
        pairs = ((field.name, getattr(self, field.name)) for field in fields(self))
        return {name: value for name, value in pairs if value is not None}


@dataclass(frozen=True, eq=False)
class TapeMeasure:
    """Takes measurements on bodies of one topology: the places found once on a body."""

    faces: NDArray[np.int32]  #: (F, 3) triangles.
    trunk: NDArray[np.int32]  #: (G, 3) those of trunk, head and legs.
    seam: IntArray  #: indices of the vertices in the sagittal plane.
    acromia: NDArray[np.int32]  #: (2, 3) corners of the triangles of the left and right acromion.
    acromia_weights: FloatArray  #: (2, 3) barycentric coordinates of these in them.

    @classmethod
    def of(cls, body: BodyModel) -> "TapeMeasure":
        """Finds the places on a template; other bodies have them on the same triangles."""
        vertices, joints = body.vertices_m, body.joints_m
        stature = float(np.ptp(vertices[:, 2]))
        seam = np.flatnonzero(np.abs(vertices[:, 0]) < 1e-6 * stature)
        highest_points = []
        for side, sign in (("left", 1.0), ("right", -1.0)):
            x, y, _ = joints[PART_NAMES.index(f"{side}_upper_arm")]
            # So far outward, the man's template has the mean biacromial breadth of ANSUR II.
            highest_points.append(_highest(vertices, body.faces, x + sign * 0.012 * stature, y))
        corners, weights = (np.stack(part) for part in zip(*highest_points, strict=True))
        trunk = body.faces[~np.isin(body.face_part, ARM_PARTS)]
        return cls(body.faces, trunk, seam, corners, weights)

    def measure(self, vertices_m: FloatArray, joints_m: FloatArray) -> BodyMeasurements:
        """All measurements.

        Args:
            vertices_m: (V, 3) at rest.
            joints_m: (27, 3) at rest.
        """
        z = vertices_m[:, 2]
        sole, stature = float(z.min()), float(np.ptp(z))
        middle = z[self.seam]
        crotch = float(middle[middle > sole + 0.25 * stature].min())
        lumbar = joints_m[PART_NAMES.index("lumbar"), 2]
        hips = crotch + np.linspace(0.05, 0.95, 13) * (lumbar - crotch)
        nipples = _between(joints_m, "thorax", "upper_thorax", 0.78)  # by eye on the templates
        waist = _between(joints_m, "abdomen", "thorax", 0.3)  # where the templates are narrowest
        elbow, wrist = (joints_m[PART_NAMES.index(f"left_{n}")] for n in ("forearm", "hand"))
        acromion, other = np.einsum("nk,nkj->nj", self.acromia_weights, vertices_m[self.acromia])
        return BodyMeasurements(
            stature_m=stature,
            chest_girth_m=self.girth(vertices_m, nipples),
            waist_girth_m=self.girth(vertices_m, waist),
            hip_girth_m=max(self.girth(vertices_m, height) for height in hips),
            arm_length_m=float(np.linalg.norm(elbow - acromion) + np.linalg.norm(wrist - elbow)),
            leg_length_m=crotch - sole,
            shoulder_breadth_m=float(np.linalg.norm(acromion - other)),
            mass_kg=DENSITY_KG_M3 * enclosed_volume(vertices_m, self.faces),
        )

    def girth(self, vertices_m: FloatArray, height_m: float) -> float:
        """Girth of trunk or thighs at a height: perimeter of the hull of the slice."""
        above = vertices_m[:, 2] > height_m
        first, second, third = above[self.trunk].T
        corners = self.trunk[(first != second) | (second != third)]
        points = []
        for i, j in ((0, 1), (1, 2), (2, 0)):
            cut = above[corners[:, i]] != above[corners[:, j]]
            start, end = vertices_m[corners[cut, i]], vertices_m[corners[cut, j]]
            t = (height_m - start[:, 2]) / (end[:, 2] - start[:, 2])
            points.append(start[:, :2] + t[:, None] * (end - start)[:, :2])
        return float(ConvexHull(np.concatenate(points)).area)


def measure_body(body: BodyModel) -> BodyMeasurements:
    """Measurements taken on the mesh of a body made from the templates."""
    tape = TapeMeasure.of(read_template(body.sizes.sex))
    return tape.measure(body.vertices_m, body.joints_m)


def enclosed_volume(vertices_m: FloatArray, faces: NDArray[np.int32]) -> float:
    """Volume within a closed surface, m³.

    .. math:: V = \\frac{1}{6} \\sum_f a_f \\cdot (b_f \\times c_f)

    Args:
        vertices_m: (V, 3).
        faces: (F, 3) outward oriented.
    """
    a, b, c = (vertices_m[faces[:, k]] for k in range(3))
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


def _highest(
    vertices: FloatArray, faces: NDArray[np.int32], x: float, y: float
) -> tuple[NDArray[np.int32], FloatArray]:
    """Corners (3,) of the uppermost triangle at a place, and the place's coordinates in it."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    edges = np.stack([b - a, c - a], -1)[:, :2]
    flat = np.linalg.det(edges)
    edges[np.abs(flat) < 1e-12] = np.eye(2) * 1e-9
    u, v = np.linalg.solve(edges, ([x, y] - a[:, :2])[..., None])[..., 0].T
    height = a[:, 2] + u * (b - a)[:, 2] + v * (c - a)[:, 2]
    best = int(np.where((u >= 0) & (v >= 0) & (u + v <= 1), height, -np.inf).argmax())
    return faces[best], np.array([1 - u[best] - v[best], u[best], v[best]])


def _between(joints: FloatArray, lower: str, upper: str, fraction: float) -> float:
    """Height between two joints."""
    low, high = (joints[PART_NAMES.index(name), 2] for name in (lower, upper))
    return float(low + fraction * (high - low))
