"""What the player draws, sent once: bodies, their motion and its confidence, cameras, floor."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from calib.points import nearest_point
from silhouette_core.body.joints import PART_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.motion.kinematics import quaternions, skin
from silhouette_core.motion.motion import Motion
from voxelpose.export.skeleton import part_ends
from voxelpose.people_marks import person_colour, person_names

CONFIDENCE = {
    "right_probability": "Probability that the joints' mean error is below 80 mm",
    "pose_probability": "Probability of the pose among those that one camera leaves",
    "outline_agreement": "Agreement of body and silhouettes",
}
"""Qualities of a motion that tell how far a frame can be trusted, the first there is, in words."""
_UNKNOWN = 255  # of shares as bytes, which are from 0 to 250
_ONE = 32767  # of quaternions as 16 bits


@dataclass(frozen=True)
class Stage:
    """What stands around the bodies."""

    name: str = "motion"  #: of the result, shown as the title.
    rig: Rig | None = None
    """The cameras, in the bodies' world, z up; without distortion. None: none is shown."""
    frames: tuple[int, int] | None = None
    """(first, stop) of those that are shown; None: those that have a pose."""
    people: tuple[str, ...] = ()
    """Names of several people, one for each motion; (): they have numbers."""
    results: tuple[tuple[str, int], ...] = ()
    """Of several results side by side their names, each with the number of motions that are its
    own; (): they are of one."""

    @classmethod
    def from_cameras(cls, name: str, rig: Rig, motion: Motion) -> "Stage":
        """What stands around a motion in its own world: the cameras that recorded it."""
        upright = motion.upright_frame.rig(rig)
        return cls(name, Rig(tuple(camera.pinhole() for camera in upright)))


def player_scene(motions: Sequence[Motion], fps: float, stage: Stage) -> dict[str, Any]:
    """Everything that the player needs, as JSON can hold it.

    Args:
        motions: of everybody, upright, with at least one pose each; none: cameras alone.
        fps: frames per second.
        stage: what stands around them.
    """
    first, stop = stage.frames or (
        min(int(one.frames[0]) for one in motions),
        max(int(one.frames[-1]) for one in motions) + 1,
    )
    rows = np.arange(first, stop)
    names, result = _names(len(motions), stage)
    start_s = first / fps
    if motions:
        start_s = float(motions[0].time_s[0] + (first - motions[0].frames[0]) / fps)
    return {
        "name": stage.name,
        "corrected": ", ".join(
            dict.fromkeys(words for one in motions for words in one.corrections)
        ),
        "fps": fps,
        "first": first,
        "count": len(rows),
        "start_s": start_s,
        "cameras": [] if stage.rig is None else [_camera(camera) for camera in stage.rig],
        "bodies": [
            {
                "name": names[k],
                "result": result[k],
                "colour": person_colour(k) if names[k] else None,
                **_body(motion, rows),
            }
            for k, motion in enumerate(motions)
        ],
        **_view(motions, stage.rig, max(len(stage.results), 1)),
    }


def packed(array: NDArray[Any]) -> dict[str, str]:
    """An array as the player reads it: its type and its bytes, little-endian, in base64."""
    array = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
    return {"type": array.dtype.name, "data": base64.b64encode(array.tobytes()).decode()}


