"""Limbs, the parts that the voxel matcher places, and the angles sampled for each.

Paper B matches the parts of a coarse body model. Here a matched part is a limb: one or several of
the 27 parts as a rigid group (a forearm with its hand), turned by the joint angles that its own
placement shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from silhouette_core.body.joints import HUMAN, PART_NAMES
from silhouette_core.body.kinematic_tree import KinematicTree


@dataclass(frozen=True)
class Limb:
    """A rigid group of parts and the angles that turn it.

    Attributes:
        name: also that of its first part, at whose joint it is attached.
        parent: the limb that must be placed before it is selectable; None for the root.
        swing: the two angles that point it; empty for a hinge.
        hinge: the angle of its own hinge joint; None for a ball joint.
        twist_of: for a hinge, the ball joint above, whose twist about the bone shows only in this
            limb.
        angles: of a body that is no person's, the angles that are sampled together.
        carrier: the limb that carries it, where that is not `parent`.
    """

    name: str
    parts: tuple[str, ...]
    parent: str | None
    swing: tuple[str, ...] = ()
    hinge: str | None = None
    twist_of: str | None = None
    angles: tuple[str, ...] = ()
    carrier: str | None = None

    @property
    def part(self) -> int:
        """Index of the part of a person whose frame carries the limb."""
        return PART_NAMES.index(self.name)

    @property
    def carried_by(self) -> str | None:
        """The limb to which it is joined; None for the root."""
        return self.carrier or self.parent

    def with_parts(self, parts: tuple[str, ...]) -> Limb:
        """The same limb of other parts."""
        return replace(self, parts=parts)


TORSO = Limb(
    "pelvis",
    ("pelvis", "lumbar", "abdomen", "thorax", "upper_thorax", "left_clavicle", "right_clavicle"),
    None,
)


def _limbs() -> tuple[Limb, ...]:
    limbs = [
        TORSO,
        Limb("neck", ("neck", "head"), "pelvis", swing=("neck.flexion", "neck.lateral")),
    ]
    for s in ("left", "right"):
        limbs += [
            Limb(
                f"{s}_upper_arm",
                (f"{s}_upper_arm",),
                "pelvis",
                swing=(f"{s}_upper_arm.abduction", f"{s}_upper_arm.forward"),
            ),
            Limb(
                f"{s}_thigh",
                (f"{s}_thigh",),
                "pelvis",
                swing=(f"{s}_thigh.flexion", f"{s}_thigh.abduction"),
            ),
            Limb(
                f"{s}_forearm",
                tuple(f"{s}_{part}" for part in ("forearm", "hand", "thumb", "fingers")),
                f"{s}_upper_arm",
                hinge=f"{s}_forearm.flexion",
                twist_of=f"{s}_upper_arm",
            ),
            Limb(
                f"{s}_shin",
                tuple(f"{s}_{part}" for part in ("shin", "foot", "toes")),
                f"{s}_thigh",
                hinge=f"{s}_shin.flexion",
                twist_of=f"{s}_thigh",
            ),
        ]
    return tuple(limbs)


LIMBS = _limbs()
CHAINS = tuple(
    (
        next(limb for limb in LIMBS if limb.name == f"{side}_{upper}"),
        next(limb for limb in LIMBS if limb.name == f"{side}_{lower}"),
    )
    for upper, lower in (("upper_arm", "forearm"), ("thigh", "shin"))
    for side in ("left", "right")
)
"""The arms and the legs, each from its upper to its lower part."""
_MOST_SAMPLES = 2500  # of one limb that is no person's
_TWIST_AXIS = {
    name: next(
        f.axis
        for part, f in HUMAN.dofs
        if PART_NAMES[part] == name and f.name in ("twist", "rotation")
    )
    for name in ("left_upper_arm", "right_upper_arm", "left_thigh", "right_thigh")
}


def sample_angles(
    limb: Limb,
    angles_rad: np.ndarray,
    step_rad: float,
    tree: KinematicTree = HUMAN,
) -> np.ndarray:
    """Samples of a limb's joint angles within their limits.

    Args:
        angles_rad: (D,) the angles decided so far.

    Returns:
        (K, D) angles: `angles_rad` with the limb's own replaced. The present angles come first.

    Source: Iiyama, Kameda and Minoh, section 2.
    """
    names = tree.dof_names
    if limb.angles:
        samples = sample_grid(limb, angles_rad[None], step_rad, tree)[0]
    elif limb.swing:
        columns = [names.index(name) for name in limb.swing]
        axes = [_ticks(tree.dof_limits_rad[k], step_rad) for k in columns]
        mesh = np.stack([grid.ravel() for grid in np.meshgrid(*axes, indexing="ij")], 1)
        samples = np.tile(angles_rad, (len(mesh), 1))
        samples[:, columns] = mesh
        # Over the whole range the present twist has no meaning at other placements.
        for k, name in enumerate(names):
            if name in (f"{limb.name}.twist", f"{limb.name}.rotation"):
                samples[:, k] = 0.0
    else:
        samples = sample_hinge(limb, angles_rad[None], step_rad, tree)[0]
    return np.concatenate([angles_rad[None], samples[within_limits(samples, tree)]])


def sample_grid(
    limb: Limb,
    angles_rad: np.ndarray,
    step_rad: float,
    tree: KinematicTree,
) -> np.ndarray:
    """Samples of all `angles` of a limb on a grid, which is coarser than asked for where it would
    have too many.

    Args:
        limb: one with `angles`.
        angles_rad: (M, D), M placements of what carries it, with equal angles of the limb.

    Returns:
        (M, K, D).
    """
    columns = [tree.dof_names.index(name) for name in limb.angles]
    middle = angles_rad[0, columns]
    while True:
        axes = [_ticks(tree.dof_limits_rad[k], step_rad) for k in columns]
        if np.prod([len(ticks) for ticks in axes]) <= _MOST_SAMPLES:
            break
        step_rad *= 1.2
    mesh = np.stack([grid.ravel() for grid in np.meshgrid(*axes, indexing="ij")], 1)
    samples = np.repeat(angles_rad[:, None], len(mesh), axis=1)
    samples[..., columns] = mesh
    for k, column in enumerate(columns):
        joint = np.flatnonzero(tree.dof_part == tree.dof_part[column])
        axes_of = tree.dof_axis[joint]
        own = tree.names[tree.dof_part[column]] == limb.name
        if own or len(joint) != 3 or not np.allclose(axes_of @ axes_of.T, np.eye(3), atol=1e-6):
            continue
        # A twist of the bone above, which stays where it points: turned about itself first.
        swings = Rotation.from_rotvec(np.repeat(angles_rad[:, joint] @ axes_of, len(mesh), axis=0))
        twists = np.tile(
            (mesh[:, k] - middle[k])[:, None] * tree.dof_axis[column], (len(swings) // len(mesh), 1)
        )
        turned = (swings * Rotation.from_rotvec(twists)).as_rotvec() @ axes_of.T
        samples[..., joint] = turned.reshape(*samples.shape[:2], 3)
    return samples


def sample_hinge(
    limb: Limb,
    angles_rad: np.ndarray,
    step_rad: float,
    tree: KinematicTree = HUMAN,
) -> np.ndarray:
    """Samples of a hinge's bend and of the twist of the bone above it.

    Args:
        limb: one with a hinge.
        angles_rad: (M, D), M placements of the bone above, with equal angles of the hinge.
        step_rad: distance between samples of the bend; the twist, which moves less, takes half as
            many.

    Returns:
        (M, K, D); not all within the limits of the bone above (see `within_limits`).
    """
    names = tree.dof_names
    hinge = names.index(limb.hinge or "")
    above = [k for k, name in enumerate(names) if name.partition(".")[0] == limb.twist_of]
    # Orthonormal, so that angles are coordinates of the rotation vector.
    axes = tree.dof_axis[above]
    bone = np.asarray(_TWIST_AXIS[limb.twist_of or ""], float)
    reach = np.radians(100)
    twists = _ticks((-reach, reach), 2 * step_rad)
    bends = _ticks(tree.dof_limits_rad[hinge], step_rad)
    swings = Rotation.from_rotvec(np.repeat(angles_rad[:, above] @ axes, len(twists), axis=0))
    turned = (
        swings * Rotation.from_rotvec(np.tile(twists[:, None] * bone, (len(angles_rad), 1)))
    ).as_rotvec() @ axes.T
    samples = np.repeat(angles_rad[:, None], len(twists) * len(bends), axis=1)
    samples[..., above] = np.repeat(
        turned.reshape(len(angles_rad), len(twists), 3), len(bends), axis=1
    )
    samples[..., hinge] = np.tile(bends, len(twists))
    return samples


def within_limits(angles_rad: np.ndarray, tree: KinematicTree = HUMAN) -> np.ndarray:
    """Whether all angles (…, D) of each pose are within their limits, (…,) bool."""
    low, high = tree.dof_limits_rad.T
    return ((angles_rad >= low - 1e-9) & (angles_rad <= high + 1e-9)).all(-1)


def _ticks(limits: Sequence[float] | np.ndarray, step: float) -> np.ndarray:
    """Samples of one angle, at most `step` apart, both ends of its range included."""
    low, high = limits
    count = max(int(np.ceil((high - low) / step - 1e-9)), 1)
    return np.linspace(low, high, count + 1)
