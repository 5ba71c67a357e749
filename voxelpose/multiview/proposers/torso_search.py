"""Search for the torso, or another root part. Paper B is given the root part's placement."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from silhouette_core.motion.dynamics import relaxed_rad
from silhouette_core.motion.pose import Pose
from silhouette_core.ranking import rounded
from silhouette_core.scoring.backend import Backend
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.matching.body_volume import BodyVolume
from voxelpose.multiview.tuning import MATCHING

_MOST_POSITIONS = 1500
_HEADS, _ROLLS = 36, 4  # directions of the head, and turns about each: 28 degrees apart at most
_STEPS = np.stack([g.ravel() for g in np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij")], 1)


@dataclass(frozen=True, eq=False)
class _Overlap:
    """The torso's points (n, 3), turned about their mean, and the voxels that they are laid on."""

    backend: Backend
    grid: VoxelGrid
    occupancy: np.ndarray
    points: np.ndarray
    middle: np.ndarray

    def ranked(
        self, positions: np.ndarray, rotations: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions, rotations and scores, best first: share of points in the hull less outside."""
        inside, outside = self.backend.voxel_overlap(
            self.grid,
            self.occupancy,
            self.points,
            np.ones(len(self.points)),  # counts, whose sums are exact
            rotations,
            positions - rotations @ self.middle,
        )
        share = (inside - outside) / len(self.points)
        scores = rounded(share - MATCHING.lying_cost * (1 - rotations[:, 2, 2]))
        order = np.argsort(-scores, kind="stable")
        return positions[order], rotations[order], scores[order]


def find_torso(
    body_volume: BodyVolume, grid: VoxelGrid, occupancy: np.ndarray, count: int = 8
) -> list[Pose]:
    """Placements of the torso with the head that fit a hull best, in any orientation; of another
    body than a person's, of its root limb.

    The torso is the thickest part of a body, so only positions deep inside the hull are tried; a
    torso fits nearly as well turned half round, so both orientations are returned. A root that
    stands still is upright.

    Args:
        occupancy: (nx, ny, nz) bool, the voxels of one body.

    Returns:
        Poses with the relaxed stance's angles, best first, clearly different from one another.
        Empty for an empty hull.
    """
    depth = np.asarray(distance_transform_edt(occupancy), float)
    if not depth.max():
        return []
    model, root = body_volume.model, body_volume.root_limb
    points = body_volume.points[root.name]
    if body_volume.is_person:
        head = body_volume.points["neck"] + model.joints_m[model.names.index("neck")]
        points = np.concatenate([points, head - model.joints_m[0]])
    middle = points.mean(0)
    coarse, fine = (
        _Overlap(body_volume.backend, grid, occupancy, np.ascontiguousarray(points[::step]), middle)
        for step in (8, 3)
    )
    inner = None if body_volume.is_person else _inner_radius(body_volume, middle)
    positions = _deep_positions(grid, depth, inner)
    rotations = _orientations(model.tree.root_fixed)
    # Every position with every orientation on few points, then the best again turned in steps;
    # only the best of those in smaller steps on more points.
    ranked = coarse.ranked(
        np.repeat(positions, len(rotations), axis=0), np.tile(rotations, (len(positions), 1, 1))
    )
    tried = [
        (position, turn)
        for position, rotation, _ in _different(*ranked, 3 * count)
        for turn in (rotation, rotation @ np.diag([-1.0, -1.0, 1.0]))
    ]
    first = [_polish(coarse, *placement, 0.04, 0.26) for placement in tried]
    best = _different(*_ranked(first), 2 * count)
    second = [_polish(fine, position, rotation, 0.02, 0.13) for position, rotation, _ in best]
    return [
        Pose(position - rotation @ middle, rotation, relaxed_rad(model.tree).copy())
        for position, rotation, _ in _different(*_ranked(second), count)
    ]


def _inner_radius(body_volume: BodyVolume, middle: np.ndarray) -> float:
    """Distance of the middle of the root limb's volume from its surface."""
    model = body_volume.model
    parts = [model.names.index(name) for name in body_volume.root_limb.parts]
    vertices = np.unique(model.faces[np.isin(model.face_part, parts)])
    distance, _ = KDTree(model.vertices_m[vertices]).query(middle + model.joints_m[0])
    return float(distance)


def _deep_positions(grid: VoxelGrid, depth: np.ndarray, inner_m: float | None) -> np.ndarray:
    step = max(round(0.06 / grid.voxel_size_m), 1)
    least = 0.6 * depth.max()
    if inner_m is not None:
        least = min(least, 0.6 * inner_m / grid.voxel_size_m)
        step = max(min(step, round(inner_m / grid.voxel_size_m)), 1)
    deep = np.argwhere(depth > least)
    if inner_m is not None:
        step = max(step, int(np.ceil((len(deep) / _MOST_POSITIONS) ** (1 / 3))))
    thinned = deep[(deep % step == 0).all(1)]
    return grid.centres(thinned if len(thinned) else deep[:1])


@cache
def _orientations(upright: bool) -> np.ndarray:
    """Orientations (N, 3, 3) in which torsos are tried first."""
    if upright:
        return Rotation.from_euler("z", np.arange(0, 360, 15)[:, None], degrees=True).as_matrix()
    leans_deg = [(0, 0), (30, 0), (60, 0), (90, 0), (-30, 0), (0, 30), (0, -30), (30, 30),
                 (30, -30), (0, 70), (0, -70), (180, 0)]  # fmt: skip
    turns_deg = [(yaw, *lean) for yaw in range(0, 360, 30) for lean in leans_deg]
    people = Rotation.from_euler("zxy", turns_deg, degrees=True)
    # How people lie, too: of turns that are even over all of them, those to which none is near, nor
    # half turned about its axis, which is tried anyway. Heads on a spiral, half a turn about each.
    number = np.repeat(np.arange(_HEADS) + 0.5, _ROLLS)
    around, tilt = number * np.pi * (3 - np.sqrt(5)), np.arccos(1 - 2 * number / _HEADS)
    rolls = np.tile(np.arange(_ROLLS) * np.pi / _ROLLS, _HEADS)
    even = Rotation.from_euler("ZYZ", np.stack([around, tilt, rolls - around], axis=1))
    both = Rotation.concatenate([people, people * Rotation.from_euler("z", np.pi)])
    lying = [
        (both.inv() * turn).magnitude().min() > np.radians(MATCHING.apart_deg) for turn in even
    ]
    return np.concatenate([people.as_matrix(), even.as_matrix()[lying]])


def _polish(
    overlap: _Overlap, position: np.ndarray, rotation: np.ndarray, step_m: float, step_rad: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """A placement moved by a step along each axis and turned by one about each, in turns."""
    turns, score = Rotation.from_rotvec(step_rad * _STEPS).as_matrix(), -np.inf
    for _ in range(2):
        same = np.broadcast_to(rotation, turns.shape)
        positions, _, _ = overlap.ranked(position + step_m * _STEPS, same)
        position = positions[0]
        same = np.broadcast_to(position, _STEPS.shape)
        _, rotations, scores = overlap.ranked(same, turns @ rotation)
        rotation, score = rotations[0], float(scores[0])
    return position, rotation, score


def _ranked(
    placements: list[tuple[np.ndarray, np.ndarray, float]],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, rotations and scores, best first."""
    placements = sorted(placements, key=lambda item: -item[2])
    positions, rotations, scores = (np.array(column) for column in zip(*placements, strict=True))
    return positions, rotations, scores


def _different(
    positions: np.ndarray, rotations: np.ndarray, scores: np.ndarray, count: int
) -> list[tuple[np.ndarray, np.ndarray, float]]:
    selected: list[int] = []
    # Turns are apart by the angle whose cosine is half of what the trace exceeds one by.
    least_trace = 1 + 2 * np.cos(np.radians(MATCHING.apart_deg))
    for k in range(len(scores)):
        if len(selected) == count:
            break
        near = np.linalg.norm(positions[selected] - positions[k], axis=1) < MATCHING.apart_m
        traces = (rotations[selected] * rotations[k]).sum((1, 2))
        if not (near & (traces > least_trace)).any():
            selected.append(k)
    return [(positions[k], rotations[k], float(scores[k])) for k in selected]
