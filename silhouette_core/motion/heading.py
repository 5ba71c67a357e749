"""Headings and tilts of orientations, turns, and mirror images of motions."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from calib.checks import BoolArray, FloatArray
from silhouette_core.body.joints import LANDMARK_NAMES, exchanged_sides
from silhouette_core.motion import kinematics
from silhouette_core.motion.conditioning import quality_with_filled
from silhouette_core.motion.inverse_kinematics import Targets
from silhouette_core.motion.motion import Motion
from silhouette_core.setting_types import Limbs
from silhouette_core.tuning import RETARGETING

_ARM, _LEG = (
    "{0}_upper_arm {0}_forearm {0}_hand {0}_fingers",
    "{0}_thigh {0}_shin {0}_foot {0}_toes",
)
_CHAINS = {
    "arms": ("upper_thorax left_clavicle right_clavicle", _ARM, _ARM),
    "legs": ("pelvis", _LEG, _LEG),
}
"""Parts of limbs: those that carry both, from the trunk on, and those of either side."""


def split_heading(root_quaternion: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Heading and tilt of orientations (T, 4) w x y z, world_from_body: q = (heading about z) *
    tilt (swing-twist decomposition).

    Returns:
        Heading (T,), radians from -pi to pi, 0 for a body upside down, which has none; and tilt
        (T, 4), unit quaternions with w >= 0 and z = 0.
    """
    w, x, y, z = np.moveaxis(np.asarray(root_quaternion, float), -1, 0)
    length = np.hypot(w, z)
    upright = length > 1e-12
    cosine = np.where(upright, w / np.where(upright, length, 1), 1.0)
    sine = np.where(upright, z / np.where(upright, length, 1), 0.0)
    heading = 2 * np.arctan2(sine, cosine)
    tilt = np.stack(
        [length, cosine * x + sine * y, cosine * y - sine * x, np.zeros_like(w)], axis=-1
    )
    return np.mod(heading + np.pi, 2 * np.pi) - np.pi, tilt


def fastest_turn(motion: Motion) -> tuple[float, int]:
    """The fastest turn of the body's transverse axis from frame to frame, degrees a second, and the
    later frame's number; 0 and the first one where there is one frame only.
    """
    if len(motion) < 2:
        return 0.0, int(motion.frames[0])
    across = kinematics.rotation_matrices(motion.root_quaternion)[:, :, 0]
    cosine = np.clip((across[1:] * across[:-1]).sum(axis=1), -1, 1)
    speed = np.degrees(np.arccos(cosine)) / np.diff(motion.time_s)
    return float(speed.max()), int(motion.frames[1 + speed.argmax()])


def mirrored(motion: Motion) -> Motion:
    """Mirror image of a motion in the plane x = 0, left and right exchanged.

    The body keeps its shape; only a symmetric body becomes its mirror image.

    Returns:
        A motion whose landmarks are those of `motion`, reflected, with left and right exchanged.
    """
    model = motion.model
    other = exchanged_sides(model.tree.dof_names)
    # Angles of the two sides have the same sign (a right axis is its left one reflected); in the
    # middle, turns about y and z change theirs.
    middle = np.array([not name.startswith(("left_", "right_")) for name in model.tree.dof_names])
    sign = np.where(middle & (np.abs(model.tree.dof_axis[:, 0]) < 0.5), -1.0, 1.0)
    joints = exchanged_sides(LANDMARK_NAMES)
    columns = {"part": exchanged_sides(model.names), "landmark": joints, "joint": joints}
    return replace(
        motion,
        root_m=motion.root_m * (-1, 1, 1),
        root_quaternion=motion.root_quaternion * (1, 1, -1, -1),
        angles_rad=motion.angles_rad[:, other] * sign,
        unfiltered=None if motion.unfiltered is None else mirrored(motion.unfiltered),
        quality={
            name: array[:, columns[kind]] if (kind := name.partition("_")[0]) in columns else array
            for name, array in motion.quality.items()
        },
    )


def turned_half_round(motion: Motion, rows: BoolArray) -> Motion:
    """A person's motion as estimated whose body is, in some rows (T,) bool, turned half round about
    its long axis, every limb where that of the other side was, as far as its joints allow: left and
    right exchanged. The quality of these rows is unknown: NaN, False or 0.
    """
    tree, count = motion.model.tree, motion.model.dof_count
    other = exchanged_sides(tree.dof_names)
    # The half turn of the other side's axis is this side's, or its opposite.
    sign = np.rint((tree.dof_axis[other] * (-1, -1, 1) * tree.dof_axis).sum(axis=1))
    angles = np.clip(motion.angles_rad[:, other] * sign, *tree.dof_limits_rad.T)
    w, x, y, z = motion.root_quaternion.T
    half_round = np.column_stack([-z, y, -x, w])  # q k
    each = rows[:, None]
    turned = replace(
        motion,
        root_quaternion=np.where(each, half_round, motion.root_quaternion),
        angles_rad=np.where(np.broadcast_to(each, (len(rows), count)), angles, motion.angles_rad),
        quality=_unknown(motion, rows),
    )
    return turned.standing_at(motion.landmarks())


def limbs_exchanged(motion: Motion, rows: BoolArray, limbs: Limbs) -> Motion:
    """A person's motion as estimated whose arms or legs are, in some rows (T,) bool, each where
    that of the other side was, as far as its joints allow; the trunk stays. The quality of these
    rows is unknown: NaN, False or 0.
    """
    some, model = motion.select(np.flatnonzero(rows)), motion.model
    (rotation, origin), angles = some.parts(), motion.angles_rad.copy()
    carrying, *sides = (
        [model.names.index(part) for part in text.format(side).split()]
        for text, side in zip(_CHAINS[limbs], ("", "left", "right"), strict=True)
    )
    columns = np.flatnonzero(np.isin(model.tree.dof_part, sides))
    starts = [[side[0], *other[1:]] for side, other in (sides, sides[::-1])]
    starts_m = [origin[:, each] for each in starts]
    for _ in range(2):  # a part begins where the one before it ends, which is known after a round
        targets = Targets(model)
        for part in carrying:
            for axis in np.eye(3):
                targets.add(model.names[part], axis, rotation[:, part] @ axis, 1 / RETARGETING.rest)
        for side, other, start_m in zip(sides, sides[::-1], starts_m, strict=True):
            for k, (part, end) in enumerate(pairwise(side)):
                way = origin[:, other[k + 1]] - start_m[:, k]
                way /= np.linalg.norm(way, axis=1, keepdims=True)
                bone = model.joints_m[end] - model.joints_m[part]
                targets.add(model.names[part], bone, way, 1.0)
        angles[np.ix_(rows, columns)] = targets.angles(rotation[:, carrying[0]])[:, columns]
        placed = replace(some, angles_rad=angles[rows]).parts()[1]
        starts_m = [placed[:, side] for side in sides]
    return replace(motion, angles_rad=angles, quality=_unknown(motion, rows))


def _unknown(motion: Motion, rows: BoolArray) -> dict[str, np.ndarray]:
    """Quality of a motion without that of some rows."""
    return quality_with_filled(rows, {name: one[~rows] for name, one in motion.quality.items()})
