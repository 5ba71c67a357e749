"""Solids as signed functions, joined by smooth unions.

The functions are negative inside and about a distance in the solid's unit.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

Point = Sequence[float] | NDArray[np.floating]
FAR = 1.0
"""Value of a solid at points that are far away."""


def smooth_union(
    a: NDArray[np.floating], b: NDArray[np.floating], reach: float
) -> NDArray[np.floating]:
    """Union of two solids with a fillet.

    Args:
        a: values of the first solid.
        b: values of the second solid, same shape.
        reach: difference of the two values within which they blend; 0 is the plain union.

    Returns:
        Values of the joined solid.

    Source: Quilez, smooth minimum (quadratic polynomial).
    """
    if reach <= 0:
        return np.minimum(a, b)
    blend = np.maximum(reach - np.abs(a - b), 0.0) / reach
    return np.minimum(a, b) - blend * blend * reach / 4


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """Ellipsoid with axes along x, y and z.

    Attributes:
        centre: (3,), centre.
        radii: (3,), radii along x, y and z.
    """

    centre: tuple[float, float, float]
    radii: tuple[float, float, float]

    def bounds(self) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Lower and upper corner of the bounding box."""
        centre, radii = np.array(self.centre), np.array(self.radii)
        return centre - radii, centre + radii

    def values(self, points: NDArray[np.floating]) -> NDArray[np.floating]:
        """Signed values (N,) at points (N, 3)."""
        offset = points - self.centre
        relative = np.linalg.norm(offset / self.radii, axis=-1)
        slope = np.linalg.norm(offset / np.square(self.radii), axis=-1)
        return relative * (relative - 1) / np.maximum(slope, 1e-9)


@dataclass(frozen=True, eq=False)
class Loft:
    """Ellipse-like cross-sections along a straight axis, each with four radii.

    Attributes:
        start: (3,), point of t = 0.
        end: (3,), point of t = 1.
        front: (3,), direction of the front radius, made perpendicular to the axis. The outer radius
            is perpendicular to both, toward +x.
        stations: rows of t, outer, inner, front and back radius, joined by monotone cubics. The
            solid ends flat at the first and the last row.
        power: exponent of the cross-section; 2 is an ellipse, more is squarer.
    """

    start: Point
    end: Point
    front: Point
    stations: Sequence[Sequence[float]]
    power: float = 2.0

    def frame(
        self,
    ) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating], float]:
        """Unit vectors along, outward and to the front, and the length of the axis."""
        axis = np.asarray(self.end, np.float64) - np.asarray(self.start, np.float64)
        length = float(np.linalg.norm(axis))
        along = axis / length
        front = np.asarray(self.front, np.float64)
        front = front - along * (front @ along)
        front = front / np.linalg.norm(front)
        outward = np.cross(along, front)
        return along, outward if outward[0] >= 0 else -outward, front, length

    def bounds(self) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Lower and upper corner of a bounding box."""
        table = np.asarray(self.stations, float)
        ends = np.asarray(self.start) + table[[0, -1], :1] * np.subtract(self.end, self.start)
        return ends.min(0) - table[:, 1:].max(), ends.max(0) + table[:, 1:].max()

    def values(self, points: NDArray[np.floating]) -> NDArray[np.floating]:
        """Signed values (N,) at points (N, 3)."""
        along, outward, front, length = self.frame()
        table = np.asarray(self.stations, float)
        offset = points - np.asarray(self.start, float)
        t = offset @ along / length
        u, v = offset @ outward, offset @ front
        inside = np.clip(t, table[0, 0], table[-1, 0])
        outer, inner, fore, back = PchipInterpolator(table[:, 0], table[:, 1:])(inside).T
        relative = (
            np.abs(u / np.where(u > 0, outer, inner)) ** self.power
            + np.abs(v / np.where(v > 0, fore, back)) ** self.power
        ) ** (1 / self.power)
        # Radial distance to the outline; on the axis itself, where no direction is nearest, minus
        # the smallest radius.
        radial = np.hypot(u, v)
        side = np.where(
            relative > 1e-6,
            radial * (1 - 1 / np.maximum(relative, 1e-6)),
            -np.minimum(np.minimum(outer, inner), fore),
        )
        beyond = np.abs(t - inside) * length
        return np.where(beyond > 0, np.hypot(np.maximum(side, 0), beyond), side)


Solid = Ellipsoid | Loft


def union_values(
    solids: Sequence[tuple[Solid, float]], points: NDArray[np.floating]
) -> NDArray[np.floating]:
    """Signed values (N,) at points (N, 3) of a union of solids, each with its fillet's reach."""
    values = solids[0][0].values(points)
    for solid, reach in solids[1:]:
        values = smooth_union(values, solid.values(points), reach)
    return values


@dataclass(frozen=True, eq=False)
class Lattice:
    """Regular lattice of sample points.

    Attributes:
        origin: (3,), first point.
        spacing: distance of neighbouring points.
        shape: numbers of points along x, y and z.
    """

    origin: NDArray[np.floating]
    spacing: float
    shape: tuple[int, int, int]

    def sample(self, solids: Sequence[tuple[Solid, float]], margin: float) -> NDArray[np.float64]:
        """Values of the smooth union of solids on the lattice.

        Args:
            solids: each with the reach of its union with those before it.
            margin: how far around a solid it is evaluated; elsewhere it counts as `FAR`.

        Returns:
            (nx, ny, nz) values.
        """
        field = np.full(self.shape, FAR)
        axes = [self.origin[k] + self.spacing * np.arange(self.shape[k]) for k in range(3)]
        for solid, reach in solids:
            low, high = solid.bounds()
            box = tuple(
                slice(
                    int(np.searchsorted(axis, lo - margin)), int(np.searchsorted(axis, hi + margin))
                )
                for axis, lo, hi in zip(axes, low, high, strict=True)
            )
            points = np.stack(
                np.meshgrid(
                    *(axis[cut] for axis, cut in zip(axes, box, strict=True)), indexing="ij"
                ),
                -1,
            )
            field[box] = smooth_union(
                field[box], solid.values(points.reshape(-1, 3)).reshape(points.shape[:3]), reach
            )
        return field
