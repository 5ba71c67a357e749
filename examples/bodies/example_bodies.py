"""Example bodies other than a person's: a robot arm, a quadruped, a lamp, a person with a stick."""

from pathlib import Path

import numpy as np

from silhouette_core.body.kinematic_tree import Dof, KinematicTree
from silhouette_core.body.model import BodyModel
from silhouette_core.body.rigid_parts import Box, Capsule, RigidShape, body_of_parts, with_part
from silhouette_core.body.rigs.rig_formats import read_rig_body
from silhouette_core.body.sizes import BodySizes

_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
ROBOT_ARM = Path(__file__).with_name("robot_arm.urdf")
"""The robot arm's file."""
_Part = tuple[str, str, tuple[float, float, float], tuple[Dof, ...], list[RigidShape]]


def robot_arm() -> BodyModel:
    """Arm with six axes on a base that stands still, 1.3 m high with the arm up."""
    return read_rig_body(ROBOT_ARM)


def quadruped() -> BodyModel:
    """Four-legged animal of the size of a large dog, standing, facing -y."""
    parts: list[_Part] = [
        ("trunk", "", (0, 0.30, 0.56), (), [
            Capsule((0, 0.30, 0.56), (0, -0.28, 0.57), 0.125, 0.155)
        ]),
        ("neck", "trunk", (0, -0.36, 0.64), (
            Dof("lift", _X, (-60.0, 40.0)), Dof("turn", _Z, (-60.0, 60.0))
        ), [Capsule((0, -0.36, 0.64), (0, -0.52, 0.82), 0.085, 0.065)]),
        ("head", "neck", (0, -0.54, 0.84), (Dof("nod", _X, (-50.0, 50.0)),), [
            Capsule((0, -0.55, 0.84), (0, -0.74, 0.80), 0.075, 0.045)
        ]),
        ("tail", "trunk", (0, 0.41, 0.60), (
            Dof("lift", _X, (-80.0, 40.0)), Dof("wag", _Z, (-60.0, 60.0))
        ), [Capsule((0, 0.41, 0.60), (0, 0.72, 0.48), 0.03, 0.02)]),
    ]  # fmt: skip
    ends = {"nose": ("head", (0.0, -0.78, 0.80)), "tail_tip": ("tail", (0.0, 0.73, 0.475))}
    for name, x, y, knee in (
        ("left_fore", 0.11, -0.26, (-10.0, 110.0)),
        ("right_fore", -0.11, -0.26, (-10.0, 110.0)),
        ("left_hind", 0.11, 0.28, (-110.0, 10.0)),
        ("right_hind", -0.11, 0.28, (-110.0, 10.0)),
    ):
        parts += [
            (f"{name}_upper", "trunk", (x, y, 0.54), (
                Dof("swing", _X, (-70.0, 70.0)), Dof("spread", _Y, (-25.0, 25.0))
            ), [Capsule((x, y, 0.52), (x, y, 0.31), 0.065, 0.045)]),
            (f"{name}_lower", f"{name}_upper", (x, y, 0.29), (Dof("bend", _X, knee),), [
                Capsule((x, y, 0.29), (x, y, 0.07), 0.042, 0.032)
            ]),
            (f"{name}_paw", f"{name}_lower", (x, y, 0.05), (Dof("bend", _X, (-60.0, 60.0)),), [
                Capsule((x, y, 0.04), (x, y - 0.08, 0.035), 0.04, 0.035)
            ]),
        ]  # fmt: skip
    return _body(parts, ends)


def desk_lamp() -> BodyModel:
    """Lamp of 0.8 m with two arms and a shade, on a base that stands still."""
    parts: list[_Part] = [
        ("base", "", (0, 0, 0), (), [
            Box((-0.16, -0.16, 0.0), (0.16, 0.16, 0.05)),
            Box((-0.06, 0.10, 0.05), (0.06, 0.16, 0.11)),
        ]),
        ("lower_arm", "base", (0, 0, 0.07), (
            Dof("pitch", _X, (-60.0, 60.0)), Dof("lean", _Y, (-40.0, 40.0))
        ), [Capsule((0, 0, 0.07), (0, 0, 0.47), 0.03)]),
        ("upper_arm", "lower_arm", (0, 0, 0.50), (Dof("pitch", _X, (-70.0, 70.0)),), [
            Capsule((0, 0, 0.50), (0, -0.38, 0.50), 0.028)
        ]),
        ("shade", "upper_arm", (0, -0.41, 0.50), (Dof("pitch", _X, (-70.0, 70.0)),), [
            Capsule((0, -0.43, 0.47), (0, -0.53, 0.38), 0.04, 0.11)
        ]),
    ]  # fmt: skip
    return _body(parts, {"bulb": ("shade", (0, -0.55, 0.36))}, root_fixed=True)


def person_with_stick() -> BodyModel:
    """A person who holds a stick in the right hand."""
    person = BodyModel.from_sizes(BodySizes(1.72, None, "male"))
    x, y, z = person.joints_m[person.names.index("right_fingers")].tolist()
    shape = Capsule((x, y + 0.2, z), (x, y - 0.75, z), 0.024)
    return with_part(
        person, "stick", "right_hand", (x, y, z), [shape], {"stick_end": (x, y - 0.77, z)}
    )


def _body(
    parts: list[_Part],
    ends: dict[str, tuple[str, tuple[float, float, float]]],
    root_fixed: bool = False,
) -> BodyModel:
    tree = KinematicTree.from_parts(
        [(name, parent, dofs) for name, parent, _, dofs, _ in parts],
        {name: part for name, (part, _) in ends.items()},
        root_fixed,
    )
    joints = np.array([joint for _, _, joint, _, _ in parts], float)
    landmarks = np.concatenate([joints, [point for _, point in ends.values()]])
    return body_of_parts(tree, joints, [shapes for *_, shapes in parts], landmarks)


def spider() -> BodyModel:
    """Body of 0.3 m with four long legs around it, all of which can reach where others are."""
    parts: list[_Part] = [
        ("trunk", "", (0, 0, 0.45), (), [
            Capsule((0, 0.06, 0.45), (0, -0.10, 0.45), 0.11),
            Capsule((0, -0.20, 0.47), (0, -0.22, 0.47), 0.06),
        ]),
    ]  # fmt: skip
    ends = {}
    for name, azimuth_deg in (
        ("left_fore", -40.0), ("left_hind", 40.0), ("right_fore", -140.0), ("right_hind", 140.0)
    ):  # fmt: skip
        x, y = np.cos(np.radians(azimuth_deg)), np.sin(np.radians(azimuth_deg))

        def at(reach_m: float, height_m: float, x=x, y=y) -> tuple[float, float, float]:
            return float(reach_m * x), float(reach_m * y), height_m

        down = (float(-y), float(x), 0.0)  # a positive turn lowers the leg
        parts += [
            (f"{name}_upper", "trunk", at(0.09, 0.45), (
                Dof("swing", _Z, (-80.0, 80.0)), Dof("lift", down, (-60.0, 60.0))
            ), [Capsule(at(0.12, 0.45), at(0.42, 0.50), 0.035, 0.03)]),
            (f"{name}_lower", f"{name}_upper", at(0.44, 0.50), (
                Dof("bend", down, (-50.0, 60.0)),
            ), [Capsule(at(0.45, 0.48), at(0.56, 0.08), 0.03, 0.022)]),
        ]  # fmt: skip
        ends[f"{name}_tip"] = (f"{name}_lower", at(0.565, 0.06))
    return _body(parts, ends)
