"""Sampled points of the body's surface, and their derivatives by pose and shape."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from silhouette_core.body.model import BodyModel
from silhouette_core.motion.kinematics import place_with_axes
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.refinement.kernels.refine import (
    fill_jacobian,
    fill_shape_jacobian,
    pose_surfaces,
)


@dataclass(frozen=True, eq=False)
class PosedSurface:
    """Parts, rotation axes and surface points in one pose; in K poses with a first axis of K."""

    part_rotation: np.ndarray  #: (27, 3, 3) float64, world from body, as `kinematics.forward`.
    part_origin: np.ndarray  #: (27, 3) float64, world positions of the joints, m.
    world_axis: np.ndarray
    """(D, 3) float64, angle d moves x at the rate world_axis[d] x (x - its origin)."""
    points: np.ndarray  #: (V, 3) float64, world, m.
    normals: np.ndarray  #: (V, 3) float64, unit, world.

    @property
    def placed(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Parts and axes, as the kernels take them."""
        return self.part_rotation, self.part_origin, self.world_axis

    def __getitem__(self, rows: int | slice | None) -> "PosedSurface":
        """One or some of the poses, or with None the only one as one of K; they share memory."""
        return PosedSurface(*(one[rows] for one in (*self.placed, self.points, self.normals)))


class Surface:
    """Sampled vertices of a body, with their skinning.

    Attributes:
        taken: (V,) int64, the sampled vertices.
        rest: (V, 3) float64, their positions at rest, m.
        normals: (V, 3) float64, their normals at rest.
        skin_parts: (V, 4) parts that move each vertex.
        skin_weights: (V, 4) float64, weights of those parts.
    """

    def __init__(self, model: BodyModel, count: int = 1200, taken: np.ndarray | None = None):
        """Samples `count` vertices evenly over the surface, or takes given ones."""
        self.model = model
        self.taken = _even_points(model, count) if taken is None else taken
        self.rest = np.ascontiguousarray(model.vertices_m[self.taken])
        self.normals = np.ascontiguousarray(model.vertex_normals[self.taken])
        self.skin_parts = np.ascontiguousarray(model.skin_parts[self.taken])
        self.skin_weights = np.ascontiguousarray(model.skin_weights[self.taken])

    def reshaped(self, shape: np.ndarray) -> "Surface":
        """Surface of the same vertices on the body with other shape deviations (K,)."""
        return Surface(self.model.reshaped(shape), taken=self.taken)

    def posed(self, pose: Pose) -> PosedSurface:
        """Surface in a pose."""
        return self.posed_many(PoseArrays.from_poses([pose]))[0]

    def posed_many(self, poses: PoseArrays, skinned: bool = True) -> PosedSurface:
        """Surface in K poses; without its points and normals if they are not to be `skinned`."""
        model = self.model
        rotation, origin, axis = place_with_axes(model, *poses.arrays)
        shape = (len(poses), *self.rest.shape) if skinned else (len(poses), 0, 3)
        points, normals = np.empty(shape), np.empty(shape)
        if skinned:
            pose_surfaces(
                self.rest,
                self.normals,
                model.joints_m,
                self.skin_parts,
                self.skin_weights,
                rotation,
                origin,
                points,
                normals,
            )
        return PosedSurface(rotation, origin, axis, points, normals)

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """Vertices, skinning and tree of the parts, as `add_silhouette_terms` takes them."""
        model = self.model
        tree = model.tree.descends, model.tree.dof_part
        return (self.rest, model.joints_m, self.skin_parts, self.skin_weights, *tree)

    def jacobian(self, posed: PosedSurface, index: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Derivatives (N, 6 + D) of direction (N, 3) . points[index] by a step of `Pose.moved`."""
        rest = self.rest, self.model.joints_m, self.skin_parts, self.skin_weights
        return point_jacobian(self.model, posed, rest, index, direction)

    def shape_jacobian(
        self, posed: PosedSurface, index: np.ndarray, direction: np.ndarray
    ) -> np.ndarray:
        """Derivatives (N, K) of direction (N, 3) . points[index] by the body's shape deviations."""
        space = self.model.space
        joints = space.joints_change
        origin = np.zeros_like(joints)
        for part, parent in enumerate(self.model.tree.parents):
            if parent >= 0:
                origin[:, part] = (
                    origin[:, parent]
                    + (joints[:, part] - joints[:, parent]) @ posed.part_rotation[parent].T
                )
        rows = np.empty((len(index), len(joints)))
        fill_shape_jacobian(
            index,
            direction,
            self.skin_parts,
            self.skin_weights,
            posed.part_rotation,
            self._rest_change,
            joints,
            origin,
            rows,
        )
        return rows

    @cached_property
    def _rest_change(self) -> np.ndarray:
        """Changes (V, K, 3) of the points at rest by the shape deviations."""
        return np.ascontiguousarray(self.model.space.vertices_change[:, self.taken].swapaxes(0, 1))


def point_jacobian(
    model: BodyModel,
    posed: PosedSurface,
    rest: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    index: np.ndarray,
    direction: np.ndarray,
) -> np.ndarray:
    """Derivatives (N, 6 + D) of direction (N, 3) . points[index] by a step of `Pose.moved`.

    Args:
        rest: the points (V, 3), joints (P, 3), parts (V, 4) that move each point and their weights.
        index: (N,), points.
        direction: (N, 3).
    """
    rows, tree = np.empty((len(index), 6 + model.dof_count)), model.tree
    fill_jacobian(
        index,
        direction,
        *rest,
        posed.part_rotation,
        posed.part_origin,
        tree.descends,
        tree.dof_part,
        posed.world_axis,
        rows,
    )
    return rows


def _even_points(model: BodyModel, count: int) -> np.ndarray:
    """Vertices (count,) by farthest-point sampling, started at vertex 0: even, deterministic."""
    vertices = model.vertices_m
    count = min(count, len(vertices))
    taken = np.zeros(count, np.int64)
    distance2 = np.full(len(vertices), np.inf)
    for k in range(1, count):
        distance2 = np.minimum(distance2, ((vertices - vertices[taken[k - 1]]) ** 2).sum(1))
        taken[k] = int(distance2.argmax())
    return np.sort(taken)