def skeleton_lines(
    model: BodyModel,
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """Lines of the skeleton: from every joint to those that hang on it, and to the ends of hands,
    feet and head; of a body that is no person's those between its landmarks, too.

    Returns:
        Parts (N,) int64 that points are fixed to, the points (N, 3) float64, m, from the joint of
        their part in the rest pose, and the points (B, 2) int64 at both ends of the lines.
    """
    parents, count = model.tree.parents, len(model.names)
    parts, local = list(range(count)), [np.zeros(3)] * count
    bones = [(int(parent), part) for part, parent in enumerate(parents) if parent >= 0]
    if model.names == PART_NAMES:
        ends = part_ends(model)
        for part in sorted(set(range(count)) - {start for start, _ in bones}):
            bones.append((part, len(parts)))
            parts.append(part)
            local.append(ends[part] - model.joints_m[part])
    else:
        marks = len(parts)
        parts += model.tree.landmark_part.tolist()
        local += list(model.landmarks_m - model.joints_m[model.tree.landmark_part])
        bones = [(marks + a, marks + b) for a, b in model.tree.landmark_bones.tolist()]
    return np.array(parts, np.int64), np.array(local), np.array(bones, np.int64).reshape(-1, 2)


def _names(count: int, stage: Stage) -> tuple[list[str], list[int]]:
    """Names of motions, none of a single one, and the number of the result that each is of."""
    if not stage.results:
        return (list(stage.people) or person_names(count) if count > 1 else [""]), [0] * count
    names, numbers = list[str](), list[int]()
    for k, (result, total) in enumerate(stage.results):
        people = stage.people[len(names) :] or (person_names(total) if total > 1 else [""])
        names += [f"{result} {person}".strip() for person in people[:total]]
        numbers += [k] * total
    return names, numbers


def _body(motion: Motion, rows: NDArray[np.int64]) -> dict[str, Any]:
    model, quality = motion.model, motion.quality
    row = np.searchsorted(motion.frames, rows)
    posed = row < len(motion)
    posed[posed] = motion.frames[row[posed]] == rows[posed]
    measure = next((key for key in CONFIDENCE if key in quality), None)
    parts, local, bones = skeleton_lines(model)
    weights = np.rint(model.skin_weights * 255)
    weights[np.arange(len(weights)), weights.argmax(1)] += 255 - weights.sum(1)
    owner = np.zeros(len(model.vertices_m), np.int64)
    owner[model.faces] = model.face_part[:, None]
    return {
        "parts": list(model.names),
        "parents": model.tree.parents.tolist(),
        "joints": packed(model.joints_m.astype(np.float32)),
        "vertices": packed(model.vertices_m.astype(np.float32)),
        "normals": packed(np.rint(model.vertex_normals * 127).astype(np.int8)),
        "faces": numbers(model.faces),
        "owner": numbers(owner),
        "skin_parts": numbers(np.where(weights > 0, model.skin_parts, 0)),
        "skin_weights": packed(weights.astype(np.uint8)),
        "rows": packed(np.where(posed, row, -1).astype(np.int32)),
        "filled": packed(motion.filled.astype(np.uint8)),
        "root": packed(motion.root_m.astype(np.float32)),
        "turn": packed(np.rint(quaternions(motion.parts()[0]) * _ONE).astype(np.int16)),
        "points_part": numbers(parts),
        "points": packed(local.astype(np.float32)),
        "bones": numbers(bones),
        "overlap": _fraction_bytes(quality.get("part_overlap")),
        "confidence": None if measure is None else _fraction_bytes(quality[measure]),
        "measure": CONFIDENCE.get(measure or "", ""),
    }


def other_poses(poses: Sequence[tuple[float, NDArray[np.float64]]]) -> list[dict[str, Any]]:
    """Other likely poses as pages draw them: those of their lines (B, 2, 3), world, m, whose `ends`
    are known, and their probability as a `share` of the likeliest one's.
    """
    likeliest = max([1e-9, *(probability for probability, _ in poses)])
    return [
        {
            "ends": packed(ends[np.isfinite(ends).all((1, 2))].astype(np.float32)),
            "share": probability / likeliest,
        }
        for probability, ends in poses
    ]


def numbers(values: NDArray[np.integer[Any]]) -> dict[str, str]:
    """Whole numbers from 0 in as few bytes as hold the largest."""
    return packed(values.astype(np.min_scalar_type(int(values.max(initial=0)))))


def _fraction_bytes(values: NDArray[np.float64] | None) -> dict[str, str] | None:
    """Fractions as bytes."""
    if values is None:
        return None
    shares = np.rint(250 * np.clip(np.nan_to_num(values), 0, 1))
    return packed(np.where(np.isfinite(values), shares, _UNKNOWN).astype(np.uint8))


def _camera(camera: Any) -> dict[str, Any]:
    matrix = camera.matrix
    return {
        "name": camera.name,
        "size": list(camera.size),
        "matrix": [float(matrix[k]) for k in ((0, 0), (1, 1), (0, 2), (1, 2))],
        "rotation": camera.rotation.ravel().tolist(),
        "translation": camera.translation.tolist(),
    }


def _view(motions: Sequence[Motion], rig: Rig | None, results: int) -> dict[str, Any]:
    """Height of the floor, what is looked at, from where: beside the first camera, which then hides
    nobody, and how far from each other results stand.
    """
    centers = np.zeros((0, 3)) if rig is None else np.array([one.center_m for one in rig])
    floor = 0.0
    if rig is not None and not motions:
        middle, size = _looked_at_m(rig), 1.8
    else:
        roots = np.concatenate([motion.root_m for motion in motions])
        middle, motion = np.median(roots, axis=0), motions[0]
        lowest = min(map(_lowest_point_m, motions))
        # Of a calibration without a floor it is anywhere: then people stand on it.
        floor = motion.floor_m if -0.1 < lowest - motion.floor_m < 0.5 else lowest
        # A person of 1.75 m is seen from 3.2 m, other bodies from as many times their extent.
        size = motion.model.extent_m / 1.75
        size += 0.4 * float(np.ptp(roots[:, :2], axis=0).max()) if len(motions) > results else 0.0
    toward = centers[0] - middle if len(centers) else np.array([0.0, -1.0, 0.0])
    beside = np.array([toward[0] - 0.4 * toward[1], toward[1] + 0.4 * toward[0], 0.0])
    beside *= 3.2 * size / max(float(np.linalg.norm(beside)), 1e-9)
    apart = 0.35 * np.cross([0.0, 0.0, 1.0], beside)
    middle = middle + 0.5 * (results - 1) * apart
    back = beside + np.array([0.0, 0.0, 0.9 * size])
    eye = middle + back * (1 + 0.25 * (results - 1))
    places = {"look_at": middle, "eye": eye, "apart": apart}
    return {"floor_m": float(floor)} | {name: place.tolist() for name, place in places.items()}


def _looked_at_m(rig: Rig) -> NDArray[np.float64]:
    """Point (3,) at 1 m height nearest to all optical axes; of one camera 3 m before it."""
    axes = np.array([camera.rotation[2] for camera in rig])
    ahead = np.array([camera.center_m for camera in rig]) + 3.0 * axes
    start = ahead.mean(axis=0)  # decides where the axes are parallel
    x, y, _ = start + nearest_point(ahead - start, axes)
    return np.array([x, y, 1.0])


def _lowest_point_m(motion: Motion) -> float:
    """Height of the lowest point of the body, m, the median over some frames."""
    rotation, origin = motion.parts()
    rows = np.unique(np.linspace(0, len(motion) - 1, 9).round().astype(int))
    return float(np.median([skin(motion.model, rotation[k], origin[k])[:, 2].min() for k in rows]))
