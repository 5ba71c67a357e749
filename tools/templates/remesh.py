"""Remeshing of a surface to even triangles of given edge lengths.

An even mesh bends well at the joints; the long triangles that a quadric simplification leaves along
limbs would not.

Source: Botsch and Kobbelt, A Remeshing Approach to Multiresolution Modeling (2004), with a length
that varies in space, borders that stay in their plane, and vertices put back on the implicit
surface itself.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.shape import vertex_normals

Field = Callable[[NDArray[np.floating]], NDArray[np.floating]]


class Remesher:
    """Triangle mesh whose edges are split, collapsed and flipped."""

    def __init__(
        self,
        vertices: NDArray[np.floating],
        faces: NDArray[np.integer],
        surface: Field,
        length: Field,
    ) -> None:
        """Loads a mesh.

        Args:
            vertices: (V, 3); those with x = 0 are the border and stay in that plane.
            faces: (F, 3) with consistent winding.
            surface: signed function whose zero set is the surface.
            length: target edge length at points.
        """
        self.surface, self.length = surface, length
        self._load(np.asarray(vertices, float), faces)

    def _load(self, vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> None:
        self.points: list[NDArray[np.floating]] = list(vertices)
        self.target_length: list[float] = self.length(vertices).tolist()
        self.border: list[bool] = (np.abs(vertices[:, 0]) < 1e-9).tolist()
        self.faces: dict[int, tuple[int, int, int]] = {
            k: (int(a), int(b), int(c)) for k, (a, b, c) in enumerate(faces)
        }
        self.around: list[set[int]] = [set() for _ in self.points]
        for key, face in self.faces.items():
            for v in face:
                self.around[v].add(key)
        self.next_face = len(self.faces)

    def run(self, passes: int) -> None:
        """Splits, collapses, flips and relaxes several times."""
        for _ in range(passes):
            self._split_long()
            self._collapse_short()
            self._flip()
            self._compact()
            self._relax()

    def arrays(self) -> tuple[NDArray[np.floating], NDArray[np.int32]]:
        """Vertices (V, 3) and faces (F, 3)."""
        self._compact()
        return np.array(self.points), np.array(list(self.faces.values()), np.int32)

    def _compact(self) -> None:
        faces = np.array(list(self.faces.values()))
        used, inverse = np.unique(faces, return_inverse=True)
        self._load(np.array(self.points)[used], inverse.reshape(-1, 3))

    def _edges(self) -> list[tuple[int, int]]:
        faces = np.array(list(self.faces.values()))
        pairs = np.unique(
            np.sort(np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1),
            axis=0,
        )
        return [(int(a), int(b)) for a, b in pairs]

    def _relative(self, a: int, b: int) -> float:
        d = self.points[a] - self.points[b]
        return float(np.sqrt(d @ d)) * 2 / (self.target_length[a] + self.target_length[b])

    def _neighbours(self, v: int) -> set[int]:
        return {w for key in self.around[v] for w in self.faces[key]} - {v}

    def _remove(self, key: int) -> None:
        for v in self.faces.pop(key):
            self.around[v].discard(key)

    def _add(self, *face: int) -> None:
        self.faces[self.next_face] = (face[0], face[1], face[2])
        for v in face:
            self.around[v].add(self.next_face)
        self.next_face += 1

    def _normal(self, face: tuple[int, ...]) -> NDArray[np.floating]:
        a, b, c = (self.points[v] for v in face)
        x, y = b - a, c - a
        normal = np.array(
            [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
        )
        return normal / max(float(np.sqrt(normal @ normal)), 1e-15)

    def _split_long(self) -> None:
        long = sorted(((self._relative(a, b), a, b) for a, b in self._edges()), reverse=True)
        for relative, a, b in long:
            shared = self.around[a] & self.around[b]
            if relative < 4 / 3:
                break
            if not shared:
                continue
            middle = len(self.points)
            self.points.append((self.points[a] + self.points[b]) / 2)
            self.target_length.append((self.target_length[a] + self.target_length[b]) / 2)
            self.border.append(len(shared) == 1)
            self.around.append(set())
            for key in shared:
                face = self.faces[key]
                self._remove(key)
                for old in (a, b):
                    self._add(*(middle if v == old else v for v in face))

    def _collapse_short(self) -> None:
        for _, a, b in sorted((self._relative(a, b), a, b) for a, b in self._edges()):
            if self.around[a] and self.around[b] and self._relative(a, b) < 4 / 5:
                self._collapse(a, b)

    def _collapse(self, keep: int, drop: int) -> None:
        """Merges two neighbours if the surface stays closed, edges short and triangles upright."""
        shared = self.around[keep] & self.around[drop]
        if not shared or (self.border[keep] and self.border[drop] and len(shared) == 2):
            return
        if self.border[drop] and not self.border[keep]:
            keep, drop = drop, keep
        near_keep, near_drop = self._neighbours(keep), self._neighbours(drop)
        if len(near_keep & near_drop) != len(shared):
            return
        merged = (
            (self.points[keep] + self.points[drop]) / 2
            if self.border[keep] == self.border[drop]
            else self.points[keep]
        )
        old = self.points[keep], self.points[drop]
        kept = (self.around[keep] | self.around[drop]) - shared
        before = [self._normal(self.faces[key]) for key in kept]
        self.points[keep] = self.points[drop] = merged
        fine = all(self._relative(keep, v) < 4 / 3 for v in (near_keep | near_drop) - {keep, drop})
        fine = fine and all(
            n @ self._normal(self.faces[key]) > 0.4 for n, key in zip(before, kept, strict=True)
        )
        if not fine:
            self.points[keep], self.points[drop] = old
            return
        for key in shared:
            self._remove(key)
        for key in list(self.around[drop]):
            face = self.faces[key]
            self._remove(key)
            self._add(*(keep if v == drop else v for v in face))

    def _flip(self) -> None:
        """Flips edges whose corners then have nearer to six neighbours (four on the border)."""
        for a, b in self._edges():
            shared = self.around[a] & self.around[b]
            if len(shared) != 2:
                continue
            first, second = shared
            if not any(
                self.faces[first][k] == a and self.faces[first][(k + 1) % 3] == b for k in range(3)
            ):
                first, second = second, first
            c, d = (next(v for v in self.faces[key] if v not in (a, b)) for key in (first, second))
            if self.around[c] & self.around[d]:
                continue
            change = sum(
                self._excess(v, step) - self._excess(v, 0)
                for v, step in ((a, -1), (b, -1), (c, 1), (d, 1))
            )
            old = self._normal(self.faces[first]), self._normal(self.faces[second])
            new = self._normal((a, d, c)), self._normal((d, b, c))
            if change >= 0 or old[0] @ old[1] < 0.7 or min(n @ o for n in new for o in old) < 0.7:
                continue
            self._remove(first)
            self._remove(second)
            self._add(a, d, c)
            self._add(d, b, c)

    def _excess(self, v: int, step: int) -> int:
        target = 3 if self.border[v] else 6  # counted in triangles
        return (len(self.around[v]) + step - target) ** 2

    def _relax(self) -> None:
        """Moves vertices toward the middle of their neighbours, and back onto the surface."""
        points, border = np.array(self.points), np.array(self.border)
        faces = np.array(list(self.faces.values()))
        a, b = np.array(self._edges()).T
        on_border = border[a] & border[b]
        middle, count = np.zeros_like(points), np.zeros(len(points))
        for v, w in ((a, b), (b, a)):
            use = ~border[v] | on_border
            np.add.at(middle, v[use], points[w[use]])
            np.add.at(count, v[use], 1)
        normals = vertex_normals(points, faces)
        normals[border, 0] = 0
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        step = middle / np.maximum(count, 1)[:, None] - points
        step -= normals * (step * normals).sum(1, keepdims=True)
        points = project(points + 0.6 * step, border, self.surface)
        self.points, self.target_length = list(points), self.length(points).tolist()


def gradient(points: NDArray[np.floating], surface: Field) -> NDArray[np.floating]:
    """Gradient (N, 3) of a signed function by central differences."""
    step = 2e-4
    return np.stack(
        [
            (surface(points + move) - surface(points - move)) / (2 * step)
            for move in step * np.eye(3)
        ],
        -1,
    )


def project(
    points: NDArray[np.floating], border: NDArray[np.bool_], surface: Field, times: int = 2
) -> NDArray[np.floating]:
    """Projection of points onto the zero set, those of the border within the plane x = 0."""
    for _ in range(times):
        slope = gradient(points, surface)
        slope[border, 0] = 0
        move = slope * (surface(points) / np.maximum((slope * slope).sum(1), 0.05))[:, None]
        size = np.linalg.norm(move, axis=1, keepdims=True)
        points = points - move * np.minimum(1, 0.004 / np.maximum(size, 1e-12))
    return points


def fill_out(
    points: NDArray[np.floating],
    faces: NDArray[np.integer],
    border: NDArray[np.bool_],
    surface: Field,
) -> NDArray[np.floating]:
    """Vertices moved outward until triangles lie as much outside a round surface as inside it.

    This preserves girths.
    """
    middles = points[faces].mean(1)
    slope = np.maximum(np.linalg.norm(gradient(middles, surface), axis=1), 0.3)
    depth = np.clip(surface(middles) / slope, -0.003, 0.003)
    total, count = np.zeros(len(points)), np.zeros(len(points))
    for k in range(3):
        np.add.at(total, faces[:, k], depth)
        np.add.at(count, faces[:, k], 1)
    normals = vertex_normals(points, faces)
    normals[border, 0] = 0
    return points - 0.7 * normals * (total / np.maximum(count, 1))[:, None]
