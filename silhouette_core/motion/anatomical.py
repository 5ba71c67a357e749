"""Anatomical joint angles of a motion.

Segments carry the axes recommended by the International Society of Biomechanics, as far as a body
of joint centres has them: x forward, y up (from the far joint to the near one), z to the person's
right. Pelvis, thorax and head stand along the body at rest, the foot along its sole; z of thigh and
shin is the body's right and of arm, forearm and hand the axis of the elbow, orthogonalised to y. A
joint's rotation is near_from_far; on the left it is mirrored in the body's plane of symmetry, so
that a sign means the same movement on both sides. Zero is the anatomical position (upright, arms
down, palms forward) with all bones in line. It is not this body's rest pose, whose knees are bent
by a few degrees and whose arms are 45 degrees below the horizontal.

R = Rz(flexion) Rx(adduction) Ry(internal rotation) at every joint but two. The shoulder has these
angles (useless near 90 degrees of adduction or abduction) and the ISB's
Ry(plane) Rx(-elevation) Ry(axial), with plane 0 to the side and 90 forward (plane and axial
rotation are useless while the arm hangs, where only their sum is defined). The pelvis has
Ry(rotation) Rx(-obliquity) Rz(-tilt) in the world, whose meaning does not depend on the heading;
rotation is zero for a person who faces the world's +y and grows counter-clockwise seen from above.

Silhouettes hardly show turns of a limb about its own axis: rotations of straight limbs are
unreliable, and pronation is held at rest by the estimators.

Source: Grood and Suntay, "A joint coordinate system for the clinical description of
three-dimensional motions" (J. Biomech. Eng. 1983), hip, knee, ankle; Wu et al., ISB recommendation,
parts I and II (J. Biomech. 2002 and 2005); Baker, "Pelvic angles" (Gait and Posture 2001). They
define axes by epicondyles, malleoli and the spines of the pelvis; a body fitted to silhouettes has
joint centres only.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from calib.checks import FloatArray
from silhouette_core.body.joints import SIDES

if TYPE_CHECKING:
    from silhouette_core.body.model import BodyModel
    from silhouette_core.motion.motion import Motion

LAB_FROM_WORLD = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]], float)
"""Laboratory axes with y up: (x, y, z) of the world becomes (y, z, x)."""

_RIGHT = np.array([-1, 0, 0], float)
# Columns: forward, up, right, in the body frame at rest.
_UPRIGHT = np.array([[0, 0, -1], [-1, 0, 0], [0, 1, 0]], float)
_MIRROR = np.diag([1, 1, -1]).astype(float)

# Joint: the part on its near side and the part on its far side.
_CENTRAL = {"trunk": ("pelvis", "upper_thorax"), "neck": ("upper_thorax", "head")}
_PAIRED = {
    "hip": ("pelvis", "{}_thigh"),
    "knee": ("{}_thigh", "{}_shin"),
    "ankle": ("{}_shin", "{}_foot"),
    "shoulder": ("upper_thorax", "{}_upper_arm"),
    "elbow": ("{}_upper_arm", "{}_forearm"),
    "wrist": ("{}_forearm", "{}_hand"),
}

# Joint: (angle, sign) about z, x and y; None where the body has no such movement.
_ANGLES = {
    "trunk": (("flexion", -1), ("lateral_bending", 1), ("rotation", 1)),
    "neck": (("flexion", -1), ("lateral_bending", 1), ("rotation", 1)),
    "hip": (("flexion", 1), ("adduction", 1), ("internal_rotation", 1)),
    "knee": (("flexion", -1), ("adduction", 1), ("internal_rotation", 1)),
    "ankle": (("dorsiflexion", 1), ("inversion", 1), ("internal_rotation", 1)),
    "shoulder": (("flexion", 1), ("adduction", 1), ("internal_rotation", 1)),
    "elbow": (("flexion", 1), None, ("pronation", 1)),
    "wrist": (("flexion", 1), ("ulnar_deviation", 1), None),
}


@dataclass(frozen=True, eq=False)
class AnatomicalAngles:
    """Anatomical angles of a motion."""

    names: tuple[str, ...]
    """A names, such as `left_knee_flexion`. Positive angles mean the movement named; `trunk` and
    `neck` bend laterally, and `pelvis` is oblique (raised), toward the right, and they turn to the
    left."""
    degrees: FloatArray  #: (T, A) float64, -180 to 180, a row for each pose of the motion.

    def __getitem__(self, name: str) -> FloatArray:
        """One angle (T,) float64, degrees."""
        return self.degrees[:, self.names.index(name)]


def anatomical_angles(motion: Motion) -> AnatomicalAngles:
    """Anatomical angles of a motion of T poses, as defined in the module's documentation."""
    rotations = joint_rotations(motion)
    rotation, obliquity, tilt = euler_degrees(rotations["pelvis"], "YXZ").T
    columns = {"pelvis_tilt": -tilt, "pelvis_obliquity": -obliquity, "pelvis_rotation": rotation}
    for joint, matrices in rotations.items():
        side, _, kind = joint.rpartition("_")
        if kind == "pelvis":
            continue
        if kind == "shoulder":
            plane, elevation, axial = euler_degrees(matrices, "YXY").T
            # scipy turns about +x by 0 to 180, the arm rises about -x: the same rotation with the
            # outer angles half a turn on.
            columns[f"{joint}_plane_of_elevation"] = _wrapped(plane + 180)
            columns[f"{joint}_elevation"] = elevation
            columns[f"{joint}_axial_rotation"] = _wrapped(axial + 180)
        for meaning, degrees in zip(_ANGLES[kind], euler_degrees(matrices, "ZXY").T, strict=True):
            if meaning is not None:
                name, sign = meaning
                owner = f"{side}_forearm" if name == "pronation" else joint
                columns[f"{owner}_{name}"] = sign * degrees
    return AnatomicalAngles(tuple(columns), np.column_stack(list(columns.values())))


