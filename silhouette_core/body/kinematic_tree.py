"""Kinematic tree of an articulated body: its parts, joints and landmarks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calib.errors import InputError


@dataclass(frozen=True)
class Dof:
    """Degree of freedom of a joint."""

    name: str  #: the movement that a positive angle makes.
    axis: tuple[float, float, float]  #: unit vector in the body frame of the rest pose.
    limits_deg: tuple[float, float]  #: smallest and largest angle.
    fixed: bool = False  #: Whether silhouettes do not show it: the estimators leave it at rest.


@dataclass(frozen=True, eq=False)
class KinematicTree:
    """Parts of a body and how they move against each other; no sizes.

    Every part has the joint at its proximal end. A joint rotates by `Exp(sum_k q_k axis_k)`.
    """

    names: tuple[str, ...]  #: P names of the parts.
    parents: np.ndarray  #: (P,) int32, parent of each part, before it; -1 of the root, the first.
    dofs: tuple[tuple[int, Dof], ...]
    """D degrees of freedom and the part that each moves, in the order of the parts."""
    landmark_names: tuple[str, ...]  #: L names of the points whose positions are told as joints.
    landmark_part: np.ndarray  #: (L,) int32, part that carries each.
    landmark_bones: np.ndarray  #: (B, 2) int, pairs of landmarks between which a bone is drawn.
    root_fixed: bool = False  #: Whether the root part stands still, as a robot's base does.

    @classmethod
    def from_parts(
        cls,
        parts: Sequence[tuple[str, str, tuple[Dof, ...]]],
        ends: Mapping[str, str] | None = None,
        root_fixed: bool = False,
    ) -> "KinematicTree":
        """Tree of a table of parts, whose joints are landmarks under the parts' own names. Raises
        InputError where a name is given twice, or a parent does not come before its part.

        Args:
            parts: name, parent's name (empty for the root, the first) and degrees of freedom.
            ends: name of a further landmark, at the end of a part -> that part.
        """
        names, ends = tuple(name for name, _, _ in parts), dict(ends or {})
        if len({*names, *ends}) < len(names) + len(ends):
            raise InputError("two parts or landmarks of the body have one name: rename one")
        parents = []
        for k, (name, parent, _) in enumerate(parts):
            if (parent == "") != (k == 0) or (parent and parent not in names[:k]):
                raise InputError(
                    f"the parent {parent!r} of the part {name!r} does not come before it: list the"
                    " root part first, without a parent, and every other after its parent"
                )
            parents.append(names.index(parent) if parent else -1)
        if missing := set(ends.values()) - set(names):
            raise InputError(f"a landmark is carried by {missing.pop()!r}, which is no part")
        carriers = [*range(len(names)), *(names.index(part) for part in ends.values())]
        bones = [*parents[1:], *carriers[len(names) :]]
        return cls(
            names,
            np.array(parents, np.int32),
            tuple((part, dof) for part, (_, _, dofs) in enumerate(parts) for dof in dofs),
            (*names, *ends),
            np.array(carriers, np.int32),
            np.array([*enumerate(bones, 1)], int).reshape(-1, 2)[:, ::-1],
            root_fixed,
        )

    @cached_property
    def dof_part(self) -> np.ndarray:
        """(D,) int32, part that each degree of freedom moves."""
        return np.array([part for part, _ in self.dofs], np.int32)

    @cached_property
    def dof_axis(self) -> np.ndarray:
        """(D, 3) float64, axes of the degrees of freedom."""
        return np.array([dof.axis for _, dof in self.dofs], float).reshape(-1, 3)

    @cached_property
    def dof_limits_rad(self) -> np.ndarray:
        """(D, 2) float64, smallest and largest angle."""
        return np.radians([dof.limits_deg for _, dof in self.dofs]).reshape(-1, 2)

    @cached_property
    def dof_fixed(self) -> np.ndarray:
        """(D,) bool, whether the estimators leave the angle at rest."""
        return np.array([dof.fixed for _, dof in self.dofs], bool)

    @cached_property
    def dof_names(self) -> tuple[str, ...]:
        """D names, PART.MOVEMENT."""
        return tuple(f"{self.names[part]}.{dof.name}" for part, dof in self.dofs)

    @cached_property
    def descends(self) -> np.ndarray:
        """(P, P) bool: whether the second part is the first or a descendant of it."""
        table = np.eye(len(self.parents), dtype=bool)
        for part, parent in enumerate(self.parents):
            if parent >= 0:
                table[:, part] |= table[:, parent]
        return table
