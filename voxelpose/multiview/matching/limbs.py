"""Limbs, the parts that the voxel matcher places, and the angles sampled for each.

Paper B matches the parts of a coarse body model. Here a matched part is a limb: one or several of
the 27 parts as a rigid group (a forearm with its hand), turned by the joint angles that its own
placement shows.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from silhouette_core.body.joints import HUMAN, PART_NAMES, SIDES
from silhouette_core.body.kinematic_tree import KinematicTree
from silhouette_core.body.model import BodyModel
from silhouette_core.motion.dynamics import is_person_tree
from voxelpose.multiview.tuning import MATCHING


@dataclass(frozen=True)
class Limb:
    """A rigid group of parts and the angles that turn it."""

    name: str  #: also that of its first part, at whose joint it is attached.
    parts: tuple[str, ...]
    parent: str | None  #: the limb that must be placed before it is selectable; None for the root.
    swing: tuple[str, ...] = ()  #: the two angles that point it; empty for a hinge.
    hinge: str | None = None  #: the angle of its own hinge joint; None for a ball joint.
    twist_of: str | None = None
    """For a hinge, the ball joint above, whose twist about the bone shows only in this limb."""
    angles: tuple[str, ...] = ()
    """Of a body that is no person's, the angles that are sampled together."""
    carrier: str | None = None  #: the limb that carries it, where that is not `parent`.

    @property
    def carried_by(self) -> str | None:
        """The limb to which it is joined; None for the root."""
        return self.carrier or self.parent


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
    for side in SIDES:
        arm, forearm = f"{side}_upper_arm", f"{side}_forearm"
        thigh, shin = f"{side}_thigh", f"{side}_shin"
        hand = tuple(f"{side}_{part}" for part in ("hand", "thumb", "fingers"))
        foot = f"{side}_foot", f"{side}_toes"
        limbs += [
            Limb(arm, (arm,), "pelvis", swing=(f"{arm}.abduction", f"{arm}.forward")),
            Limb(thigh, (thigh,), "pelvis", swing=(f"{thigh}.flexion", f"{thigh}.abduction")),
            Limb(forearm, (forearm, *hand), arm, hinge=f"{forearm}.flexion", twist_of=arm),
            Limb(shin, (shin, *foot), thigh, hinge=f"{shin}.flexion", twist_of=thigh),
        ]
    return tuple(limbs)


