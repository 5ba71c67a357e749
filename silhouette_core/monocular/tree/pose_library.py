"""Pose library: recorded poses seen from all sides, and the tree over their silhouettes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calib.checks import BoolArray, Float32Array, FloatArray, IndexArray, IntArray
from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.image.distance import distances_to, relative_depths
from silhouette_core.image.spans import Rectangle, Spans
from silhouette_core.monocular.proposal.pose_proposal import PoseProposal
from silhouette_core.monocular.tree.rendering import (
    RenderedViews,
    pose_surfaces,
    render_views,
    view_rotations,
)
from silhouette_core.monocular.tuning import TREE
from silhouette_core.monocular.window import SIZE
from silhouette_core.motion.kinematics import quaternions


def nwxor_weights(mask: BoolArray, bounds_px: Rectangle) -> Float32Array:
    r"""Weights of the pixels of a silhouette's window.

    Every pixel counts by its distance from the contour of the silhouette P, :math:`D_P` inside and
    :math:`D_{\neg P}` outside of it, normalised by the distance :math:`D_{P_{med}}` to the thinned
    silhouette, so that thick and thin parts count alike:

    .. math::
        :label: okada-9

        d_P = \frac{D_P}{D_P + D_{P_{med}}} + w' \, D_{\neg P}

    with w' one over the largest :math:`D_{\neg P}` in the rectangle that holds every pose of the
    tree, the outer limit of the outside: inside and outside have the same maximum in it.

    Args:
        mask: (h, w) bool, the silhouette P.
        bounds_px: that rectangle, `PoseLibrary.bounds_px`, in pixels of an image 240 high, whatever
            h is; where the silhouette covers it, the window.

    Returns:
        (h, w) float32, d_P: beyond the rectangle, where no pose is, above 1; all 1 where a
        silhouette that is empty or fills its window has no contour.

    Source: Okada and Stenger, eq. (9).
    """
    if not mask.any() or mask.all():
        return np.ones(mask.shape, np.float32)
    outside, scale = distances_to(mask), len(mask) / SIZE[1]
    left, top = np.floor(np.array(bounds_px[:2]) * scale).astype(int)
    right, bottom = np.ceil(np.array(bounds_px[2:]) * scale).astype(int)
    largest = outside[top:bottom, left:right].max(initial=np.float32(0.0)) or outside.max()
    return outside / largest + relative_depths(mask)  # eq. (9)


@dataclass(frozen=True, eq=False)
class Level:
    """One level of the tree: K nodes, the children of one parent next to each other."""

    representative: NDArray[np.int32]  #: (K,) int32, the sample that represents the node.
    parent: NDArray[np.int32]  #: (K,) int32, node of the level above; zeros at the first level.
    spans: Spans  #: the representatives' silhouettes in node order, at this level's resolution.
    size_px: tuple[int, int]  #: (width, height) of that resolution.
    threshold: float
    """T_l, largest silhouette distance of a sample from its node, in the settings' weighting."""

    def __len__(self) -> int:
        """Number of nodes."""
        return len(self.representative)


@dataclass(frozen=True)
class LibrarySettings:
    """Settings of a library."""

    poses: int = 60_000  #: largest number of samples (base poses times views).
    tolerance_deg: float = 5.0
    """Base poses are removed until no two remain whose joint angles all differ by this or less; if
    there are still more than `poses` allows, also by the positions of their joints."""
    yaw_step_deg: float = 15.0  #: angle between the views of a pose; 360: one view.
    pitches_deg: tuple[float, ...] = (8.0,)  #: Angles of the camera below the horizontal.
    mirror: bool = True  #: whether every pose's mirror image is added.
    thresholds: tuple[float, float, float] = TREE.thresholds
    """T_l of each level, in units of XOR, see `Scorer.threshold` of
    `silhouette_core.monocular.tree.tree`."""
    weighting: str = "nwxor"  #: Of the silhouette distance that divides them: "nwxor" or "xor".

    def __post_init__(self) -> None:
        """Checks the values. Raises InputError where a value makes no library."""
        if (
            not (1 <= self.yaw_step_deg <= 180 or self.yaw_step_deg == 360)
            or abs(360 / self.yaw_step_deg - round(360 / self.yaw_step_deg)) > 1e-6
        ):
            raise InputError(
                f"a yaw step of {self.yaw_step_deg:g} degrees does not divide the full turn: give"
                " for example 10, 15 or 20"
            )
        if not self.pitches_deg or any(not -60 <= pitch <= 75 for pitch in self.pitches_deg):
            raise InputError(
                f"pitch {self.pitches_deg} is not one a standing camera has: give degrees down from"
                " the horizontal, as in 8"
            )
        if self.poses < self.views_count:
            raise InputError(
                f"{self.poses} poses are too few: every recorded pose is seen from"
                f" {self.views_count} sides"
            )
        if not self.tolerance_deg > 0:
            raise InputError(
                f"a tolerance of {self.tolerance_deg:g} degrees leaves nothing out: give a"
                " positive one"
            )

    @property
    def views_count(self) -> int:
        """Number of views of each base pose."""
        return round(360 / self.yaw_step_deg) * len(self.pitches_deg)

    def views(self) -> FloatArray:
        """Yaw and pitch (V, 2), radians, the yaws of one pitch next to each other."""
        yaw = np.arange(round(360 / self.yaw_step_deg)) * self.yaw_step_deg
        return np.radians([[y, pitch] for pitch in self.pitches_deg for y in yaw])

    def weights(self, mask: BoolArray, bounds_px: Rectangle) -> Float32Array:
        r"""Weights (h, w) of the pixels of a silhouette P, (h, w) bool: `nwxor_weights`, or by
        XOR, the density of the window's pixels W that disagree with a silhouette Q, all 1.

        .. math::
            :label: okada-6

            d_{XOR}(P, Q) = \frac{1}{|W|} \sum_{x \in W} |P(x) - Q(x)|

        Source: Okada and Stenger, eq. (6).
        """
        if self.weighting == "nwxor":
            return nwxor_weights(mask, bounds_px)
        return np.ones(mask.shape, np.float32)  # eq. (6)


