"""Retargeting of recorded motion to the body model.

Directions in the world are retargeted: those of the limbs' bones as recorded, those of trunk, head
and shoulders relative to the upright skeleton, feet relative to the flat sole. The file's rest pose
is not used, since zero rotations mean a T-pose in some files and nothing in others: the axes of a
joint in its bone are estimated from the movement. Joint angles then bring the parts into those
directions as nearly as the joints' ranges allow; what exceeds the range of one joint is distributed
to its neighbours. Degrees of freedom that silhouettes do not show (`KinematicTree.dof_fixed`) stay
at rest.
"""

import numpy as np
from numpy.typing import NDArray

from calib.upright import UprightFrame
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
from silhouette_core.tuning import RETARGETING

_BONES = {"upper_arm": "forearm", "forearm": "hand", "thigh": "shin", "shin": "foot"}
_HINGES = ("upper_arm", "forearm", "hand"), ("thigh", "shin", "foot")
_X, _Y, _Z = np.eye(3)


def retarget(recorded: MocapClip, model: BodyModel, reference: JointFrames | None = None) -> Motion:
    """Motion of a body that moves as a recorded skeleton, at the recording's rate.

    The file's up axis, along which the body stands on average, becomes z; y up becomes x, -z, y, so
    that a body that faces the file's +z faces -y. Positions are scaled by the ratio of the legs'
    lengths, whatever the file's unit. Heights put the lower foot on the floor, or as far above it
    as in the recorded jumps; the floor is where the recorded feet are lowest. A first frame apart
    from the motion, such as a T-pose, is left out.

    Args:
        recorded: the clip, with the roles of its joints.
        reference: axes of the trunk, if another clip of the skeleton shows them better; None: from
            this clip.
    """
    reference = reference or find_joint_frames(recorded)
    if len(recorded) > 3 and _leaps(recorded):
        recorded = recorded.posed(recorded.rotations[1:], recorded.positions[1:])
    world = UprightFrame.from_up(up_axis(recorded)).rotation
    targets = _targets(recorded, reference, model, world)
    roots = _in_world(recorded, "pelvis", reference.joint_from_body["pelvis"], world)
    angles = targets.angles(roots)
    root_m = _scale(recorded, model) * recorded.positions[:, recorded.roles["pelvis"]] @ world.T
    quaternion = kinematics.quaternions(roots)
    root_m[:, 2] = _heights(recorded, model, world, quaternion, angles)
    return Motion(recorded.fps, model, root_m, quaternion, angles)


def _in_world(
    recorded: MocapClip, role: str, local: NDArray, world: NDArray
) -> NDArray[np.float64]:
    """One axis (T, 3) of a joint, or three as columns (T, 3, 3), in the world."""
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
                _in_world(recorded, role, reference.joint_from_body[role] @ axis, world),
                weight,
            )

    for axis in (_X, _Z):
        turn("lumbar", "lumbar", axis, RETARGETING.lumbar)
        turn("thorax", "thorax", axis, 1.0)
    for axis in (_Y, _Z):
        turn("neck", "head" if "head" in recorded.roles else "neck", axis, RETARGETING.end)
    for side in SIDES:
        clavicle, hand, foot = (f"{side}_{name}" for name in ("clavicle", "hand", "foot"))
        turn(
            clavicle, clavicle, unit(joint(f"{side}_upper_arm") - joint(clavicle)), RETARGETING.end
        )
        for near, far in _BONES.items():
            own, far = f"{side}_{near}", f"{side}_{far}"
            targets.add(own, joint(far) - joint(own), direction(recorded, own, far) @ world.T, 1.0)
        for bones in _HINGES:
            own, hinge = f"{side}_{bones[0]}", hinge_axis(recorded, side, bones)
            if hinge is not None:
                flexion = model.tree.dof_axis[
                    model.tree.dof_names.index(f"{side}_{bones[1]}.flexion")
                ]
                targets.add(own, flexion, _in_world(recorded, own, hinge, world), RETARGETING.hinge)
        along = mean_axis(recorded, hand, direction(recorded, f"{side}_forearm", hand))
        targets.add(
            hand,
            joint(f"{side}_fingers") - joint(hand),
            _in_world(recorded, hand, along, world),
            RETARGETING.hand,
        )
        flat = _in_world(recorded, foot, sole(recorded, side), world)
        toes = joint(f"{side}_toes") - joint(foot)
        targets.add(foot, toes * (1, 1, 0), -flat[:, :, 1], RETARGETING.foot)
        targets.add(foot, _Z, flat[:, :, 2], RETARGETING.foot)
    return targets


def _leaps(recorded: MocapClip) -> bool:
    """Whether the step from the first frame is far longer than the steps that follow."""
    relative = recorded.positions - recorded.positions[:, :1]
    steps = np.linalg.norm(np.diff(relative[:30], axis=0), axis=2).max(axis=1)
    return steps[0] > 3 * steps[1:].max()


def _scale(recorded: MocapClip, model: BodyModel) -> float:
    """Metres of the body model per unit of the file: the ratio of the legs' lengths."""
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
    """Height of the root (T,), m."""
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
