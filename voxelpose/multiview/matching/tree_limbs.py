"""Limbs of any body, derived from its kinematic tree and its volume.

A limb is one or several parts as a rigid group. Whether a joint's turn can be seen is measured: the
group is turned about the joint's axis, and the share of its points that leave its own volume tells.
A turn that leaves a group as it is, such as that of a robot about its upright axis, shows only in
what the group carries, and is sampled there.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from silhouette_core.body.model import BodyModel
from silhouette_core.motion.dynamics import is_person_tree
from voxelpose.multiview.matching.limbs import CHAINS, LIMBS, Limb
from voxelpose.multiview.tuning import MATCHING


def limbs_of(model: BodyModel, part_points: list[np.ndarray], spacing_m: float) -> tuple[Limb, ...]:
    """Limbs of a body in the order of its parts, the root limb first.

    Those of a person are `LIMBS`; parts that a person's tree has beside them belong to the limb
    that carries them.

    Args:
        part_points: P arrays (n_p, 3), the volume of each part relative to its joint.
        spacing_m: distance between those points.
    """
    if has_person_limbs(model):
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


def has_person_limbs(model: BodyModel) -> bool:
    """Whether a body has all parts and joint angles of a person, and perhaps others."""
    return is_person_tree(model.tree)


def _with_added_parts(model: BodyModel) -> tuple[Limb, ...]:
    parts = {limb.name: list(limb.parts) for limb in LIMBS}
    home = {part: name for name, own in parts.items() for part in own}
    for part, parent in zip(model.names, model.parents, strict=True):
        if part not in home:
            home[part] = home[model.names[parent]]
            parts[home[part]].append(part)
    return tuple(
        limb if len(limb.parts) == len(parts[limb.name]) else limb.with_parts((*parts[limb.name],))
        for limb in LIMBS
    )


class _Builder:
    """Groups the parts of a body; arguments as of `limbs_of`."""

    def __init__(self, model: BodyModel, part_points: list[np.ndarray], spacing_m: float):
        self.model, self.spacing_m = model, spacing_m
        self._points = [
            points + joint for points, joint in zip(part_points, model.joints_m, strict=True)
        ]
        self._free = np.flatnonzero(~model.dof_fixed & (np.ptp(model.dof_limits_rad, axis=1) > 0))

    def dofs(self, part: int) -> list[int]:
        """Angles of a part's joint that are estimated."""
        return [k for k in self._free.tolist() if self.model.dof_part[k] == part]

    def groups(self) -> list[list[int]]:
        """Parts by limb: a joint whose angles do not show in what it carries starts none."""
        shown = {part: self._shown(part) for part in range(1, len(self.model.names))}
        groups, home = [[0]], {0: 0}
        for part in range(1, len(self.model.names)):
            if shown[part]:
                home[part] = len(groups)
                groups.append([part])
            else:
                home[part] = home[int(self.model.parents[part])]
                groups[home[part]].append(part)
        return groups

    def _rigid(self, part: int) -> list[int]:
        """A part and the parts that are fixed to it."""
        parts = [part]
        for other in range(part + 1, len(self.model.names)):
            if self.model.parents[other] in parts and not self.dofs(other):
                parts.append(other)
        return parts

    def _shown(self, part: int) -> list[int]:
        """Angles of a part's joint that show in the part itself."""
        points = np.concatenate([self._points[p] for p in self._rigid(part)])
        if not len(points):
            return []
        offsets, tree = points - self.model.joints_m[part], KDTree(points)
        shown = []
        for k in self.dofs(part):
            turn = Rotation.from_rotvec(
                np.radians(MATCHING.apart_deg) * self.model.dof_axis[k]
            ).as_matrix()
            distance = tree.query(offsets @ turn.T + self.model.joints_m[part])[0]
            if (distance > self.spacing_m).mean() > MATCHING.shown:
                shown.append(k)
        return shown

    def limbs(self, groups: list[list[int]]) -> tuple[Limb, ...]:
        """Limbs of the groups, with the angles that are sampled for each."""
        model, names = self.model, self.model.names
        home = {part: g for g, group in enumerate(groups) for part in group}
        above = [-1] + [home[int(model.parents[group[0]])] for group in groups[1:]]
        own = [self._shown(group[0]) if g else [] for g, group in enumerate(groups)]
        hidden = [
            [k for part in group for k in self.dofs(part) if k not in own[g]]
            for g, group in enumerate(groups)
        ]
        before = list(above)
        for g in range(len(groups)):
            carried = [c for c in range(len(groups)) if above[c] == g]
            for k in hidden[g]:
                # The largest limb that the angle moves shows it; the others are matched after it.
                moved = [c for c in carried if model.tree.descends[model.dof_part[k], groups[c][0]]]
                if not moved:
                    continue
                first = max(moved, key=lambda c: self._volume(groups, above, c))
                own[first] = [*own[first], k]
                for other in moved:
                    if other != first and before[other] == g:
                        before[other] = first
        return tuple(
            Limb(
                names[group[0]],
                tuple(names[part] for part in group),
                names[groups[before[g]][0]] if g else None,
                angles=tuple(model.dof_names[k] for k in sorted(own[g])),
                carrier=names[groups[above[g]][0]] if g else None,
            )
            for g, group in enumerate(groups)
        )

    def _volume(self, groups: list[list[int]], above: list[int], limb: int) -> int:
        """Points of a limb and of all that it carries."""
        own = sum(len(self._points[part]) for part in groups[limb])
        carried = [c for c, parent in enumerate(above) if parent == limb]
        return own + sum(self._volume(groups, above, c) for c in carried)
