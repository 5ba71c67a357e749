"""Where is the torso? Paper B is given the root part's placement; here it is searched for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial.transform import Rotation

from silhouette_core.refinement.pose import RELAXED_RAD, Pose
from silhouette_core.scoring.backend import Backend, Voxels
from voxelpose.carving.grid import VoxelGrid
from voxelpose.matching.body_volume import BodyVolume
from voxelpose.matching.limbs import LIMBS, TORSO

_APART_M, _APART_RAD = 0.12, np.radians(40)
_UNUSUAL = 0.1  # what lying on the side costs, as a share of the torso: people mostly stand


@dataclass(frozen=True, eq=False)
class _Overlap:
    """A lump of points (n, 3), turned about its middle, and the voxels it is laid over."""

    backend: Backend
    voxels: Voxels
    points: np.ndarray
    middle: np.ndarray


def find_torso(
    body_volume: BodyVolume, grid: VoxelGrid, occupancy: np.ndarray, count: int = 8
) -> list[Pose]:
    """Finds the placements of the torso with the head that fit a hull best, in any orientation.

    The torso is the thickest part of a body, so only places deep inside the hull are tried; a torso
    fits nearly as well turned half round, so both ways are given back.

    Args:
        body_volume: the body.
        grid: the voxels' places.
        occupancy: (nx, ny, nz) bool, the voxels of one body.
        count: how many placements, at most.

    Returns: Poses with the relaxed stance's angles, best first, clearly different from one another.
        Empty for an empty hull.
    """
    depth = np.asarray(distance_transform_edt(occupancy), float)
    if not depth.max():
        return []
    voxels = Voxels(occupancy, grid.origin_m, grid.voxel_size_m)
    head = next(limb for limb in LIMBS if limb.name == "neck")
    model = body_volume.model
    points = np.concatenate(
        [
            body_volume.points[TORSO.name],
            body_volume.points["neck"] + model.joints_m[head.part] - model.joints_m[0],
        ]
    )
    middle = points.mean(0)
    coarse, fine = (
        _Overlap(body_volume.backend, voxels, np.ascontiguousarray(points[::step]), middle)
        for step in (8, 3)
    )
    places = _deep_places(grid, depth)
    rotations = _orientations()
    # Every place with every orientation, on few points; then the best again on more, and turned in
    # small steps.
    found = _score(
        coarse, np.repeat(places, len(rotations), axis=0), np.tile(rotations, (len(places), 1, 1))
    )
    best = _different(*found, 3 * count)
    refined = [_polish(fine, place, rotation) for place, rotation, _ in best]
    refined += [_polish(fine, p, r @ np.diag([-1.0, -1.0, 1.0])) for p, r, _ in refined]
    refined.sort(key=lambda item: -item[2])
    places, rotations, scores = (np.array(column) for column in zip(*refined, strict=True))
    kept = _different(places, rotations, scores, count)
    return [
        Pose(place - rotation @ middle, rotation, RELAXED_RAD.copy()) for place, rotation, _ in kept
    ]


def _deep_places(grid: VoxelGrid, depth: np.ndarray) -> np.ndarray:
    step = max(round(0.06 / grid.voxel_size_m), 1)
    deep = np.argwhere(depth > 0.6 * depth.max())
    kept = deep[(deep % step == 0).all(1)]
    return grid.centres(kept if len(kept) else deep[:1])


def _orientations() -> np.ndarray:
    turns = [
        Rotation.from_euler("zxy", [yaw, pitch, roll], degrees=True)
        for yaw in range(0, 360, 30)
        for pitch, roll in (
            (0, 0),
            (30, 0),
            (60, 0),
            (90, 0),
            (-30, 0),
            (0, 30),
            (0, -30),
            (30, 30),
            (30, -30),
            (0, 70),
            (0, -70),
            (180, 0),
        )
    ]
    return Rotation.concatenate(turns).as_matrix()


def _score(
    score: _Overlap, places: np.ndarray, rotations: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns places, rotations and scores, best first: share of points in the hull less the share
    in empty space.
    """
    inside, outside = score.backend.voxel_overlap(
        score.voxels,
        score.points,
        np.full(len(score.points), 1 / len(score.points)),
        rotations,
        places - rotations @ score.middle,
    )
    scores = inside - outside - _UNUSUAL * (1 - rotations[:, 2, 2])
    order = np.argsort(-scores, kind="stable")
    return places[order], rotations[order], scores[order]


def _polish(
    score_by: _Overlap, place: np.ndarray, rotation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    score = -np.inf
    for step_m, step_rad in ((0.04, 0.26), (0.02, 0.13)):
        shifts = step_m * np.stack(
            [g.ravel() for g in np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij")], 1
        )
        turns = Rotation.from_rotvec(
            step_rad
            * np.stack([g.ravel() for g in np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij")], 1)
        ).as_matrix()
        places = np.repeat(place + shifts, len(turns), axis=0)
        rotations = np.tile(turns @ rotation, (len(shifts), 1, 1))
        places, rotations, scores = _score(score_by, places, rotations)
        place, rotation, score = places[0], rotations[0], float(scores[0])
    return place, rotation, score


def _different(
    places: np.ndarray, rotations: np.ndarray, scores: np.ndarray, count: int
) -> list[tuple[np.ndarray, np.ndarray, float]]:
    kept: list[tuple[np.ndarray, np.ndarray, float]] = []
    for place, rotation, score in zip(places, rotations, scores, strict=True):
        if len(kept) == count:
            break
        near = (
            np.linalg.norm(place - other) < _APART_M
            and np.arccos(np.clip((np.trace(rotation.T @ turn) - 1) / 2, -1, 1)) < _APART_RAD
            for other, turn, _ in kept
        )
        if not any(near):
            kept.append((place, rotation, float(score)))
    return kept
