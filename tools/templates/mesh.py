"""Closed, mirror-symmetric triangle meshes from the measures of figures."""

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from skimage.measure import marching_cubes

from tools.templates.figures import ARM, ARM_UP, Figure
from tools.templates.implicit import Ellipsoid, Lattice, Loft, Solid, smooth_union, union_values
from tools.templates.remesh import Field, Remesher, fill_out

FORWARD, UP = (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)
CHEST_HEIGHT = 0.728
"""Height of the chest girth: at the nipples, under the armpits of the rest pose."""
ARM_REACH, LEG_REACH = 0.026, 0.022
FINE = (
    ((0.0, -0.030, 0.930), 0.080, 0.0125),
    ((0.0, -0.090, 0.915), 0.024, 0.0075),
    ((0.046, -0.020, 0.923), 0.020, 0.0080),
    ("left_hand", 0.030, 0.0100),
    ("left_fingers", 0.060, 0.0095),
    ("left_foot", 0.045, 0.0130),
    ("left_toes", 0.060, 0.0115),
    ("left_forearm", 0.045, 0.0140),
    ("left_shin", 0.050, 0.0155),
    ("left_upper_arm", 0.060, 0.0160),
)
"""Position or joint, distance from it, edge length there."""
Group = list[tuple[Solid, float]]


def trunk(figure: Figure, width: float) -> Group:
    """Trunk, neck and head; `width` scales the sections of the chest, and less those below it."""
    axis = ((0, 0, 0), (0, 0, 1), FORWARD)
    scales = [1 + (width - 1) * min(max((row[0] - 0.60) / 0.10, 0.0), 1.0) for row in figure.trunk]
    wide = [
        (row[0], *(r * scale for r in row[1:]))
        for row, scale in zip(figure.trunk, scales, strict=True)
    ]
    group: Group = [(Loft(*axis, wide, power=2.25), 0.0)]
    for x, y, z, *radii, reach in figure.lumps:
        scale = width if z > 0.70 else 1.0
        group.append((Ellipsoid((x * scale, y * scale, z), (radii[0], radii[1], radii[2])), reach))
    shoulder = figure.joints["left_upper_arm"]
    slope = [
        (0.0, 0.028, 0.026, 0.024, 0.026),
        (0.6, 0.026, 0.026, 0.026, 0.028),
        (1.0, 0.024, 0.024, 0.026, 0.028),
    ]
    group.append(
        (
            Loft((0.018, 0.002, 0.838), shoulder + np.array([0.002, 0.004, 0.002]), FORWARD, slope),
            0.030,
        )
    )
    group.append((Loft((0, -0.006, 0.832), (0, -0.021, 0.912), FORWARD, figure.neck), 0.022))
    return group + head(figure)


def head(figure: Figure) -> Group:
    """Skull, face with nose and jaw, and ears."""
    across, along = figure.head
    face = (
        (0.8675, 0.010, 0.010, 0.012, 0.020),
        (0.872, 0.019, 0.019, 0.021, 0.030),
        (0.882, 0.027, 0.027, 0.0255, 0.030),
        (0.896, 0.0325, 0.0325, 0.0265, 0.030),
        (0.915, 0.0375, 0.0375, 0.0270, 0.030),
        (0.935, 0.0395, 0.0395, 0.0265, 0.030),
        (0.955, 0.0390, 0.0390, 0.0270, 0.030),
        (0.972, 0.0330, 0.0330, 0.0210, 0.030),
    )
    scaled = [(row[0], row[1] * across, row[2] * across, row[3] * along, row[4]) for row in face]
    return [
        (Ellipsoid((0, -0.0265, 0.9435), (0.0445 * across, 0.0575 * along, 0.0565)), 0.012),
        (Loft((0, -0.056, 0), (0, -0.056, 1), FORWARD, scaled, power=2.3), 0.010),
        (
            Loft(
                (0, -0.080, 0.938),
                (0, -0.0895, 0.911),
                FORWARD,
                ((0, 0.0045, 0.0045, 0.004, 0.01), (1, 0.009, 0.009, 0.006, 0.01)),
            ),
            0.006,
        ),
        (Ellipsoid((0.0455 * across, -0.020, 0.923), (0.0055, 0.0115, 0.0175)), 0.004),
    ]


def arm(figure: Figure) -> Group:
    """Left arm with hand and thumb."""
    joints = figure.joints
    shoulder, elbow, wrist = (joints[f"left_{name}"] for name in ("upper_arm", "forearm", "hand"))
    root = joints["left_thumb"] - 0.004 * ARM
    tip = wrist + 0.066 * ARM + 0.040 * ARM_UP + np.array([0, -0.008, 0])
    thumb = (
        (0.0, 0.0110, 0.0110, 0.0100, 0.0090),
        (0.35, 0.0120, 0.0120, 0.0110, 0.0100),
        (0.6, 0.0100, 0.0100, 0.0092, 0.0088),
        (0.85, 0.0098, 0.0098, 0.0082, 0.0080),
        (1.0, 0.0055, 0.0055, 0.0045, 0.0045),
    )
    return [
        (Loft(shoulder, elbow, FORWARD, figure.upper_arm), 0.0),
        (Loft(elbow, wrist, FORWARD, figure.forearm_flesh), 0.0),
        (Loft(wrist, wrist + 0.109 * ARM, FORWARD, figure.hand, power=2.3), 0.001),
        (Loft(root, tip, FORWARD, thumb), 0.010),
    ]


