"""Draws the positive directions of the joint angles: `python -m docs.figures.angle_signs` writes
docs/images/angle_signs.png.

Nothing about signs is stated here: each pose is searched for which `anatomical_angles` gives the
number under the picture, and the arrow is the path of a point of the body on the way there.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from docs.figures.drawing import INK, POSITIVE, QUIET, arrow, blank, centred, save
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.motion import kinematics
from silhouette_core.motion.anatomical import anatomical_angles
from silhouette_core.motion.motion import Motion
from voxelpose.view.images.canvas import Image
from voxelpose.view.images.hull_picture import shaded_view

FRONT, LEFT_SIDE = -90.0, 0.0  # azimuths of the viewer, degrees
_SIZE = (236, 300)
_STEPS = 13
_DOFS = {
    "trunk": ("lumbar.", "thorax."),
    "neck": ("neck.",),
    "hip": ("thigh.",),
    "knee": ("shin.",),
    "ankle": ("foot.",),
    "shoulder": ("upper_arm.",),
    "elbow": ("forearm.flexion",),
    "wrist": ("hand.",),
}


@dataclass(frozen=True)
class Sign:
    """One picture.

    Attributes:
        angle: its name in angles.csv.
        degrees: its value in the picture.
        azimuth_deg: from where it is seen.
        point: the part whose joint the arrow follows.
        others: other angles, in all poses.
        start_deg: where the arrow begins.
    """

    angle: str
    degrees: float
    azimuth_deg: float
    point: str
    others: Mapping[str, float] = field(default_factory=dict)
    start_deg: float = 0.0


SIGNS = (
    Sign("left_hip_flexion", 45, LEFT_SIDE, "left_foot", {"left_knee_flexion": 20}),
    Sign("left_hip_adduction", 15, FRONT, "left_foot", start_deg=-15),
    Sign("left_hip_internal_rotation", 35, FRONT, "left_foot", {"left_knee_flexion": 80}, -30),
    Sign("left_knee_flexion", 80, LEFT_SIDE, "left_toes"),
    Sign("left_ankle_dorsiflexion", 25, LEFT_SIDE, "left_toes", start_deg=-40),
    Sign("trunk_flexion", 45, LEFT_SIDE, "head"),
    Sign("trunk_lateral_bending", 25, FRONT, "head", start_deg=-25),
    Sign("left_shoulder_flexion", 75, LEFT_SIDE, "left_hand"),
    Sign("left_shoulder_adduction", -70, FRONT, "left_hand", start_deg=-12),
    Sign(
        "left_shoulder_internal_rotation", 50, FRONT, "left_hand", {"left_elbow_flexion": 90}, -30
    ),
    Sign("left_elbow_flexion", 100, LEFT_SIDE, "left_hand"),
    Sign("trunk_rotation", 30, FRONT, "right_hand", {"right_shoulder_flexion": 70}, -20),
)


def motion_of(model: BodyModel, wanted: Mapping[str, float]) -> Motion:
    """A standing pose with wanted anatomical angles, degrees; all others of its joints are 0."""
    targets: dict[str, float] = {}
    for side in ("left", "right"):
        targets |= {
            f"{side}_{name}": 0.0
            for name in (
                "hip_flexion hip_adduction hip_internal_rotation knee_flexion ankle_dorsiflexion"
                " ankle_inversion shoulder_flexion shoulder_internal_rotation elbow_flexion"
            ).split()
        }
        targets[f"{side}_shoulder_adduction"] = -12.0  # beside the trunk
    targets |= {f"trunk_{name}": 0.0 for name in ("flexion", "lateral_bending", "rotation")}
    targets |= wanted
    free = [
        k
        for k, name in enumerate(model.tree.dof_names)
        if any(key in name for keys in _DOFS.values() for key in keys)
    ]

    def motion(values: NDArray[np.float64]) -> Motion:
        angles = np.zeros((1, model.dof_count))
        angles[0, free] = values
        return Motion(25.0, model, model.joints_m[:1], np.array([[1.0, 0, 0, 0]]), angles)

    def residual(values: NDArray[np.float64]) -> NDArray[np.float64]:
        found = anatomical_angles(motion(values))
        error = [found[name][0] - degrees for name, degrees in targets.items()]
        return np.radians(np.r_[error, 0.5 * np.degrees(values) * 0.01])

    return motion(least_squares(residual, np.zeros(len(free))).x)


def picture(model: BodyModel, sign: Sign) -> Image:
    """The body with the angle, and the way there from zero."""
    path, vertices = [], model.vertices_m
    for share in np.linspace(0, 1, _STEPS):
        value = sign.start_deg + share * (sign.degrees - sign.start_deg)
        motion = motion_of(model, {**sign.others, sign.angle: value})
        rotation, origin = kinematics.forward(
            model, motion.root_m, motion.root_quaternion, motion.angles_rad
        )
        path.append(origin[0, model.names.index(sign.point)])
        vertices = kinematics.skin(model, rotation[0], origin[0])
        found = float(anatomical_angles(motion)[sign.angle][0])
        if abs(found - value) > 1.0:
            raise SystemExit(f"{sign.angle} is {found:.1f}, not {value:.1f}")
    reach, top = 0.62, 1.75
    box = np.array([-reach, -0.1, 0.0]), np.array([reach, 0.1, top])
    view = shaded_view((vertices, model.faces), box, None, sign.azimuth_deg, _SIZE)
    pixels = _pixels(np.array(path), box, sign.azimuth_deg)
    arrow(view, pixels, POSITIVE, 3)
    foot = blank(_SIZE[0], 50)
    shown = sign.angle.removeprefix("left_")
    centred(foot, shown, _SIZE[0] / 2, 18, 15, INK, bold=True)
    side = {FRONT: "from the front", LEFT_SIDE: "from its left"}
    centred(foot, f"{sign.degrees:+.0f}, {side[sign.azimuth_deg]}", _SIZE[0] / 2, 38, 13, QUIET)
    return np.concatenate([view, foot])


def main() -> None:
    """Writes the picture."""
    model = BodyModel.from_sizes(BodySizes(1.7, sex="male"))
    cells = [picture(model, sign) for sign in SIGNS]
    rows = [np.concatenate(cells[k : k + 6], axis=1) for k in (0, 6)]
    save(np.concatenate(rows), "angle_signs.png")


def _pixels(
    points: NDArray[np.float64],
    box: tuple[NDArray[np.float64], NDArray[np.float64]],
    azimuth_deg: float,
) -> NDArray[np.float64]:
    """Positions (N, 2) of points (N, 3) in the picture of `shaded_view`."""
    (low, high), (width, height) = box, _SIZE
    angle = np.radians(azimuth_deg)
    forward = -np.array([np.cos(angle), np.sin(angle), 0.0])
    axes = np.stack([np.cross(forward, [0, 0, 1.0]), [0, 0, -1.0], forward])
    diagonal, focal = float(np.linalg.norm((high - low)[:2])), 4.0 * height
    span = max(float(high[2] - low[2]) / height, diagonal / width)
    seen = (points - 0.5 * (low + high)) @ axes.T + (0, 0, 0.5 * diagonal + focal / 0.9 * span)
    return seen[:, :2] / seen[:, 2:] * focal + 0.5 * np.array([width - 1, height - 1])


if __name__ == "__main__":
    main()
