"""Bodies made of rigid parts: capsules, boxes and closed meshes on a kinematic tree."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calib.errors import InputError
from silhouette_core.body.kinematic_tree import Dof, KinematicTree
from silhouette_core.body.model import BodyModel

_EDGES = 50  # per extent of the body, so that the surface has vertices wherever it is touched
_FEWEST_AROUND = 12


@dataclass(frozen=True)
class Capsule:
    """A capsule, or a cone with round ends, at rest in the body frame."""

    start_m: tuple[float, float, float]  #: centre of one end.
    end_m: tuple[float, float, float]  #: centre of the other end; the same for a ball.
    radius_m: float  #: radius, at the start if the end has its own.
    end_radius_m: float | None = None  #: radius at the end; None: the same.

    @property
    def radii_m(self) -> tuple[float, float]:
        """Radii at start and end."""
        return self.radius_m, self.radius_m if self.end_radius_m is None else self.end_radius_m


@dataclass(frozen=True)
class Box:
    """A box along the axes of the body frame at rest."""

    low_m: tuple[float, float, float]  #: corner with the smallest coordinates.
    high_m: tuple[float, float, float]  #: corner with the largest coordinates.


@dataclass(frozen=True, eq=False)
class ClosedMesh:
    """A closed, outward oriented surface at rest in the body frame."""

    vertices_m: np.ndarray  #: (V, 3) float64.
    faces: np.ndarray  #: (F, 3) int.


RigidShape = Capsule | Box | ClosedMesh


def body_of_parts(
    tree: KinematicTree,
    joints_m: np.ndarray,
    shapes: Sequence[Sequence[RigidShape]],
    landmarks_m: np.ndarray | None = None,
) -> BodyModel:
    """Body whose surface is a few closed pieces, each moved by one part. Pieces may overlap. Raises
    InputError where no part has a piece, or a number is not one of a body's.

    Args:
        tree: P parts and L landmarks.
        joints_m: (P, 3) the parts' joints at rest, in the body frame (z up, facing -y).
        shapes: the pieces of each part; none for a part that only carries others.
        landmarks_m: (L, 3) the landmarks at rest; None: each at the joint of its part.
    """
    joints = np.asarray(joints_m, float)
    if joints.shape != (len(tree.names), 3) or len(shapes) != len(tree.names):
        raise InputError(
            f"the body has {len(tree.names)} parts, but {len(joints)} joints and {len(shapes)}"
            " lists of shapes: give one of each for every part"
        )
    marks = joints[tree.landmark_part] if landmarks_m is None else np.asarray(landmarks_m, float)
    edge_m = _extent(shapes) / _EDGES
    vertices, faces, parts = [], [], []
    for part, pieces in enumerate(shapes):
        for piece in pieces:
            points, triangles = _surface(piece, edge_m)
            faces.append(triangles + sum(map(len, vertices)))
            vertices.append(points)
            parts.append((part, len(points), len(triangles)))
    points = np.concatenate(vertices)
    if not all(np.isfinite(one).all() for one in (points, joints, marks)):
        raise InputError("the body's joints, landmarks or shapes hold numbers that are not finite")
    number, points_of, faces_of = np.array(parts).T
    skin = np.zeros((len(points), 4), np.int32)
    skin[:, 0] = np.repeat(number, points_of)
    weights = np.zeros((len(points), 4))
    weights[:, 0] = 1.0
    part = np.repeat(number, faces_of)
    return BodyModel.as_given(
        tree, joints, points, np.concatenate(faces), part, (skin, weights), marks
    )


def with_part(
    model: BodyModel,
    name: str,
    parent: str,
    joint_m: tuple[float, float, float],
    shapes: Sequence[RigidShape],
    ends_m: Mapping[str, tuple[float, float, float]] | None = None,
    dofs: tuple[Dof, ...] = (),
) -> BodyModel:
    """Body with one more part, such as a tool in a hand. Its shape is given from then on. Raises
    InputError where there is no such parent, the name is taken, or the shapes are none.

    Args:
        name: of the part; its joint is a landmark of that name.
        parent: the part that carries it.
        joint_m: where it is joined at rest, in the body frame.
        shapes: its pieces at rest.
        ends_m: further landmarks on it, by name.
        dofs: its degrees of freedom; none where it is held rigidly.
    """
    tree, number = model.tree, len(model.names)
    marks = {name: joint_m} | dict(ends_m or {})
    if parent not in tree.names or {name} & {*tree.names} or {*marks} & {*tree.landmark_names}:
        raise InputError(
            f"the part {name!r} cannot be joined to {parent!r}: give a new name, and a parent out"
            f" of {', '.join(tree.names)}"
        )
    carrier = tree.names.index(parent)
    near = np.linalg.norm(model.landmarks_m - np.asarray(joint_m, float), axis=1).argmin()
    first = len(tree.landmark_names)
    bones = [[near, first], *([first, first + k] for k in range(1, len(marks)))]
    larger = KinematicTree(
        (*tree.names, name),
        np.append(tree.parents, carrier).astype(np.int32),
        (*tree.dofs, *((number, dof) for dof in dofs)),
        (*tree.landmark_names, *marks),
        np.append(tree.landmark_part, [number] * len(marks)).astype(np.int32),
        np.concatenate([tree.landmark_bones.reshape(-1, 2), bones]),
        tree.root_fixed,
    )
    piece = body_of_parts(
        KinematicTree.from_parts(((name, "", ()),)), np.array([joint_m], float), [shapes]
    )
    joints = np.concatenate([model.joints_m, piece.joints_m])
    vertices = np.concatenate([model.vertices_m, piece.vertices_m])
    landmarks = np.concatenate([model.landmarks_m, np.array([*marks.values()], float)])
    skin = np.where(piece.skin_weights > 0, number, 0).astype(np.int32)
    return BodyModel.as_given(
        larger,
        joints,
        vertices,
        np.concatenate([model.faces, piece.faces + len(model.vertices_m)]),
        np.append(model.face_part, piece.face_part + number),
        (
            np.concatenate([model.skin_parts, skin]),
            np.concatenate([model.skin_weights, piece.skin_weights]),
        ),
        landmarks,
    )


def _extent(shapes: Sequence[Sequence[RigidShape]]) -> float:
    """Largest side of the box around all pieces."""
    corners = []
    for piece in (piece for pieces in shapes for piece in pieces):
        if isinstance(piece, Capsule):
            ends = np.array([piece.start_m, piece.end_m], float)
            least, most = min(piece.radii_m), max(piece.radii_m)
            if not least > 0:
                raise InputError(f"a capsule of the body has the radius {least:g} m")
            corners += [ends - most, ends + most]
        elif isinstance(piece, Box):
            ends = np.array([piece.low_m, piece.high_m], float)
            if not (ends[1] > ends[0]).all():
                raise InputError(f"a box of the body is empty: {piece.low_m} to {piece.high_m}")
            corners.append(ends)
        else:
            corners.append(np.asarray(piece.vertices_m, float))
    if not corners:
        raise InputError("no part of the body has a shape: give at least one")
    extent = float(np.ptp(np.concatenate(corners), axis=0).max())
    if not 0 < extent < np.inf:
        raise InputError(f"the body has the size {extent:g} m")
    return extent


def _surface(piece: RigidShape, edge_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) and outward oriented faces (F, 3) of a closed piece."""
    if isinstance(piece, Capsule):
        return _capsule(piece, edge_m)
    if isinstance(piece, Box):
        return _box(np.array(piece.low_m, float), np.array(piece.high_m, float), edge_m)
    return np.asarray(piece.vertices_m, float), np.asarray(piece.faces, np.int64)