def joint_rotations(motion: Motion) -> Mapping[str, FloatArray]:
    """Rotations, at T poses, of the far side of every joint relative to the near side.

    Returns:
        (T, 3, 3) each: `pelvis` (laboratory from pelvis), `trunk`, `neck`, and `left_` and `right_`
        of hip, knee, ankle, shoulder, elbow and wrist, the left ones mirrored.
    """
    model = motion.model
    rotation, _ = motion.upright().parts()
    axes = segment_axes(model)
    axes_in_world = {name: rotation[:, model.names.index(name)] @ axes[name] for name in axes}

    def between(near: str, far: str) -> FloatArray:
        return np.swapaxes(axes_in_world[near], 1, 2) @ axes_in_world[far]

    rotations = {"pelvis": LAB_FROM_WORLD @ axes_in_world["pelvis"]}
    rotations |= {joint: between(*parts) for joint, parts in _CENTRAL.items()}
    for side in SIDES:
        for joint, (near, far) in _PAIRED.items():
            matrices = between(near.format(side), far.format(side))
            rotations[f"{side}_{joint}"] = (
                _MIRROR @ matrices @ _MIRROR if side == "left" else matrices
            )
    return rotations


def segment_axes(model: BodyModel) -> Mapping[str, FloatArray]:
    """Axes of the segments at rest by part, (3, 3): forward, up and right in the body frame."""
    joint = dict(zip(model.names, model.joints_m, strict=True))
    axes = {name: _UPRIGHT for name in ("pelvis", "upper_thorax", "head")}
    for side in SIDES:
        elbow = model.tree.dof_axis[model.tree.dof_names.index(f"{side}_forearm.flexion")]
        for part, far, right in (
            ("thigh", "shin", _RIGHT),
            ("shin", "foot", _RIGHT),
            ("upper_arm", "forearm", elbow),
            ("forearm", "hand", elbow),
            ("hand", "fingers", elbow),
        ):
            axes[f"{side}_{part}"] = _along(joint[f"{side}_{part}"] - joint[f"{side}_{far}"], right)
        forward = joint[f"{side}_toes"] - joint[f"{side}_foot"]
        sole = np.array([forward[0], forward[1], 0.0]) / np.hypot(forward[0], forward[1])
        axes[f"{side}_foot"] = np.column_stack(
            [sole, _UPRIGHT[:, 1], np.cross(sole, _UPRIGHT[:, 1])]
        )
    return axes


def euler_degrees(matrices: FloatArray, order: str) -> FloatArray:
    """Euler angles (T, 3), degrees, of rotation matrices (T, 3, 3).

    The matrices are the product of turns about the axes of `order`, from the left. In gimbal lock
    the last angle is zero.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Gimbal lock")
        return Rotation.from_matrix(matrices).as_euler(order, degrees=True)


def continuous_degrees(matrices: FloatArray) -> FloatArray:
    """Angles (T, ..., 3), degrees, about z, x and y, of rotation matrices (T, ..., 3, 3) over time,
    without jumps: of the triples that mean the same, each is the nearest to the one before it.
    """
    flat = euler_degrees(matrices.reshape(-1, 3, 3), "ZXY")
    angles = flat.reshape(*matrices.shape[:-1])
    for before, now in pairwise(angles):
        other = now * [1, -1, 1] + 180
        equivalent = np.stack([now, other])
        equivalent += 360 * np.round((before - equivalent) / 360)
        nearer = np.abs(equivalent - before).sum(axis=-1, keepdims=True).argmin(axis=0)
        now[...] = np.take_along_axis(equivalent, nearer[None], axis=0)[0]
    return angles


def _along(up: FloatArray, right: FloatArray) -> FloatArray:
    y = up / np.linalg.norm(up)
    z = right - (right @ y) * y
    z /= np.linalg.norm(z)
    return np.column_stack([np.cross(y, z), y, z])


def _wrapped(degrees: FloatArray) -> FloatArray:
    return (degrees + 180.0) % 360.0 - 180.0
