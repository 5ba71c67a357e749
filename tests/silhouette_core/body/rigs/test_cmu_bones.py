"""Turns from MakeHuman's rest pose to the human tree's, on arms made up here."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from silhouette_core.body.joints import HUMAN
from silhouette_core.body.rigs.makehuman import native_dofs, turns_to_human_rest

_BEND_DEG = 30.0


def arms() -> dict[str, np.ndarray]:
    """Heads of the arms' bones, slanting down and bent forward at the elbows."""
    heads = {}
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        shoulder = np.array([0.2 * sign, 0.0, 1.4])
        along = np.array([sign * 0.8, 0.0, -0.6])
        hinge = np.cross(along, [0.0, -1.0, 0.0])
        bent = Rotation.from_rotvec(np.radians(_BEND_DEG) * hinge).apply(along)
        elbow = shoulder + 0.3 * along
        heads |= {side + "Arm": shoulder, side + "ForeArm": elbow}
        heads[side + "Hand"] = elbow + 0.25 * bent
    return heads


@pytest.mark.parametrize(("side", "sign"), [("Left", 1.0), ("Right", -1.0)])
def test_arms_are_turned_straight_and_half_down(side, sign):
    heads = arms()
    turns = turns_to_human_rest(heads)
    shoulder, elbow, wrist = (heads[side + bone] for bone in ("Arm", "ForeArm", "Hand"))
    down = np.array([sign, 0.0, -1.0]) / np.sqrt(2)
    np.testing.assert_allclose(turns[side + "Arm"] @ (elbow - shoulder), 0.3 * down, atol=1e-12)
    np.testing.assert_allclose(turns[side + "ForeArm"] @ (wrist - elbow), 0.25 * down, atol=1e-12)
    np.testing.assert_array_equal(turns["Head"], np.eye(3))


@pytest.mark.parametrize("side", ["Left", "Right"])
def test_a_bent_elbow_has_its_limits_from_where_it_is(side):
    """Straight is 30 degrees less than the rest pose: both limits are lower by so much."""
    (dof,) = (
        dof
        for dof in native_dofs(f"{side}ForeArm", f"{side}Arm", turns_to_human_rest(arms()))
        if dof.name == "flexion"
    )
    part = HUMAN.names.index(f"{side.lower()}_forearm")
    (own,) = (dof for number, dof in HUMAN.dofs if number == part and dof.name == "flexion")
    turns = turns_to_human_rest(arms())
    lower = np.array(own.limits_deg) - np.array(dof.limits_deg)
    np.testing.assert_allclose(lower, _BEND_DEG)
    assert native_dofs(f"{side}HandFinger1", f"{side}HandFinger1", turns) == ()
