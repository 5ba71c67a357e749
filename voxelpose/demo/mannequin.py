"""The demo's actor: a clothed mannequin of rigid tubes and balls.

It shares nothing with the fitted bodies: neither mesh nor skinning, other proportions (longer legs,
broader shoulders), and shirt, trousers, shoes and hair over the skin. Body frame as everywhere: z
up, facing -y, left toward +x; at rest the arms hang.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

STATURE_M = 1.68
COLOURS_BGR = np.array(
    [(150, 182, 222), (28, 34, 52), (64, 96, 178), (92, 74, 58), (40, 40, 44)], float
)
"""Skin, hair, shirt, trousers, shoes."""
SKIN, HAIR, SHIRT, TROUSERS, SHOES = range(5)

# Bone, parent bone, joint at its near end (metres, standing in shoes).
_SPINE = (
    ("pelvis", "", (0, 0, 0.970)),
    ("belly", "pelvis", (0, 0.015, 1.080)),
    ("chest", "belly", (0, 0.020, 1.250)),
    ("neck", "chest", (0, 0.000, 1.455)),
    ("head", "neck", (0, -0.020, 1.545)),
)
_LEFT = (
    ("upper_arm", "chest", (0.198, -0.005, 1.375)),
    ("forearm", "left_upper_arm", (0.205, -0.005, 1.110)),
    ("hand", "left_forearm", (0.210, -0.008, 0.865)),
    ("thigh", "pelvis", (0.095, 0.008, 0.955)),
    ("shin", "left_thigh", (0.100, -0.015, 0.515)),
    ("foot", "left_shin", (0.105, -0.005, 0.095)),
)
_MIRROR = np.array([-1.0, 1.0, 1.0])
BONES = _SPINE + tuple(
    (
        f"{side}_{name}",
        parent.replace("left", side),
        tuple(np.multiply(position, (sign, 1, 1)).tolist()),
    )
    for side, sign in (("left", 1), ("right", -1))
    for name, parent, position in _LEFT
)
BONE_NAMES = tuple(name for name, _, _ in BONES)
_PARENTS = tuple(BONE_NAMES.index(parent) if parent else -1 for _, parent, _ in BONES)
_JOINTS = np.array([position for _, _, position in BONES], float)
_LANDMARKS = {
    "pelvis": "pelvis",
    "neck": "neck",
    **{
        f"{s}_{j}": f"{s}_{b}"
        for s in ("left", "right")
        for j, b in (("hip", "thigh"), ("knee", "shin"), ("ankle", "foot"))
    },
    **{
        f"{s}_{j}": f"{s}_{b}"
        for s in ("left", "right")
        for j, b in (("shoulder", "upper_arm"), ("elbow", "forearm"), ("wrist", "hand"))
    },
}
_HEAD_TOP = np.array([0, -0.045, 1.700])

# Tubes: bone, colour, rows (height, centre x, centre y, half width, half depth to the front, to the
# back).
_TUBES = (
    (
        "pelvis",
        TROUSERS,
        (
            (0.850, 0, 0.01, 0.05, 0.05, 0.05),
            (0.880, 0, 0, 0.12, 0.09, 0.09),
            (0.930, 0, 0, 0.166, 0.106, 0.118),
            (0.990, 0, 0, 0.168, 0.106, 0.112),
            (1.060, 0, 0, 0.157, 0.102, 0.096),
            (1.110, 0, 0, 0.150, 0.100, 0.090),
        ),
    ),
    (
        "belly",
        SHIRT,
        (
            (1.005, 0, 0, 0.166, 0.110, 0.108),
            (1.030, 0, 0, 0.169, 0.116, 0.110),
            (1.110, 0, 0, 0.162, 0.114, 0.102),
            (1.200, 0, 0, 0.163, 0.114, 0.104),
            (1.290, 0, 0, 0.165, 0.112, 0.108),
            (1.330, 0, 0, 0.150, 0.095, 0.095),
        ),
    ),
    (
        "chest",
        SHIRT,
        (
            (1.180, 0, 0, 0.145, 0.100, 0.092),
            (1.240, 0, 0, 0.168, 0.116, 0.108),
            (1.330, 0, 0, 0.184, 0.118, 0.116),
            (1.390, 0, 0, 0.186, 0.108, 0.112),
            (1.425, 0, 0, 0.165, 0.092, 0.098),
            (1.455, 0, 0, 0.115, 0.074, 0.078),
            (1.485, 0, -0.01, 0.064, 0.058, 0.056),
        ),
    ),
    (
        "neck",
        SKIN,
        (
            (1.440, 0, -0.01, 0.060, 0.058, 0.056),
            (1.500, 0, -0.02, 0.056, 0.055, 0.055),
            (1.580, 0, -0.03, 0.055, 0.05, 0.06),
        ),
    ),
    (
        "left_upper_arm",
        SHIRT,
        (
            (1.442, 0.192, -0.005, 0.035, 0.040, 0.040),
            (1.420, 0.196, -0.005, 0.060, 0.064, 0.064),
            (1.370, 0.200, -0.005, 0.068, 0.070, 0.070),
            (1.300, 0.202, -0.005, 0.062, 0.064, 0.064),
            (1.200, 0.203, -0.005, 0.058, 0.060, 0.060),
            (1.195, 0.203, -0.005, 0.050, 0.050, 0.050),
        ),
    ),
    (
        "left_upper_arm",
        SKIN,
        (
            (1.230, 0.203, -0.005, 0.044, 0.047, 0.046),
            (1.160, 0.204, -0.005, 0.041, 0.043, 0.043),
            (1.110, 0.205, -0.005, 0.039, 0.040, 0.040),
            (1.075, 0.205, -0.005, 0.020, 0.020, 0.020),
        ),
    ),
    (
        "left_forearm",
        SKIN,
        (
            (1.145, 0.205, -0.005, 0.020, 0.020, 0.020),
            (1.110, 0.205, -0.005, 0.039, 0.040, 0.040),
            (1.050, 0.207, -0.007, 0.040, 0.044, 0.040),
            (0.970, 0.208, -0.008, 0.032, 0.037, 0.034),
            (0.890, 0.210, -0.008, 0.023, 0.030, 0.028),
            (0.850, 0.210, -0.008, 0.020, 0.028, 0.026),
        ),
    ),
    (
        "left_hand",
        SKIN,
        (
            (0.880, 0.210, -0.008, 0.020, 0.027, 0.025),
            (0.840, 0.210, -0.010, 0.017, 0.036, 0.034),
            (0.790, 0.210, -0.012, 0.015, 0.042, 0.038),
            (0.740, 0.206, -0.012, 0.013, 0.036, 0.034),
            (0.700, 0.200, -0.012, 0.010, 0.026, 0.026),
            (0.686, 0.198, -0.012, 0.004, 0.010, 0.010),
        ),
    ),
    (
        "left_hand",
        SKIN,
        (
            (0.850, 0.204, -0.030, 0.012, 0.012, 0.012),
            (0.810, 0.200, -0.052, 0.012, 0.012, 0.012),
            (0.770, 0.198, -0.064, 0.010, 0.010, 0.010),
            (0.755, 0.198, -0.066, 0.005, 0.005, 0.005),
        ),
    ),
    (
        "left_thigh",
        TROUSERS,
        (
            (1.010, 0.092, 0.005, 0.050, 0.055, 0.060),
            (0.960, 0.094, 0.005, 0.082, 0.094, 0.098),
            (0.860, 0.096, 0.003, 0.088, 0.098, 0.096),
            (0.720, 0.098, -0.003, 0.078, 0.086, 0.082),
            (0.580, 0.100, -0.010, 0.066, 0.072, 0.068),
            (0.515, 0.100, -0.013, 0.062, 0.066, 0.064),
            (0.465, 0.100, -0.013, 0.030, 0.030, 0.030),
        ),
    ),
    (
        "left_shin",
        TROUSERS,
        (
            (0.560, 0.100, -0.013, 0.035, 0.040, 0.035),
            (0.515, 0.100, -0.013, 0.062, 0.066, 0.064),
            (0.420, 0.101, -0.006, 0.062, 0.060, 0.076),
            (0.300, 0.103, -0.002, 0.057, 0.056, 0.068),
            (0.170, 0.104, 0.000, 0.054, 0.056, 0.062),
            (0.100, 0.105, 0.000, 0.055, 0.060, 0.064),
            (0.097, 0.105, 0.000, 0.040, 0.040, 0.040),
        ),
    ),
)
# Balls: bone, colour, centre, radii.
_BALLS = (
    ("head", SKIN, (0, -0.032, 1.605), (0.075, 0.095, 0.095)),
    ("head", SKIN, (0, -0.058, 1.548), (0.058, 0.062, 0.074)),
    ("head", SKIN, (0, -0.126, 1.580), (0.014, 0.018, 0.028)),
    ("head", HAIR, (0, -0.012, 1.622), (0.084, 0.098, 0.092)),
)
# Shoes: rows of y, half width, height above the sole.
_SHOE = (
    (0.075, 0.012, 0.030),
    (0.062, 0.034, 0.085),
    (0.030, 0.040, 0.105),
    (-0.020, 0.043, 0.110),
    (-0.070, 0.046, 0.085),
    (-0.125, 0.053, 0.064),
    (-0.165, 0.049, 0.050),
    (-0.195, 0.034, 0.038),
    (-0.208, 0.012, 0.022),
)
RING = 24
"""Vertices of each ring of a tube."""


@dataclass(frozen=True, eq=False)
class Mannequin:
    """The actor at rest.

    Attributes:
        vertices_m: (V, 3) float64.
        faces: (F, 3) int32, outward oriented; every tube and ball is closed.
        face_colour: (F,) index into `COLOURS_BGR`.
        vertex_bone: (V,) index into `BONE_NAMES`: rigid pieces, no blending.
        joints_m: (B, 3) float64, the near end of every bone.
        head_top_m: (3,) float64, the vertex of the head.
        stride: length of the legs over that of the standard actor, which scales the way walked.
    """

    vertices_m: NDArray[np.float64]
    faces: NDArray[np.int32]
    face_colour: NDArray[np.int32]
    vertex_bone: NDArray[np.int32]
    joints_m: NDArray[np.float64]
    head_top_m: NDArray[np.float64]
    stride: float = 1.0

    @classmethod
    def build(cls) -> "Mannequin":
        """Assembles the standard actor, 1.68 m tall."""
        pieces = [(bone, colour, _tube(np.array(rows, float))) for bone, colour, rows in _TUBES]
        pieces += [(bone, colour, _ball(centre, radii)) for bone, colour, centre, radii in _BALLS]
        pieces.append(("left_foot", SHOES, _shoe()))
        pieces += [
            (bone.replace("left", "right"), colour, _mirrored(*mesh))
            for bone, colour, mesh in pieces
            if bone.startswith("left")
        ]
        starts = np.cumsum([0] + [len(vertices) for _, _, (vertices, _) in pieces])
        return cls(
            np.vstack([vertices for _, _, (vertices, _) in pieces]),
            np.vstack(
                [faces + start for (_, _, (_, faces)), start in zip(pieces, starts, strict=False)]
            ).astype(np.int32),
            np.concatenate(
                [np.full(len(faces), colour) for _, colour, (_, faces) in pieces]
            ).astype(np.int32),
            np.concatenate(
                [
                    np.full(len(vertices), BONE_NAMES.index(bone))
                    for bone, _, (vertices, _) in pieces
                ]
            ).astype(np.int32),
            _JOINTS,
            _HEAD_TOP,
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
            own = rotations.get(name, Rotation.identity())
            world_from_bone.append(own if parent < 0 else world_from_bone[parent] * own)
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
    square = (np.abs(cosine) ** 2.4 + np.abs(sine) ** 2.4) ** (
        -1 / 2.4
    )  # a little squarer than an ellipse
    # Twice as many rings, smoothly in between, so that the outline does not show corners.
    fine = np.linspace(0, len(rows) - 1, 2 * len(rows) - 1)
    z, x, y, width, front, back = (
        np.interp(fine, np.arange(len(rows)), column)[:, None] for column in rows.T
    )
    across = x + width * square * cosine
    deep = y + np.where(sine < 0, front, back) * square * sine
    return _loft(np.stack([across, deep, np.broadcast_to(z, across.shape)], -1))


def _ball(
    centre: tuple[float, float, float], radii: tuple[float, float, float]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    cosine, sine = _circle()
    polar = np.linspace(0.05, np.pi - 0.05, 13)[:, None]
    unit = np.stack(
        [
            np.sin(polar) * cosine,
            np.sin(polar) * sine,
            np.broadcast_to(np.cos(polar), (13, RING)),
        ],
        -1,
    )
    return _loft(np.asarray(centre) + unit * radii)


def _shoe() -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    cosine, sine = _circle()
    y, width, height = (column[:, None] for column in np.array(_SHOE).T)
    flat = (np.abs(cosine) ** 3 + np.abs(sine) ** 3) ** (-1 / 3)
    across = 0.107 + width * flat * cosine
    up = 0.5 * height + 0.5 * height * flat * sine
    return _loft(np.stack([across, np.broadcast_to(y, across.shape), up], -1))


def _mirrored(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    return vertices * _MIRROR, faces[:, ::-1]
