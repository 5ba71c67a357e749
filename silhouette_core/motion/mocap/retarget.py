"""Retargeting of recorded motion to the body model.

Directions in the world are retargeted: those of the limbs' bones as recorded, those of trunk, head
and shoulders relative to the upright skeleton, feet relative to the flat sole. The file's rest pose
is not used, since zero rotations mean a T-pose in some files and nothing in others: the axes of a
joint in its bone are estimated from the movement. Joint angles then bring the parts into those
directions as nearly as the joints' ranges allow; what exceeds the range of one joint is distributed
to its neighbours. Degrees of freedom that silhouettes do not show (`KinematicTree.dof_fixed`) stay
at rest.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.checks import FloatArray
from calib.rotation import nearest_rotation
from calib.upright import UprightFrame
from silhouette_core.body.joints import SIDES
from silhouette_core.body.model import BodyModel
from silhouette_core.motion import kinematics
from silhouette_core.motion.inverse_kinematics import Targets, lowest_foot
from silhouette_core.motion.mocap.skeleton import MocapClip, place_joints
from silhouette_core.motion.motion import Motion
from silhouette_core.tuning import RETARGETING

_TRUNK = ("pelvis", "lumbar", "thorax", "neck", "head", "left_clavicle", "right_clavicle")
_BONES = {"upper_arm": "forearm", "forearm": "hand", "thigh": "shin", "shin": "foot"}
_HINGES = ("upper_arm", "forearm", "hand"), ("thigh", "shin", "foot")
_X, _Y, _Z = np.eye(3)


@dataclass(frozen=True, eq=False)
class JointFrames:
    """Axes of a trunk that stands upright and looks ahead."""

    joint_from_body: dict[str, FloatArray]
    """By role, (3, 3), the body's axes (columns: left, back, up) in the joint's axes."""
    doubt_deg: float  #: deviation from standing straight.


def retarget(recorded: MocapClip, model: BodyModel, reference: JointFrames | None = None) -> Motion:
    """Motion of a body that moves as a recorded skeleton, at the recording's rate.

    The file's up axis, along which the body stands on average, becomes z; y up becomes x, -z, y, so
    that a body that faces the file's +z faces -y. Positions are scaled by the ratio of the legs'
    lengths, whatever the file's unit. Heights put the lower foot on the floor, or as far above it
    as in the recorded jumps; the floor is where the recorded feet are lowest. A first frame apart
    from the motion, such as a T-pose, is left out.

    Args:
        recorded: the clip, with the roles of its joints.
        reference: axes of the trunk, of a clip that shows them better; None: of this one.
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


def _in_world(recorded: MocapClip, role: str, local: NDArray, world: NDArray) -> FloatArray:
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
        turn("lumbar", "lumbar", axis, RETARGETING.trunk)
        turn("thorax", "thorax", axis, 1.0)
    for axis in (_Y, _Z):
        turn("neck", "head" if "head" in recorded.roles else "neck", axis, RETARGETING.trunk)
    for side in SIDES:
        clavicle, hand, foot = (f"{side}_{name}" for name in ("clavicle", "hand", "foot"))
        collar = unit(joint(f"{side}_upper_arm") - joint(clavicle))
        turn(clavicle, clavicle, collar, RETARGETING.trunk)
        for near, far in _BONES.items():
            part, far = f"{side}_{near}", f"{side}_{far}"
            targets.add(
                part, joint(far) - joint(part), direction(recorded, part, far) @ world.T, 1.0
            )
        for bones in _HINGES:
            part, hinge = f"{side}_{bones[0]}", hinge_axis(recorded, side, bones)
            if hinge is not None:
                flexion = model.tree.dof_axis[
                    model.tree.dof_names.index(f"{side}_{bones[1]}.flexion")
                ]
                targets.add(
                    part, flexion, _in_world(recorded, part, hinge, world), RETARGETING.foot
                )
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
    model_length = recorded_length = 0.0
    for side in SIDES:
        for near, far in (("thigh", "shin"), ("shin", "foot")):
            model_length += np.linalg.norm(joint(f"{side}_{far}") - joint(f"{side}_{near}"))
            recorded_length += np.linalg.norm(
                first[recorded.roles[f"{side}_{far}"]] - first[recorded.roles[f"{side}_{near}"]]
            )
    return float(model_length / recorded_length)


def _heights(
    recorded: MocapClip, model: BodyModel, world: NDArray, quaternion: NDArray, angles: NDArray
) -> FloatArray:
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