def _capsule(capsule: Capsule, edge_m: float) -> tuple[np.ndarray, np.ndarray]:
    start, end = np.array(capsule.start_m, float), np.array(capsule.end_m, float)
    first, last = capsule.radii_m
    length = float(np.linalg.norm(end - start))
    axis = (end - start) / length if length > 0 else np.array([0.0, 0.0, 1.0])
    across = np.linalg.svd(axis[None])[2][1:]
    if np.linalg.det(np.stack([*across, axis])) < 0:
        across = across[::-1]
    around = max(round(2 * np.pi * max(first, last) / edge_m), _FEWEST_AROUND)
    quarter, along = max(around // 4, 3), max(int(np.ceil(length / edge_m)), 1)
    polar = np.linspace(0, np.pi / 2, quarter + 1)[1:]
    # Rings from one pole to the other: height along the axis and radius of each.
    share = np.linspace(0, 1, along + 1)
    height = np.concatenate(
        [-first * np.cos(polar[:-1]), length * share, length + last * np.sin(polar[:-1])]
    )
    radius = np.concatenate(
        [first * np.sin(polar[:-1]), first + (last - first) * share, last * np.cos(polar[:-1])]
    )
    angle = 2 * np.pi * np.arange(around) / around
    turn = np.cos(angle)[:, None] * across[0] + np.sin(angle)[:, None] * across[1]
    rings = start + height[:, None, None] * axis + radius[:, None, None] * turn
    vertices = np.concatenate(
        [(start - first * axis)[None], rings.reshape(-1, 3), [start + (length + last) * axis]]
    )
    here = np.arange(around)
    beside, faces = (here + 1) % around, []
    for ring in range(len(height) - 1):
        a, b = 1 + ring * around, 1 + (ring + 1) * around
        faces += [np.stack([a + here, a + beside, b + here], 1)]
        faces += [np.stack([a + beside, b + beside, b + here], 1)]
    top, low = len(vertices) - 1, 1 + (len(height) - 1) * around
    faces += [np.stack([np.zeros_like(here), 1 + beside, 1 + here], 1)]
    faces += [np.stack([np.full_like(here, top), low + here, low + beside], 1)]
    return vertices, np.concatenate(faces)


def _box(low: np.ndarray, high: np.ndarray, edge_m: float) -> tuple[np.ndarray, np.ndarray]:
    counts = np.maximum(np.ceil((high - low) / edge_m).astype(int), 1)
    points, faces = [], []
    for normal in range(3):
        u, v = (normal + 1) % 3, (normal + 2) % 3
        grid = np.indices((counts[u] + 1, counts[v] + 1)).reshape(2, -1).T
        number = np.arange(len(grid)).reshape(counts[u] + 1, counts[v] + 1)
        a, b, c, d = (
            part.ravel()
            for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
        )
        triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
        for side in (0, counts[normal]):
            place = np.empty((len(grid), 3), int)
            place[:, normal], place[:, u], place[:, v] = side, grid[:, 0], grid[:, 1]
            faces.append((triangles if side else triangles[:, ::-1]) + sum(map(len, points)))
            points.append(place)
    # The sides share the vertices of the edges, so that the surface is closed.
    unique, inverse = np.unique(np.concatenate(points), axis=0, return_inverse=True)
    return low + unique / counts * (high - low), inverse.reshape(-1)[np.concatenate(faces)]
