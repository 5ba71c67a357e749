"""A motion on a skeleton: our own, or one with the names and rest pose of another program."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calib.checks import FloatArray, IntArray
from calib.errors import InputError
from silhouette_core.motion.dynamics import is_person_tree
from silhouette_core.motion.kinematics import relative_rotations
from silhouette_core.motion.mocap.names import of_side
from silhouette_core.motion.motion import Motion
from silhouette_core.setting_types import SkeletonName
from voxelpose.export.skeleton import Y_UP_FROM_WORLD, part_ends

_ROOT = "root"  # a bone on the floor, below the pelvis, which is no part of ours
_TIPS = {  # where a part ends that has a direction at rest
    **{"upper_arm": "forearm", "forearm": "hand", "hand": "fingers"},
    **{"thigh": "shin", "shin": "foot", "foot": "toes"},
}
_MOST_WEIGHTS = 4  # bones that move a vertex


@dataclass(frozen=True, eq=False)
class RiggedMotion:
    """Poses of a skinned skeleton over time, metres.

    Axes: x, z, -y of the upright frame: y up. A body at rest faces z, its left hand toward x.
    """

    motion: Motion  #: What it was made of, upright: frame rate, frames, filter, faces of the skin.
    names: tuple[str, ...]  #: of the B bones.
    parents: IntArray  #: (B,) int64, the bone that carries each, before it; -1 of the first.
    rest_m: FloatArray  #: (B, 3) float64, joints at rest.
    axes: FloatArray  #: (B, 3, 3) float64, world from bone at rest.
    ends_m: FloatArray  #: (B, 3) float64, ends at rest of bones that carry none.
    vertices_m: FloatArray  #: (V, 3) float64, the skin at rest.
    skin_bones: IntArray  #: (V, 4) int64, bones that move each vertex, each of them once.
    skin_weights: FloatArray  #: (V, 4) float64, their weights, from the largest on.
    rotation: FloatArray  #: (T, B, 3, 3) float64, world from bone.
    origin_m: FloatArray  #: (T, B, 3) float64, joints.
    humanoid: bool = False  #: Whether the names are those of VRM's humanoid.

    def without_axes(self) -> "RiggedMotion":
        """The same, of bones whose axes at rest are the world's."""
        unturned = self.rotation @ np.swapaxes(self.axes, -1, -2)
        return replace(self, rotation=unturned, axes=np.broadcast_to(np.eye(3), self.axes.shape))

    def at_rest(self) -> "RiggedMotion":
        """Its rest pose, as a single frame."""
        return replace(self, rotation=self.axes[None], origin_m=self.rest_m[None])

    def local(self) -> tuple[FloatArray, FloatArray]:
        """Rotations (T, B, 3, 3) and joints (T, B, 3) relative to the bone above, in its axes."""
        places, below = self.origin_m.copy(), self.parents >= 0
        above = self.parents[below]
        apart = self.origin_m[:, below] - self.origin_m[:, above]
        places[:, below] = np.einsum("tbji,tbj->tbi", self.rotation[:, above], apart)
        return relative_rotations(self.rotation, self.parents), places

    def moving(self, places_m: FloatArray) -> NDArray[np.bool_]:
        """Bones (B,) whose places (T, B, 3) in that above are not those at rest, and the first."""
        off = np.abs(places_m - self.at_rest().local()[1]).max((0, 2))
        return (off > 1e-6) | (self.parents < 0)