def unit(vectors: FloatArray) -> FloatArray:
    """Vectors (…, 3) scaled to length 1."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def direction(recorded: MocapClip, near: str, far: str) -> FloatArray:
    """Unit vectors (T, 3) from one role's joint to another's."""
    return unit(
        recorded.positions[:, recorded.roles[far]] - recorded.positions[:, recorded.roles[near]]
    )


def up_axis(recorded: MocapClip) -> FloatArray:
    """Signed axis (3,) of the file that points from the feet to the shoulders on average."""
    legs = sum(
        (direction(recorded, f"{side}_foot", f"{side}_thigh") for side in SIDES), np.zeros(3)
    )
    mean = (2 * _trunk(recorded) + legs).mean(axis=0)
    axis = np.zeros(3)
    axis[np.abs(mean).argmax()] = np.sign(mean[np.abs(mean).argmax()])
    return axis


def find_joint_frames(recorded: MocapClip) -> JointFrames:
    """Axes of the trunk.

    They are those at zero rotations or in the straightest frame (many files begin with a T-pose),
    if that is straight; else the mean over the fifth of the frames whose trunk is most upright,
    which assumes that the person looks ahead on average.

    Straight means that thighs, shins and trunk are within 15 degrees of the vertical, forearms of
    their upper arms, and an arm of the other one's mirror image.
    """
    zero_rotations, zero_positions = place_joints(
        recorded.parents,
        recorded.offsets[None],
        np.broadcast_to(np.eye(3), (1, len(recorded.joints), 3, 3)),
    )
    zero = recorded.posed(zero_rotations, zero_positions)
    best: JointFrames | None = None
    for clip in (zero, recorded):
        up = up_axis(clip)
        bends = _crookedness(clip, up)
        frame = int(bends.argmin())
        if bends[frame] <= RETARGETING.straight_deg and (
            best is None or bends[frame] < best.doubt_deg
        ):
            best = _mean_axes(clip, up, np.array([frame]), float(bends[frame]))
    if best is not None:
        return best
    up = up_axis(recorded)
    lean = np.degrees(_angle(_trunk(recorded), up))
    count = max(1, round(RETARGETING.upright * len(recorded)))
    upright = np.argsort(lean, kind="stable")[:count]
    doubt_deg = RETARGETING.straight_deg + float(lean[upright].mean())
    return _mean_axes(recorded, up, upright, doubt_deg)


def hinge_axis(recorded: MocapClip, side: str, bones: tuple[str, str, str]) -> FloatArray | None:
    """Axis (3,) about which a limb bends, in the axes of its upper bone's joint.

    None if the clip hardly bends it.

    Args:
        side: "left" or "right".
        bones: roles of the limb's three joints without their side; it bends positively from the
            first bone toward the second.
    """
    near, middle, far = (f"{side}_{name}" for name in bones)
    across = np.cross(direction(recorded, near, middle), direction(recorded, middle, far))
    mean = np.einsum("tji,tj->ti", recorded.rotations[:, recorded.roles[near]], across).mean(axis=0)
    return unit(mean) if np.linalg.norm(mean) > 0.1 else None


def mean_axis(recorded: MocapClip, role: str, directions: FloatArray) -> FloatArray:
    """Axis (3,) of a joint that is nearest to given directions (T, 3) on average."""
    return unit(
        np.einsum("tji,tj->ti", recorded.rotations[:, recorded.roles[role]], directions).mean(
            axis=0
        )
    )


def sole(recorded: MocapClip, side: str) -> FloatArray:
    """Rotation joint_from_body (3, 3) of a foot, level and pointing ahead while it stands.

    It stands while ankle and toes are low.
    """
    foot, toes = f"{side}_foot", f"{side}_toes"
    up = up_axis(recorded)
    level = (
        recorded.positions[
            :, [recorded.roles[role] for role in (foot, toes) if role in recorded.roles]
        ]
        @ up
    )
    height = (level - level.min(axis=0)).max(axis=1)
    standing = height <= np.quantile(height, 0.3)
    ahead = (
        direction(recorded, foot, toes)
        if toes in recorded.roles
        else np.cross(direction(recorded, "right_thigh", "left_thigh"), up)
    )
    back = -unit(ahead - (ahead @ up)[:, None] * up)
    body = np.stack(
        [np.cross(back, np.broadcast_to(up, back.shape)), back, np.broadcast_to(up, back.shape)],
        axis=-1,
    )[standing]
    axes = np.swapaxes(recorded.rotations[standing, recorded.roles[foot]], 1, 2) @ body
    return nearest_rotation(axes.mean(axis=0))


def _mean_axes(recorded: MocapClip, up: NDArray, rows: NDArray, doubt_deg: float) -> JointFrames:
    left = direction(recorded, "right_thigh", "left_thigh")[rows]
    left = unit(left - (left @ up)[:, None] * up)
    body = np.stack([left, np.cross(up, left), np.broadcast_to(up, left.shape)], axis=-1)
    roles = {role: recorded.roles[role] for role in _TRUNK if role in recorded.roles}
    axes = {
        role: nearest_rotation(
            (np.swapaxes(recorded.rotations[rows, joint], 1, 2) @ body).mean(axis=0)
        )
        for role, joint in roles.items()
    }
    return JointFrames(axes, doubt_deg)


def _trunk(recorded: MocapClip) -> NDArray:
    place = lambda role: recorded.positions[:, recorded.roles[role]]  # noqa: E731
    return unit(
        place("left_upper_arm")
        + place("right_upper_arm")
        - place("left_thigh")
        - place("right_thigh")
    )


def _crookedness(recorded: MocapClip, up: NDArray) -> FloatArray:
    across = direction(recorded, "right_thigh", "left_thigh")
    across = unit(across - (across @ up)[:, None] * up)
    angles = [_angle(_trunk(recorded), up)]
    arms = []
    for side in SIDES:
        for near, far in (("thigh", "shin"), ("shin", "foot")):
            angles.append(_angle(direction(recorded, f"{side}_{far}", f"{side}_{near}"), up))
        arms.append(direction(recorded, f"{side}_upper_arm", f"{side}_forearm"))
        angles.append(_angle(arms[-1], direction(recorded, f"{side}_forearm", f"{side}_hand")))
    reflected = arms[1] - 2 * np.einsum("ti,ti->t", arms[1], across)[:, None] * across
    angles.append(_angle(arms[0], reflected))
    return np.degrees(np.max(angles, axis=0))


def _angle(a: NDArray, b: NDArray) -> FloatArray:
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(-1))
