"""Sampled points of the body's surface, and their derivatives by pose and shape."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from silhouette_core.body.joints import PARENTS
from silhouette_core.body.model import BodyModel
from silhouette_core.motion.kernels.kinematics import place_parts_and_axes
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.kernels.refine import fill_jacobian, pose_surface


def _descends() -> np.ndarray:
    table = np.eye(len(PARENTS), dtype=bool)
    for part, parent in enumerate(PARENTS):
        if parent >= 0:
            table[:, part] |= table[:, parent]
    return table


DESCENDS = _descends()
"""(27, 27) bool: whether the second part is the first or a descendant of it."""


@dataclass(frozen=True, eq=False)
class PosedSurface:
    """Parts, rotation axes and surface points in one pose.

    Attributes:
        part_rotation: (27, 3, 3) float64, world from body, as `kinematics.forward`.
        part_origin: (27, 3) float64, world positions of the joints, m.
        world_axis: (D, 3) float64, angle d moves x at the rate world_axis[d] x (x - its origin).
        points: (V, 3) float64, world, m.
        normals: (V, 3) float64, unit, world.
    """

    part_rotation: np.ndarray
    part_origin: np.ndarray
    world_axis: np.ndarray
    points: np.ndarray
    normals: np.ndarray


class Surface:
    """Sampled vertices of a body, with their skinning.

    Attributes:
        model: the body.
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

    def reshaped(self, shape: np.ndarray) -> Surface:
        """Surface of the same vertices on the body with other shape deviations (K,)."""
        return Surface(self.model.reshaped(shape), taken=self.taken)

    def posed(self, pose: Pose) -> PosedSurface:
        """Surface in a pose."""
        model = self.model
        rotation, origin = np.empty((len(model.names), 3, 3)), np.empty((len(model.names), 3))
        axis = np.empty((model.dof_count, 3))
        place_parts_and_axes(
            model.parents,
            model.joints_m,
            model.dof_part,
            model.dof_axis,
            pose.root_rotation,
            pose.root_m,
            pose.angles_rad,
            rotation,
            origin,
            axis,
        )
        points, normals = np.empty_like(self.rest), np.empty_like(self.rest)
        pose_surface(
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

    def jacobian(self, posed: PosedSurface, index: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Derivatives (N, 6 + D) of direction (N, 3) . points[index] by a step of `Pose.moved`."""
        rows = np.empty((len(index), 6 + self.model.dof_count))
        fill_jacobian(
            index,
            direction,
            self.rest,
            self.model.joints_m,
            self.skin_parts,
            self.skin_weights,
            posed.part_rotation,
            posed.part_origin,
            DESCENDS,
            self.model.dof_part,
            posed.world_axis,
            rows,
        )
        return rows

    def shape_jacobian(
        self, posed: PosedSurface, index: np.ndarray, direction: np.ndarray
    ) -> np.ndarray:
        """Derivatives (N, K) of direction (N, 3) . points[index] by the body's shape deviations."""
        space = self.model.space
        joints = space.joints_change
        origin = np.zeros_like(joints)
        for part, parent in enumerate(PARENTS):
            if parent >= 0:
                origin[:, part] = (
                    origin[:, parent]
                    + (joints[:, part] - joints[:, parent]) @ posed.part_rotation[parent].T
                )
        vertex = self.taken[index]
        rows = np.zeros((len(index), len(joints)))
        for k in range(self.skin_parts.shape[1]):
            part, weight = self.skin_parts[index, k], self.skin_weights[index, k]
            back = np.einsum("n,ni,nij->nj", weight, direction, posed.part_rotation[part])
            change = space.vertices_change[:, vertex] - joints[:, part]
            rows += np.einsum("nj,knj->nk", back, change) + np.einsum(
                "n,ni,kni->nk", weight, direction, origin[:, part]
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