@dataclass(frozen=True, eq=False)
class BasePoses:
    """B base poses."""

    angles: Float32Array  #: (B, D) float32, joint angles, radians.
    quaternion: Float32Array  #: (B, 4) float32, w x y z, of the pelvis, heading removed.
    source: NDArray[np.int32]  #: (B, 2) int32, index of the clip and number of the frame.
    mirrored: BoolArray  #: (B,) bool, whether the pose is the mirror image of its source.
    clips: tuple[str, ...]  #: names of the clips.
    sigma_rad: Float32Array
    """(D,) float32, step sizes of the joint angles within 1/30 s, spacing of the library included,
    see `base_poses.motion_sigmas`."""
    root_sigma_rad: float  #: step size of the pelvis's orientation.
    spacing_m: float
    """Least distance along some axis of some joint of any two poses, if the tolerance in degrees
    left too many; else 0; of a library that was read, too."""
    frames: int  #: number of poses before thinning; 0 of a library that was read.


@dataclass(frozen=True, eq=False)
class PoseLibrary:
    """B base poses from V views, N samples, in a tree of silhouettes; L levels."""

    model: BodyModel  #: the body, which faces -y at yaw 0.
    settings: LibrarySettings
    bases: BasePoses
    views: FloatArray  #: (V, 2) float64, yaw and pitch, radians, see `rendering.camera_from_body`.
    sample_base: NDArray[np.int32]  #: (N,) int32, base pose of each sample.
    sample_view: NDArray[np.int16]  #: (N,) int16, view of each sample.
    pelvis_px: Float32Array  #: (N, 2) float32, pelvis joint in the window of 320 x 240.
    areas: NDArray[np.uint16]  #: (N, 27) uint16, visible pixels of each part, A_j.
    occluded: BoolArray  #: (N, 27) bool, f_j of eq. (3).
    cut: BoolArray  #: (N,) bool, whether the window cuts off some of the silhouette.
    levels: tuple[Level, ...]  #: coarse to fine.
    leaf_offsets: IntArray
    """(K_L + 1,) int64; node k of the finest level has the samples leaf_offsets[k] to
    leaf_offsets[k + 1] - 1 of leaf_samples, the representative among them."""
    leaf_samples: NDArray[np.int32]  #: (N,) int32, samples of all leaves.
    bounds_px: Rectangle
    """Smallest rectangle of the window of 320 x 240 that holds the silhouettes of all samples, the
    outer limit of eq. (9)."""
    neighbours: Mapping[str, NDArray] = field(default_factory=dict)
    """Nearest samples of every sample, see `transitions.find_neighbours`."""
    proposal: PoseProposal | None = None  #: learned proposal of poses; None: the library has none.

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.sample_base)

    @cached_property
    def child_offsets(self) -> tuple[IntArray, ...]:
        """Offsets (K_l + 1,) of the children of every level's nodes.

        Node k has the nodes offsets[k] to offsets[k + 1] - 1 of the next level; a leaf has these
        positions in leaf_samples.
        """
        offsets = [
            np.searchsorted(below.parent, np.arange(len(level) + 1)).astype(np.int64)
            for level, below in zip(self.levels[:-1], self.levels[1:], strict=True)
        ]
        return (*offsets, np.asarray(self.leaf_offsets))

    def pose(self, samples: IndexArray) -> tuple[FloatArray, FloatArray]:
        """Poses of samples (n,) before a level camera that looks along +y.

        Returns:
            Orientations of the pelvis (n, 4) w x y z, with the view's yaw, and joint angles (n, D).
        """
        base = self.sample_base[samples]
        views = self.views[self.sample_view[samples]]
        matrices = view_rotations(self.bases.quaternion[base], views)
        return quaternions(matrices), self.bases.angles[base].astype(np.float64)

    def render(self, samples: IndexArray) -> RenderedViews:
        """Views of samples (n,), rendered again exactly as in the build of the library.

        The library stores the silhouettes of the representatives only, which the filter scores; the
        other samples of a leaf look alike by construction.
        """
        base, surface = np.unique(self.sample_base[samples], return_inverse=True)
        surfaces = pose_surfaces(self.model, self.bases.quaternion[base], self.bases.angles[base])
        return render_views(self.model, surfaces, surface, self.views[self.sample_view[samples]])


def describe_body(model: BodyModel) -> str:
    """A body as text: a person's measurements, or its parts."""
    sizes = model.person
    if sizes is None:
        return f"{len(model.names)} parts, root {model.names[0]}, {model.extent_m:.2f} m"
    chest = "usual" if sizes.chest_girth_m is None else f"{sizes.chest_girth_m:g} m"
    return f"stature {sizes.stature_m:g} m, chest {chest}, sex {sizes.sex}"
