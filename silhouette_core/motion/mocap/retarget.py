"""From a recorded skeleton to our body.

What is carried over are directions in the world: those of the limbs' bones as they are, those of
trunk, head and shoulders as turned since the skeleton stood upright, feet as turned since they
stood flat. No rest pose of the file is believed, since zero rotations mean a T-pose in one and a
heap of bones in another: how a joint lies in its bone is read from the movement. Joint angles then
bring our parts into those directions as nearly as the joints' ranges allow; what one joint cannot
do, its neighbours take over. Freedoms that silhouettes do not show (`BodyModel.dof_fixed`) stay at
rest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.motion import kinematics
from silhouette_core.motion.inverse_kinematics import Targets, lowest_foot
from silhouette_core.motion.mocap.joint_frames import (
    SIDES,
    JointFrames,
    direction,
    find_joint_frames,
    hinge_axis,
    mean_axis,
    sole,
    unit,
    up_axis,
)
from silhouette_core.motion.mocap.skeleton import MocapClip
from silhouette_core.motion.motion import Motion

_BONES = {"upper_arm": "forearm", "forearm": "hand", "thigh": "shin", "shin": "foot"}
_HINGES = ("upper_arm", "forearm", "hand"), ("thigh", "shin", "foot")
# How much each direction counts. A limb's own turn (its hinge) is known badly and matters little
# while the limb is straight.
_BONE, _HINGE, _TRUNK, _LUMBAR, _HEAD, _CLAVICLE, _FOOT, _HAND = (
    1.0,
    0.02,
    1.0,
    0.2,
    0.3,
    0.3,
    0.03,
    0.1,
)
_X, _Y, _Z = np.eye(3)


def retarget(recorded: MocapClip, model: BodyModel, reference: JointFrames | None = None) -> Motion:
    """Moves our body as a recorded one.

    The file's up axis is the one along which the body stands on average, and goes to z; y up
    becomes x, -z, y, so that a body which faces the file's +z faces -y. Its unit is not asked for:
    places scale by the ratio of the legs' lengths. Heights are those that put our lower foot on the
    floor, or as far above it as the recorded one was in its jumps; the floor is where the recorded
    feet are lowest. A first frame that stands apart from the motion, as a T-pose put before it
    does, is left out.

    Args: recorded: the take, its joints named. model: the body. reference: the axes of its trunk,
        where another take of the skeleton shows them better; None looks into this one.

    Returns:
        The motion, at the recording's rate.
    """
    reference = reference or find_joint_frames(recorded)
    if len(recorded) > 3 and _leaps(recorded):
        recorded = recorded.posed(recorded.rotations[1:], recorded.positions[1:])
    world = _world_from_file(up_axis(recorded))
    targets = _targets(recorded, reference, model, world)
    roots = _turned(recorded, "pelvis", reference.joint_from_body["pelvis"], world)
    angles = targets.angles(roots)
    place = _scale(recorded, model) * recorded.positions[:, recorded.roles["pelvis"]] @ world.T
    quaternion = kinematics.quaternions(roots)
    place[:, 2] = _heights(recorded, model, world, quaternion, angles)
    return Motion(recorded.fps, model, place, quaternion, angles)


def _turned(recorded: MocapClip, role: str, local: NDArray, world: NDArray) -> NDArray[np.float64]:
    """Returns in our world, for each frame, what a joint carries: one axis (T, 3) or three as
    columns (T, 3, 3).
    """
    return world @ recorded.rotations[:, recorded.roles[role]] @ local


def _targets(
    recorded: MocapClip, reference: JointFrames, model: BodyModel, world: NDArray
) -> Targets:
    targets = Targets(model)
    joint = lambda name: model.joints_m[model.names.index(name)]  # noqa: E731

    def turn(name: str, role: str, axis: NDArray, weight: float) -> None:
        if role in reference.joint_from_body:
            targets.add(
                name,
                axis,
                _turned(recorded, role, reference.joint_from_body[role] @ axis, world),
                weight,
            )

    for axis in (_X, _Z):
        turn("lumbar", "lumbar", axis, _LUMBAR)
        turn("thorax", "thorax", axis, _TRUNK)
    for axis in (_Y, _Z):
        turn("neck", "head" if "head" in recorded.roles else "neck", axis, _HEAD)
    for side in SIDES:
        clavicle, hand, foot = (f"{side}_{name}" for name in ("clavicle", "hand", "foot"))
        turn(clavicle, clavicle, unit(joint(f"{side}_upper_arm") - joint(clavicle)), _CLAVICLE)
        for near, far in _BONES.items():
            own, far = f"{side}_{near}", f"{side}_{far}"
            targets.add(
                own, joint(far) - joint(own), direction(recorded, own, far) @ world.T, _BONE
            )
        for bones in _HINGES:
            own, hinge = f"{side}_{bones[0]}", hinge_axis(recorded, side, bones)
            if hinge is not None:
                flexion = model.dof_axis[model.dof_names.index(f"{side}_{bones[1]}.flexion")]
                targets.add(own, flexion, _turned(recorded, own, hinge, world), _HINGE)
        along = mean_axis(recorded, hand, direction(recorded, f"{side}_forearm", hand))
        targets.add(
            hand,
            joint(f"{side}_fingers") - joint(hand),
            _turned(recorded, hand, along, world),
            _HAND,
        )
        flat = _turned(recorded, foot, sole(recorded, side), world)
        toes = joint(f"{side}_toes") - joint(foot)
        targets.add(foot, toes * (1, 1, 0), -flat[:, :, 1], _FOOT)
        targets.add(foot, _Z, flat[:, :, 2], _FOOT)
    return targets


def _leaps(recorded: MocapClip) -> bool:
    """Tells whether the first frame stands apart: its step to the next is far longer than the steps
    that follow.
    """
    relative = recorded.positions - recorded.positions[:, :1]
    steps = np.linalg.norm(np.diff(relative[:30], axis=0), axis=2).max(axis=1)
    return steps[0] > 3 * steps[1:].max()


def _world_from_file(up: NDArray) -> NDArray[np.float64]:
    if up[2] < -0.5:
        return np.diag([1.0, -1.0, -1.0])
    return _shortest(up, _Z)


def _shortest(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    """Returns the smallest rotation (3, 3) that turns unit vector a into b."""
    cross, cosine = np.cross(a, b), float(a @ b)
    skew = np.array([[0, -cross[2], cross[1]], [cross[2], 0, -cross[0]], [-cross[1], cross[0], 0]])
    return np.eye(3) + skew + skew @ skew / max(1 + cosine, 1e-9)


def _scale(recorded: MocapClip, model: BodyModel) -> float:
    """Returns metres of our body for a unit of the file: the ratio of the legs' lengths."""
    joint, first = lambda role: model.joints_m[model.names.index(role)], recorded.positions[0]
    own = theirs = 0.0
    for side in SIDES:
        for near, far in (("thigh", "shin"), ("shin", "foot")):
            own += np.linalg.norm(joint(f"{side}_{far}") - joint(f"{side}_{near}"))
            theirs += np.linalg.norm(
                first[recorded.roles[f"{side}_{far}"]] - first[recorded.roles[f"{side}_{near}"]]
            )
    return float(own / theirs)


def _heights(
    recorded: MocapClip, model: BodyModel, world: NDArray, quaternion: NDArray, angles: NDArray
) -> NDArray[np.float64]:
    """Returns the root's height (T,) in metres."""
    joints = [
        recorded.roles[role]
        for side in SIDES
        for role in (f"{side}_foot", f"{side}_toes")
        if role in recorded.roles
    ]
    level = recorded.positions[:, joints] @ world[2]
    floor = np.percentile(level, 2, axis=0)  # each joint's own: an ankle stands higher than a toe
    scale = _scale(recorded, model)
    above = scale * (level - floor).min(axis=1)
    slack = 0.02 * model.sizes.stature_m  # the foot rolls while it stands
    return np.maximum(above - slack, 0.0) - lowest_foot(model, quaternion, angles)