def rigged(motion: Motion | RiggedMotion, skeleton: SkeletonName = "voxelpose") -> RiggedMotion:
    """A motion on a skeleton, whose joints are where ours are in every frame, and whose bones are
    turned as our parts are from one rest pose to the other. The skin follows: in our own rest pose
    it is exact, elsewhere as near as blending allows.

    Raises:
        InputError: the body is no person's, whom the skeletons of other programs are of.
    """
    if isinstance(motion, RiggedMotion):
        return motion
    motion, preset = motion.upright(), _preset(skeleton)
    model, tree = motion.model, motion.model.tree
    if preset and not is_person_tree(tree):
        raise InputError(f"the skeleton {skeleton} is a person's, this body is none: leave it out")
    # Below our parts is one more, on the floor.
    parents, known = np.r_[-1, tree.parents + 1], (_ROOT, *tree.names)
    bones = _bones(preset, known)
    parts, owner = np.array([known.index(part) for part in bones]), np.full(len(known), -1)
    for part, parent in enumerate(parents):
        listed = np.flatnonzero(parts == part)
        owner[part] = listed[0] if len(listed) else owner[parent]
    merged = replace(model, face_part=parts[owner[1:]][model.face_part] - 1)
    floor = np.zeros((1, 3))
    joints = np.concatenate([floor, model.joints_m]) @ Y_UP_FROM_WORLD.T
    ends = np.concatenate([floor, part_ends(merged)]) @ Y_UP_FROM_WORLD.T
    turns, rest = _turns(known, parents, joints, preset.get("pose", {})), joints.copy()
    for part, parent in enumerate(parents[1:], 1):
        rest[part] = rest[parent] + turns[parent] @ (joints[part] - joints[parent])
    ends = rest + np.einsum("pij,pj->pi", turns, ends - joints)
    weights = np.zeros((len(model.vertices_m), max(len(parts), _MOST_WEIGHTS)))
    rows = np.arange(len(weights))[:, None]
    np.add.at(weights, (rows, owner[model.skin_parts + 1]), model.skin_weights)
    strongest = np.argsort(-weights, axis=1, kind="stable")[:, :_MOST_WEIGHTS]
    # Where blending takes them back to their places in our rest pose exactly.
    back = np.swapaxes(turns[parts], -1, -2)
    places = joints[parts] - np.einsum("bij,bj->bi", back, rest[parts])
    blended = np.einsum("vb,bij->vij", weights[:, : len(parts)], back)
    apart = model.vertices_m @ Y_UP_FROM_WORLD.T - weights[:, : len(parts)] @ places
    vertices = np.linalg.solve(blended, apart[..., None])[..., 0]
    # A body at rest on another skeleton stands on the floor, as all of these ask for.
    lift = np.array([0.0, -vertices[:, 1].min() if preset else 0.0, 0.0])
    lifts = np.where(parts[:, None] > 0, lift, 0.0)
    axes = np.array([axes for _, axes in bones.values()])
    rotation, origin = motion.parts()
    rotation = np.insert(Y_UP_FROM_WORLD @ rotation @ Y_UP_FROM_WORLD.T, 0, np.eye(3), axis=1)
    origin = origin @ Y_UP_FROM_WORLD.T
    origin = np.concatenate([origin[:, :1] * (1, 0, 1), origin], axis=1)
    return RiggedMotion(
        motion,
        tuple(name for name, _ in bones.values()),
        np.where(parents[parts] < 0, -1, owner[parents[parts]]),
        rest[parts] + lifts,
        axes,
        ends[parts] + lifts,
        vertices + lift,
        strongest,
        np.take_along_axis(weights, strongest, 1),
        rotation[:, parts] @ back @ axes,
        origin[:, parts],
        preset.get("humanoid", False),
    )


@cache
def _preset(skeleton: str) -> dict[str, Any]:
    """The table of a skeleton, with the directions of its pose; empty: our own."""
    text = files("voxelpose.export").joinpath("skeletons.toml").read_text(encoding="utf-8")
    table = tomllib.loads(text)
    if skeleton == "voxelpose":
        return {}
    return table[skeleton] | {"pose": table["poses"][table[skeleton]["pose"]]}


def _bones(preset: Mapping[str, Any], parts: Sequence[str]) -> dict[str, tuple[str, FloatArray]]:
    """Names and axes (3, 3) at rest of a skeleton's bones by the parts that they are, in order."""
    if not preset:
        return {name: (name, np.eye(3)) for name in parts[1:]}
    bones = {}
    for part in parts:
        side, limb = _side_and_limb(part)
        if (row := preset["bones"].get(limb)) is not None:
            name, axes = (row, {}) if isinstance(row, str) else row
            turned = -1.0 if side == "right" and preset.get("turned") else 1.0
            pointing = {axis: turned * _sided(side, where) for axis, where in axes.items()}
            bones[part] = of_side(side, name), _axes(pointing)
    return bones


def _side_and_limb(part: str) -> tuple[str, str]:
    """The side, `left` in the middle, and the name without it."""
    side, _, limb = part.partition("_")
    return (side, limb) if side in ("left", "right") else ("left", part)


def _sided(side: str, direction: Sequence[float]) -> FloatArray:
    return np.array(direction, float) * (1.0 if side == "left" else -1.0, 1.0, 1.0)


def _axes(pointing: Mapping[str, FloatArray]) -> FloatArray:
    """A right-handed frame (3, 3) two of whose axes point somewhere, the first one exactly."""
    if not pointing:
        return np.eye(3)
    (one, first), (other, second) = ((("xyz").index(axis), v) for axis, v in pointing.items())
    first = first / np.linalg.norm(first)
    second = second - first * (first @ second)
    second /= np.linalg.norm(second)
    sign = 1.0 if (other - one) % 3 == 1 else -1.0
    frame = np.empty((3, 3))
    frame[:, one], frame[:, other] = first, second
    frame[:, 3 - one - other] = sign * np.cross(first, second)
    return frame


def _turns(
    parts: Sequence[str], parents: IntArray, joints: FloatArray, pose: Mapping[str, Sequence[float]]
) -> FloatArray:
    """Rotations (P, 3, 3) from our rest pose to one in which some parts have other directions."""
    turns = np.tile(np.eye(3), (len(parts), 1, 1))
    for part, name in enumerate(parts[1:], 1):
        side, limb = _side_and_limb(name)
        if limb not in pose:
            turns[part] = turns[parents[part]]
            continue
        along, target = joints[parts.index(f"{side}_{_TIPS[limb]}")] - joints[part], pose[limb]
        if len(target) == 2:  # a heading
            along, target = along * (1, 0, 1), (target[0], 0, target[1])
        target = _sided(side, target)
        normal = np.cross(along, target)
        angle = np.arctan2(np.linalg.norm(normal), along @ target)
        axis = normal / max(float(np.linalg.norm(normal)), 1e-12)
        turns[part] = Rotation.from_rotvec(angle * axis).as_matrix()
    return turns