LIMBS = _limbs()
CHAINS = tuple(
    tuple(next(limb for limb in LIMBS if limb.name == f"{side}_{part}") for part in chain)
    for chain in (("upper_arm", "forearm"), ("thigh", "shin"))
    for side in SIDES
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
    limb: Limb, angles_rad: np.ndarray, step_rad: float, tree: KinematicTree = HUMAN
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
        samples[:, np.isin(names, (f"{limb.name}.twist", f"{limb.name}.rotation"))] = 0.0
    else:
        samples = sample_hinge(limb, angles_rad[None], step_rad, tree)[0]
    return np.concatenate([angles_rad[None], samples[within_limits(samples, tree)]])


def sample_grid(
    limb: Limb, angles_rad: np.ndarray, step_rad: float, tree: KinematicTree
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
        of_limb = tree.names[tree.dof_part[column]] == limb.name
        if of_limb or len(joint) != 3 or not np.allclose(axes_of @ axes_of.T, np.eye(3), atol=1e-6):
            continue
        # A twist of the bone above, which stays where it points: turned about itself first.
        twists, bone = mesh[:, k] - middle[k], tree.dof_axis[column]
        samples[..., joint] = _twisted(angles_rad[:, joint], axes_of, twists, bone)
    return samples


def sample_hinge(
    limb: Limb, angles_rad: np.ndarray, step_rad: float, tree: KinematicTree = HUMAN
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
    turned = _twisted(angles_rad[:, above], axes, twists, bone)
    samples = np.repeat(angles_rad[:, None], len(twists) * len(bends), axis=1)
    samples[..., above] = np.repeat(turned, len(bends), axis=1)
    samples[..., hinge] = np.tile(bends, len(twists))
    return samples


def _twisted(
    angles_rad: np.ndarray, axes: np.ndarray, twists_rad: np.ndarray, bone: np.ndarray
) -> np.ndarray:
    """Angles (M, K, 3) of a bone about orthonormal axes (3, 3), from M placements of it (M, 3),
    after each of K twists (K,) about the bone (3,) at rest.
    """
    swings = Rotation.from_rotvec(np.repeat(angles_rad @ axes, len(twists_rad), axis=0))
    twists = Rotation.from_rotvec(np.tile(twists_rad[:, None] * bone, (len(angles_rad), 1)))
    return ((swings * twists).as_rotvec() @ axes.T).reshape(len(angles_rad), -1, 3)


def within_limits(angles_rad: np.ndarray, tree: KinematicTree = HUMAN) -> np.ndarray:
    """Whether all angles (…, D) of each pose are within their limits, (…,) bool."""
    low, high = tree.dof_limits_rad.T
    return ((angles_rad >= low - 1e-9) & (angles_rad <= high + 1e-9)).all(-1)


def _ticks(limits: Sequence[float] | np.ndarray, step: float) -> np.ndarray:
    """Samples of one angle, at most `step` apart, both ends of its range included."""
    low, high = limits
    count = max(int(np.ceil((high - low) / step - 1e-9)), 1)
    return np.linspace(low, high, count + 1)


def limbs_of(model: BodyModel, part_points: list[np.ndarray], spacing_m: float) -> tuple[Limb, ...]:
    """Limbs of a body in the order of its parts, the root limb first.

    Those of a person are `LIMBS`; parts that a person's tree has beside them belong to the limb
    that carries them.

    Args:
        part_points: P arrays (n_p, 3), the volume of each part relative to its joint.
        spacing_m: distance between those points.
    """
    if is_person_tree(model.tree):
        return _with_added_parts(model)
    builder = _Builder(model, part_points, spacing_m)
    groups = builder.groups()
    return builder.limbs(groups)


def chains_of(limbs: tuple[Limb, ...]) -> tuple[tuple[Limb, ...], ...]:
    """Pairs of a limb and the next one that it carries, which are searched together, and limbs of
    the root that carry none; of a person the arms and the legs.
    """
    if {limb.name for limb in LIMBS} <= {limb.name for limb in limbs}:
        by_name = {limb.name: limb for limb in limbs}
        return tuple((by_name[upper.name], by_name[lower.name]) for upper, lower in CHAINS)
    chains: list[tuple[Limb, ...]] = []
    for limb in limbs[1:]:
        below = [other for other in limbs if other.carried_by == limb.name]
        chains += [(limb, other) for other in below]
        if not below and limb.carried_by == limbs[0].name:
            chains.append((limb,))
    return tuple(chains)


def _with_added_parts(model: BodyModel) -> tuple[Limb, ...]:
    parts = {limb.name: list(limb.parts) for limb in LIMBS}
    home = {part: name for name, members in parts.items() for part in members}
    for part, parent in zip(model.names, model.tree.parents, strict=True):
        if part not in home:
            home[part] = home[model.names[parent]]
            parts[home[part]].append(part)
    return tuple(replace(limb, parts=tuple(parts[limb.name])) for limb in LIMBS)


class _Builder:
    """Groups the parts of a body; arguments as of `limbs_of`."""

    def __init__(self, model: BodyModel, part_points: list[np.ndarray], spacing_m: float):
        self.model, self.spacing_m = model, spacing_m
        self._points = [
            points + joint for points, joint in zip(part_points, model.joints_m, strict=True)
        ]
        self._free = np.flatnonzero(
            ~model.tree.dof_fixed & (np.ptp(model.tree.dof_limits_rad, axis=1) > 0)
        )

    def dofs(self, part: int) -> list[int]:
        """Angles of a part's joint that are estimated."""
        return [k for k in self._free.tolist() if self.model.tree.dof_part[k] == part]

    def groups(self) -> list[list[int]]:
        """Parts by limb: a joint whose angles do not show in what it carries starts none."""
        visible = {part: self._shown(part) for part in range(1, len(self.model.names))}
        groups, home = [[0]], {0: 0}
        for part in range(1, len(self.model.names)):
            if visible[part]:
                home[part] = len(groups)
                groups.append([part])
            else:
                home[part] = home[int(self.model.tree.parents[part])]
                groups[home[part]].append(part)
        return groups

    def _rigid(self, part: int) -> list[int]:
        """A part and the parts that are fixed to it."""
        parts = [part]
        for other in range(part + 1, len(self.model.names)):
            if self.model.tree.parents[other] in parts and not self.dofs(other):
                parts.append(other)
        return parts

    def _shown(self, part: int) -> list[int]:
        """Angles of a part's joint that show in the part itself."""
        points = np.concatenate([self._points[p] for p in self._rigid(part)])
        if not len(points):
            return []
        offsets, tree = points - self.model.joints_m[part], KDTree(points)
        visible = []
        for k in self.dofs(part):
            turn = Rotation.from_rotvec(
                np.radians(MATCHING.apart_deg) * self.model.tree.dof_axis[k]
            ).as_matrix()
            distance = tree.query(offsets @ turn.T + self.model.joints_m[part])[0]
            if (distance > self.spacing_m).mean() > MATCHING.visible:
                visible.append(k)
        return visible

    def limbs(self, groups: list[list[int]]) -> tuple[Limb, ...]:
        """Limbs of the groups, with the angles that are sampled for each."""
        model, names = self.model, self.model.names
        home = {part: g for g, group in enumerate(groups) for part in group}
        above = [-1] + [home[int(model.tree.parents[group[0]])] for group in groups[1:]]
        visible = [self._shown(group[0]) if g else [] for g, group in enumerate(groups)]
        hidden = [
            [k for part in group for k in self.dofs(part) if k not in visible[g]]
            for g, group in enumerate(groups)
        ]
        before = list(above)
        for g in range(len(groups)):
            carried = [c for c in range(len(groups)) if above[c] == g]
            for k in hidden[g]:
                # The largest limb that the angle moves shows it; the others are matched after it.
                moved = [
                    c for c in carried if model.tree.descends[model.tree.dof_part[k], groups[c][0]]
                ]
                if not moved:
                    continue
                first = max(moved, key=lambda c: self._volume(groups, above, c))
                visible[first] = [*visible[first], k]
                for other in moved:
                    if other != first and before[other] == g:
                        before[other] = first
        return tuple(
            Limb(
                names[group[0]],
                tuple(names[part] for part in group),
                names[groups[before[g]][0]] if g else None,
                angles=tuple(model.tree.dof_names[k] for k in sorted(visible[g])),
                carrier=names[groups[above[g]][0]] if g else None,
            )
            for g, group in enumerate(groups)
        )

    def _volume(self, groups: list[list[int]], above: list[int], limb: int) -> int:
        """Points of a limb and of all that it carries."""
        volume = sum(len(self._points[part]) for part in groups[limb])
        carried = [c for c, parent in enumerate(above) if parent == limb]
        return volume + sum(self._volume(groups, above, c) for c in carried)
