"""Motions of a body that performs movements."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from silhouette_core.body.model import BodyModel
from silhouette_core.motion import kinematics
from silhouette_core.motion.dynamics import FPS
from silhouette_core.motion.inverse_kinematics import Targets, lowest_foot
from silhouette_core.motion.keyposes.notation import COLUMNS, LIMBS, STANDING, Movement, movements
from silhouette_core.motion.motion import Motion

_VARIANTS = 2
_SEED = 20240611
_X, _Y, _Z = np.eye(3)
_DOWN = -_Z


def keypose_motions(
    model: BodyModel, variants: int = _VARIANTS, seed: int = _SEED
) -> dict[str, Motion]:
    """Motions of the project's own movements, each as written and with variations.

    Variations are wider or narrower, slower or faster, and in another posture.

    Returns:
        Motions by name, "squat 1", …; they begin at the origin facing -y, with the lower foot on
        the floor throughout.
    """
    rng = np.random.default_rng(seed)
    return {
        f"{name} {variant + 1}": perform(_varied(movement, rng) if variant else movement, model)
        for name, movement in movements().items()
        for variant in range(variants)
    }


def perform(movement: Movement, model: BodyModel) -> Motion:
    """Motion of one movement, with the lower foot on the floor throughout.

    Args:
        movement: key poses, joined by monotone cubic curves.
    """
    times = np.arange(0, movement.times_s[-1] + 1e-9, 1 / FPS)
    curves = dict(
        zip(
            COLUMNS,
            np.asarray(PchipInterpolator(movement.times_s, movement.poses_deg)(times)).T,
            strict=True,
        )
    )
    facing = _turns(z=curves["yaw"])
    root = facing * _turns(x=curves["tip"])
    angles = _targets(curves, model, facing, root).angles(root.as_matrix())
    ahead, left = movement.speed
    root_m = np.cumsum(facing.apply((left, -ahead, 0)) / FPS, axis=0)
    quaternion = kinematics.quaternions(root.as_matrix())
    root_m[:, 2] = -lowest_foot(model, quaternion, angles)
    return Motion(FPS, model, root_m, quaternion, angles)


def _varied(movement: Movement, rng: np.random.Generator) -> Movement:
    """Variation of a movement: scaled about standing, every angle shifted, another speed."""
    width, pace = rng.uniform(0.75, 1.12), rng.uniform(0.75, 1.2)
    keep_yaw = np.where(np.array(COLUMNS) == "yaw", 1.0, width)
    poses = (
        STANDING
        + keep_yaw * (movement.poses_deg - STANDING)
        + rng.normal(0, 3.0, len(COLUMNS)) * (np.array(COLUMNS) != "yaw")
    )
    ahead, left = movement.speed
    return Movement(movement.times_s / pace, poses, (ahead * width * pace, left * width * pace))


def _targets(
    curves: dict[str, NDArray], model: BodyModel, facing: Rotation, root: Rotation
) -> Targets:
    targets = Targets(model)
    joint = lambda name: model.joints_m[model.names.index(name)]  # noqa: E731
    hinge = lambda name: model.tree.dof_axis[model.tree.dof_names.index(f"{name}.flexion")]  # noqa: E731
    waist = root * _turns(0.5 * curves["lean"], 0.5 * curves["side"], 0.4 * curves["twist"])
    chest = root * _turns(curves["lean"], curves["side"], curves["twist"])
    head = chest * _turns(
        curves["nod"] - 0.6 * curves["lean"], -0.6 * curves["side"], curves["look"]
    )
    for axis in (_X, _Z):
        targets.add("lumbar", axis, waist.apply(axis), 0.5)
        targets.add("thorax", axis, chest.apply(axis), 1.0)
        targets.add("neck", axis, head.apply(axis), 0.5)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        curve = {name: curves[f"{side[0]}.{name}"] for name in LIMBS}
        shoulder = chest * _turns(y=-sign * curve["lift"])
        collar = joint(f"{side}_upper_arm") - joint(f"{side}_clavicle")
        targets.add(
            f"{side}_clavicle", collar, shoulder.apply(collar / np.linalg.norm(collar)), 0.2
        )
        arm = chest * _swing(curve["arm"], sign * curve["out"]) * _turns(z=-sign * curve["turn"])
        thigh = (
            root * _swing(curve["hip"], sign * curve["straddle"]) * _turns(z=sign * curve["toe"])
        )
        limbs = (
            ("upper_arm", "forearm", "hand", arm, arm * _turns(-curve["elbow"]), -_X),
            ("thigh", "shin", "foot", thigh, thigh * _turns(curve["knee"]), _X),
        )
        for near, middle, far, upper, lower, axis in limbs:
            first, second, third = (f"{side}_{name}" for name in (near, middle, far))
            targets.add(first, joint(second) - joint(first), upper.apply(_DOWN), 1.0)
            targets.add(second, joint(third) - joint(second), lower.apply(_DOWN), 1.0)
            targets.add(first, hinge(second), upper.apply(axis), 0.1)
        targets.add(
            f"{side}_hand",
            joint(f"{side}_fingers") - joint(f"{side}_hand"),
            (arm * _turns(-curve["elbow"])).apply(_DOWN),
            0.1,
        )
        sole = facing * _turns(z=sign * curve["toe"]) * _turns(curve["heel"])
        targets.add(
            f"{side}_foot",
            (joint(f"{side}_toes") - joint(f"{side}_foot")) * (1, 1, 0),
            sole.apply(-_Y),
            0.1,
        )
        targets.add(f"{side}_foot", _Z, sole.apply(_Z), 0.1)
    return targets


def _turns(
    x: NDArray | float = 0.0, y: NDArray | float = 0.0, z: NDArray | float = 0.0
) -> Rotation:
    """Rotation by degrees about the fixed axes x, then y, then z."""
    angles = np.stack(np.broadcast_arrays(z, y, x), axis=-1)
    return Rotation.from_euler("ZYX", angles, degrees=True)


def _swing(forward: NDArray, left: NDArray) -> Rotation:
    """Swing of a hanging limb: one turn by the length of (forward, left), in that direction."""
    return Rotation.from_rotvec(
        np.stack([-forward, -left, np.zeros_like(forward)], axis=-1), degrees=True
    )