def leg(figure: Figure) -> Group:
    """Left leg with the foot."""
    knee, ankle, toes = (figure.joints[f"left_{name}"] for name in ("shin", "foot", "toes"))
    ahead = toes - ankle
    ahead = np.array([ahead[0], ahead[1], 0]) / np.hypot(ahead[0], ahead[1])
    heel = np.array([ankle[0], ankle[1], 0.010]) - 0.034 * ahead
    return [
        (Loft(figure.thigh_top, knee, FORWARD, figure.thigh), 0.0),
        (Loft(knee, ankle, FORWARD, figure.shin), 0.001),
        (Loft(heel, heel + 0.1525 * ahead, UP, figure.foot, power=2.4), 0.014),
    ]


def body_field(figure: Figure, width: float) -> Field:
    """Signed function of the left half of the body."""
    groups = [trunk(figure, width), arm(figure), leg(figure)]

    def field(points: NDArray[np.floating]) -> NDArray[np.floating]:
        body, arms, legs = (union_values(group, points) for group in groups)
        return np.maximum(
            smooth_union(smooth_union(body, arms, ARM_REACH), legs, LEG_REACH), -points[:, 2]
        )

    return field


def half_mesh(
    figure: Figure, spacing: float, width: float
) -> tuple[NDArray[np.floating], NDArray[np.int32]]:
    """Mesh of the left half (x >= 0), open at the plane x = 0, in units of stature."""
    origin = np.array([0.0, -0.16, -2 * spacing])
    size = np.ceil((np.array([0.43, 0.10, 1.01]) - origin) / spacing).astype(int) + 1
    lattice = Lattice(origin, spacing, (int(size[0]), int(size[1]), int(size[2])))
    margin = 0.045
    body = smooth_union(
        lattice.sample(trunk(figure, width), margin), lattice.sample(arm(figure), margin), ARM_REACH
    )
    body = smooth_union(body, lattice.sample(leg(figure), margin), LEG_REACH)
    below_floor = -(origin[2] + spacing * np.arange(size[2]))
    vertices, faces, _, _ = marching_cubes(
        np.maximum(body, below_floor), 0.0, spacing=(spacing,) * 3
    )
    return vertices + origin, np.ascontiguousarray(faces, np.int32)


def edge_length(figure: Figure, points: NDArray[np.floating]) -> NDArray[np.floating]:
    """Target edge length at points, in units of stature: shorter where flesh is thin or bends."""
    length = np.full(len(points), 0.0185)
    for position, reach, fine in FINE:
        middle = figure.joints[position] if isinstance(position, str) else np.array(position)
        near = np.linalg.norm(points - middle, axis=1) / reach
        length = np.minimum(length, fine + (0.0185 - fine) * np.clip((near - 0.7) / 0.6, 0, 1))
    return length


def mirror_mesh(
    vertices: NDArray[np.floating], faces: NDArray[np.int32]
) -> tuple[NDArray[np.floating], NDArray[np.int32]]:
    """Left half and its mirror image as one mesh; the vertices of the seam at x = 0 are shared."""
    seam = np.abs(vertices[:, 0]) < 1e-6
    vertices = np.where(seam[:, None], vertices * [0, 1, 1], vertices)
    twin = np.where(seam, np.arange(len(vertices)), 0)
    twin[~seam] = len(vertices) + np.arange(np.count_nonzero(~seam))
    both = np.vstack([vertices, vertices[~seam] * [-1, 1, 1]])
    return both, np.vstack([faces, twin[faces][:, ::-1]]).astype(np.int32)


def girth(vertices: NDArray[np.floating], faces: NDArray[np.int32], height: float) -> float:
    """Girth of the trunk at a height: perimeter of the hull of the slice around the middle."""
    section = trimesh.Trimesh(vertices, faces, process=False).section([0, 0, 1], [0, 0, height])
    if section is None:
        raise ValueError(f"nothing to measure at height {height}")
    loops = [loop[:, :2] for loop in section.discrete]
    return float(
        max(ConvexHull(loop).area for loop in loops if loop[:, 0].min() < 0 < loop[:, 0].max())
    )


def body_mesh(
    figure: Figure, triangles: int, spacing: float
) -> tuple[NDArray[np.floating], NDArray[np.int32]]:
    """Surface of a figure.

    Args:
        figure: measures of the body.
        triangles: approximate number of triangles.
        spacing: spacing of the sampling lattice, in units of stature.

    Returns:
        Vertices (V, 3) float64 in units of stature and faces (F, 3) int32, closed, outward
        oriented, mirror-symmetric.
    """
    target, width = figure.chest_girth_m / figure.stature_m, 1.0
    for _ in range(3):  # the girth is almost proportional to the trunk's width
        width *= target / girth(*mirror_mesh(*half_mesh(figure, 2 * spacing, width)), CHEST_HEIGHT)
    field = body_field(figure, width)
    scale = 1.0
    remesher = Remesher(
        *half_mesh(figure, 2 * spacing, width), field, lambda p: scale * edge_length(figure, p)
    )
    for passes in (4, 3, 3):
        remesher.run(passes)
        scale *= float(np.sqrt(2 * len(remesher.faces) / triangles))
    vertices, faces = remesher.arrays()
    border = np.abs(vertices[:, 0]) < 1e-9
    vertices = fill_out(vertices, faces, border, field)
    vertices, faces = mirror_mesh(vertices, faces)
    if trimesh.Trimesh(vertices, faces, process=False).volume < 0:
        faces = faces[:, ::-1]
    low, high = vertices[:, 2].min(), vertices[:, 2].max()
    vertices[:, 2] -= low
    return vertices / (high - low), np.ascontiguousarray(faces)
