"""The protocol of scoring backends, and how backends are found.

A backend scores many candidates against one observation. It is a class without constructor
arguments, registered under the entry point group `silhouette_core.backends`:

    [project.entry-points."silhouette_core.backends"]
    cpu = "silhouette_core.scoring.cpu:CpuBackend"

Both estimators score candidates through it alone, and draw them through it; `Settings.backend`
chooses it by name. docs/architecture.md says what it does not cover, and why; examples/ has a
backend written by this page, and the tests of any, `backend_conformance`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from calib.checks import (
    BoolArray,
    ByteArray,
    FloatArray,
    IndexArray,
    IntArray,
    RealArray,
    check_array,
)
from silhouette_core.entry_points import load_registered
from silhouette_core.image.spans import Spans
from silhouette_core.ranking import summable
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.scoring.kernels import spans as kernels


@dataclass(frozen=True, eq=False)
class Target:
    """Silhouettes seen through P windows, each compared with candidates moved by S shifts.

    Combination c of the C = P S is window c // S and shift c % S.
    """

    masks: tuple[BoolArray, ...]  #: P arrays (h, w) bool, P of eq. (7).
    weights: tuple[RealArray, ...]
    """P arrays (h, w) float32 or float64, d_P, made `summable`. Beyond the window the weight at its
    border goes on."""
    shifts_px: IntArray = field(default_factory=lambda: np.zeros((1, 2), np.int64))
    """(S, 2) int64, whole pixels (right, down) by which candidates are moved."""
    scale: float = 1.0  #: Factor on the weighted disagreement.

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", tuple(map(summable, self.weights)))

    @property
    def margin_px(self) -> int:
        """Largest shift, px."""
        return int(np.abs(self.shifts_px).max(initial=0))

    @cached_property
    def prefixes(self) -> tuple[FloatArray, FloatArray]:
        """Sums of the signed weights d_P (1 - 2 P) along rows, of every window and a margin m about
        it, (P, h + 2 m, w + 2 m + 1) float64; and the weight of each silhouette P, (C,) float64.
        """
        (height, width), margin = self.masks[0].shape, self.margin_px
        prefixes = np.empty((len(self.masks), height + 2 * margin, width + 2 * margin + 1))
        bases = [
            kernels.padded_prefix(mask, weights, margin, prefix)
            for mask, weights, prefix in zip(self.masks, self.weights, prefixes, strict=True)
        ]
        return prefixes, np.repeat(bases, len(self.shifts_px))


GROUP = "silhouette_core.backends"


class Grid(Protocol):
    """Cubic voxels in the world, for example a `voxelpose.multiview.carving.grid.VoxelGrid`."""

    @property
    def origin_m(self) -> FloatArray:
        """(3,) world, m: the lower corner of voxel (0, 0, 0)."""
        ...

    @property
    def voxel_size_m(self) -> float:
        """Edge of a voxel, m."""
        ...


@runtime_checkable
class Backend(Protocol):
    """Scores of many candidates against one observation.

    All backends give the same numbers, for any number of threads. Weights are `summable`
    (`silhouette_core.ranking`): multiples of one power of two, so small that float64 holds every
    sum of them. So sums are exact in any order.
    Means over cameras agree to 1e-12, all else bit for bit, unless a coordinate is within rounding
    of a pixel's or voxel's border. K, P and F may be 0.

    **Arrays** are float64 where no type is named, need not be contiguous, and are never written to,
    neither by the backend nor, once handed over, by the caller; but `numbers` of `voxel_cover`
    change between calls. Results are new arrays. What stays the same from call to call is the same
    object: the spans of a library's level, a body's faces, the points of a limb, a frame's masks
    and voxels. A device may keep a copy beside each as long as a weak reference to it is alive.

    **Threads and processes.** A process has one object of a backend, made there by name and never
    pickled. Its methods are called from any thread, and from several at once where things are
    worked on side by side; those are to keep to one core each, as `numba.get_num_threads()` says.

    **Drawing** is the same in all methods:

    - Of a matrix ((f, s, c), (0, g, d), (0, 0, 1)), a vertex (x, y, z) is at column (f x + s y) / z
      + c and row g y / z + d, computed in float64. Both are rounded to 1/256 pixel, halves up:
      floor(256 v + 1/2). All that follows is exact in integers.
    - Pixel (column, row) is sampled at these integers. A centre on an edge belongs to the triangle
      of which that is a left edge, or a horizontal one above it; triangles without area draw none.
    - Outward faces run counter-clockwise on the screen, seen from outside: (b - a) x (c - a) < 0, y
      down. The others are left out, unless `cull_back` is False.
    - Of several faces in a pixel the nearest is drawn: 1 / z is linear on the screen between the
      rounded corners, and depths are compared as float32; of equal ones, the first face counts.
    - Faces are cut off at z = 0.05 m, those behind are left out, and those with a corner that is
      not finite. A corner where an edge is cut is at z = 0.05 m exactly, and rounded likewise.

    **Placements.** Wherever K placements of a rigid part are scored, `points` (P, 3) m fill the
    part, in its frame, and `rotations` (K, 3, 3) and `translations_m` (K, 3) are world from part.
    """

    def span_distances(self, target: Target, spans: Spans, which: IndexArray) -> FloatArray:
        """Distance from observed silhouettes to others: nodes of the tree, samples of a library.

        Args:
            target: The observed silhouettes P with their pixel weights d_P, and how Q is moved:
                C combinations of window and shift. Pixels of Q that leave the window still count,
                with the weight at its border.
            spans: Silhouettes Q of at most the target's size, rows and columns int16 or int32; not
                checked, since that would read all of a library.
            which: (K,) int64, numbers of the silhouettes to be measured.

        Returns:
            (K, C) float64.

        Raises:
            ValueError: A number that no silhouette has.

        Source: Okada and Stenger, eq. (6)-(9).
        """
        ...

    def part_images(
        self,
        vertices_cam: FloatArray,
        faces: IndexArray,
        face_part: IndexArray,
        matrix: FloatArray,
        size: tuple[int, int],
        cull_back: bool = True,
    ) -> ByteArray:
        """Part images of K poses of a mesh.

        Args:
            vertices_cam: (K, V, 3) m, camera frame.
            faces: (F, 3) int32 or int64, vertex indices.
            face_part: (F,) int32 or int64, part index of each face, 0 to 254.
            matrix: (3, 3) pinhole matrix, px.
            size: Width and height, px.
            cull_back: Leaves out faces seen from behind.

        Returns:
            (K, h, w) uint8, 0 for background and part index + 1 elsewhere.

        Source: Okada and Stenger, 3.1.
        """
        ...

    def drawn_weights(
        self, weights: FloatArray, vertices_cam: FloatArray, faces: IndexArray, matrix: FloatArray
    ) -> FloatArray:
        r"""Sum of pixel weights under each of K drawn meshes.

        With weights :math:`d_P (1 - 2 P)` the sum over a silhouette Q is what Q adds to eq. (7):

        .. math:: \sum_x d_P |P - Q| = \sum_x d_P P + \sum_{x \in Q} d_P (1 - 2 P)

        Args:
            weights: (h, w), the weight of each pixel.
            vertices_cam: (K, V, 3) m, camera frame.
            faces: (F, 3) vertex indices, oriented outwards.
            matrix: (3, 3) pinhole matrix, px.

        Returns:
            (K,) float64.

        Source: Okada and Stenger, eq. (7)-(9), rearranged.
        """
        ...

    def silhouette_errors(
        self,
        masks: Sequence[BoolArray],
        matrices: FloatArray,
        vertices_cam: FloatArray,
        faces: IndexArray,
        unknown: Sequence[BoolArray] | None = None,
    ) -> FloatArray:
        r"""Unexplained fraction of the silhouettes for K poses, the mean over the cameras.

        .. math:: e = \frac{1}{C} \sum_c \frac{|P_c \oplus Q_c|}{|P_c \cup Q_c|}

        Cameras in which both silhouettes are empty are left out; with none left the error is 1.

        Args:
            masks: C observed silhouettes P (h, w) bool, each of its camera's size.
            matrices: (C, 3, 3) pinhole matrices, px.
            vertices_cam: (K, C, V, 3) m, each pose's closed mesh in the frame of every camera.
            faces: (F, 3) vertex indices, oriented outwards.
            unknown: C arrays (h, w) bool, pixels that do not count, where the silhouettes P are
                empty; None: all count.

        Returns:
            (K,) float64, 0 perfect, 1 apart.
        """
        ...

    def pixel_scores(
        self,
        views: PinholeViews,
        images: NDArray[np.int8],
        points: FloatArray,
        rotations: FloatArray,
        translations_m: FloatArray,
    ) -> IntArray:
        """Sum of the pixels to which the points of each placement project, over all cameras.

        A point is looked up in the pixel at floor(v + 1/2) of its column and row. One less than
        0.05 m before a camera, or outside its image, counts nothing there.

        Args:
            views: C cameras; `intrinsics`, `rotation` and `translation_m` are all that counts.
            images: (C, h, w) int8, the score of each pixel.

        Returns:
            (K,) int64.
        """
        ...

    def voxel_overlap(
        self,
        grid: Grid,
        occupancy: BoolArray,
        points: FloatArray,
        weights: FloatArray,
        rotations: FloatArray,
        translations_m: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Weight of each placement's points in occupied and in empty voxels: a point is in voxel
        floor((world - origin) / size).

        Args:
            occupancy: (nx, ny, nz) bool; what lies outside of it is empty.
            weights: (P,) what each point counts, for example its volume.

        Returns:
            Weight in occupied voxels (K,) float64, and in empty ones (K,) float64.

        Source: Iiyama, Kameda and Minoh, section 2, the overlap of a part with the voxels.
        """
        ...

    def voxel_cover(
        self,
        grid: Grid,
        numbers: NDArray[np.int32],
        words: int,
        points: FloatArray,
        rotations: FloatArray,
        translations_m: FloatArray,
    ) -> tuple[NDArray[np.uint64], IntArray, IntArray]:
        """Voxels that each placement covers, as sets of bits.

        Args:
            numbers: (nx, ny, nz) int32, the number of each free voxel; -1 for empty space, -2 for
                voxels that a part already placed has taken.
            words: W; all numbers are below 64 W.

        Returns:
            Sets (K, W) uint64, bit n % 64 of word n // 64 for voxel n; points in empty space or
            outside the grid (K,) int64; points in taken voxels (K,) int64.

        Source: Iiyama, Kameda and Minoh, section 3, sets of voxels with several candidate parts.
        """
        ...


@cache
def load_backend(name: str) -> Backend:
    """Returns this process's backend of that name, the same one every time.

    Raises:
        InputError: None is registered under this name.
        TypeError: What is registered is not a backend.
    """
    return load_registered(GROUP, "backend", Backend, name)


def chosen_spans(spans: Spans, which: IndexArray) -> IndexArray:
    """Returns the numbers of the silhouettes to be measured, checked; for backends."""
    if len(which) and (which.min() < 0 or which.max() >= len(spans)):
        raise ValueError(f"which must be 0 to {len(spans) - 1}, got {which.min()} to {which.max()}")
    return np.ascontiguousarray(which)


def checked_placements(
    points: FloatArray, rotations: FloatArray, translations_m: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Returns placed points as contiguous float64, checked; for backends."""
    check_array("points", points, ("P", 3))
    check_array("rotations", rotations, ("K", 3, 3))
    check_array("translations_m", translations_m, (len(rotations), 3))
    return tuple[Any, Any, Any](
        np.ascontiguousarray(array, np.float64) for array in (points, rotations, translations_m)
    )
