"""Headings and tilts of orientations, turns, and mirror images of motions."""

from dataclasses import replace

import numpy as np

from calib.checks import BoolArray, FloatArray
from silhouette_core.body.joints import LANDMARK_NAMES, exchanged_sides
from silhouette_core.motion import kinematics
from silhouette_core.motion.conditioning import quality_with_filled
from silhouette_core.motion.motion import Motion


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
        quality=quality_with_filled(
            rows, {name: array[~rows] for name, array in motion.quality.items()}
        ),
    )
    return turned.standing_at(motion.landmarks())
