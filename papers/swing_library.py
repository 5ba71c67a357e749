"""Pose library of the arm-swing experiment: standing in profile, the right arm in many poses."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.image.distance import distances_to
from silhouette_core.image.spans import Rectangle
from silhouette_core.monocular.tree.base_poses import base_poses
from silhouette_core.monocular.tree.build import build_library
from silhouette_core.monocular.tree.pose_library import LibrarySettings, PoseLibrary
from silhouette_core.monocular.tree.transitions import find_neighbours
from silhouette_core.monocular.window import SIZE
from silhouette_core.motion.keyposes.notation import COLUMNS, STANDING, Movement
from silhouette_core.motion.keyposes.perform import perform
from silhouette_core.motion.motion import Motion
from silhouette_core.progress import Reporter

NEIGHBOURS = 512
SAMPLES = 3417  # the paper's
# With them, the levels have about the paper's 693, 3,013 and 3,318 of 3,417 nodes.
_NEAR, _FAR = (0.00466, 0.000573, 0.000234), (0.00379, 0.000416, 0.000078)
_CLIPS, _KEYS, _BETWEEN_S = 6, 60, 0.7
# Ranges in degrees of the columns of silhouette_core.motion.keyposes.notation. The right arm is
# anywhere within its reach in profile;
_ARM = {"r.arm": (-70, 110), "r.out": (0, 35), "r.elbow": (0, 90), "r.turn": (-20, 40)}
# the other joints are those of a standing person, constant throughout a clip.
_STANCE = {
    "l.arm": (-5, 10),
    "l.out": (5, 12),
    "l.elbow": (10, 40),
    "lean": (-2, 3),
    "nod": (-4, 6),
    "straddle": (2, 8),
}
_SEED = 3


@dataclass(frozen=True)
class ProfileSettings(LibrarySettings):
    """Settings of a library with views of one side only; its `weighting` may be "wxor".

    Attributes:
        middle_deg: yaw of that side: 90 shows the right side, the body facing right in the picture;
            -90 the left side.
        sides: number of yaws about it, `yaw_step_deg` apart.
    """

    middle_deg: float = 90.0
    sides: int = 3

    @property
    def views_count(self) -> int:
        """Number of views of each base pose."""
        return self.sides * len(self.pitches_deg)

    def views(self) -> NDArray[np.float64]:
        """Yaw and pitch (V, 2) of the views, radians."""
        yaws = self.middle_deg + self.yaw_step_deg * (np.arange(self.sides) - (self.sides - 1) / 2)
        return np.radians([[yaw, pitch] for pitch in self.pitches_deg for yaw in yaws])

    def weights(self, mask: NDArray[np.bool_], bounds_px: Rectangle) -> NDArray[np.float32]:
        """Weights (h, w) of the pixels of a silhouette (h, w) bool."""
        if self.weighting == "wxor":
            return wxor_weights(mask)
        return super().weights(mask, bounds_px)


def wxor_weights(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    r"""Weights (h, w) of the pixels of a silhouette P, (h, w) bool, by wXOR: their distances from
    its contour, :math:`D_P` inside and :math:`D_{\neg P}` outside, in pixels of an image 240 high;
    1 where it has none.

    .. math::
        :label: okada-8

        d_P = D_P + w \, D_{\neg P}

    Source: Okada and Stenger, eq. (8); that w is 1 is ours.
    """
    if not mask.any() or mask.all():
        return np.ones(mask.shape, np.float32)
    distances = distances_to(~mask) + distances_to(mask)  # eq. (8)
    return distances * np.float32(SIZE[1] / len(mask))


def arm_motions(model: BodyModel) -> dict[str, Motion]:
    """Clips by name: the arm of somebody who stands moves between random poses. The same ones for
    every library.
    """
    rng = np.random.default_rng(_SEED)
    return {f"right arm {k + 1}": perform(_movement(rng), model) for k in range(_CLIPS)}


def swing_library(
    motions: Mapping[str, Motion],
    near: bool,
    pitch_deg: float,
    weighting: str,
    reporter: Reporter | None = None,
    samples: int = SAMPLES,
) -> PoseLibrary:
    """Builds the library.

    Args:
        motions: see `arm_motions`.
        near: whether the right side is toward the camera; else the trunk occludes the right arm as
            it passes.
        pitch_deg: downward angle of the camera.
        weighting: of the silhouette distance by which the tree is made.
        reporter: notified of every stage.
        samples: largest number of samples.

    Returns:
        A library with about as many samples and nodes as in the paper.

    Source: Okada and Stenger, section 7: mostly profile poses, the right arm moved in various ways.
    """
    settings = ProfileSettings(
        poses=samples,
        yaw_step_deg=8.0,
        pitches_deg=(pitch_deg,),
        mirror=False,
        thresholds=_NEAR if near else _FAR,
        middle_deg=90.0 if near else -90.0,
        weighting=weighting,
    )
    model = next(iter(motions.values())).model
    library = build_library(base_poses(motions, settings), model, settings, reporter)
    # Of so few poses, occluded arms reach hundreds: more than a library usually stores.
    kept = min(NEIGHBOURS, len(library))
    dm1, dm2 = (find_neighbours(library, aware, kept, reporter) for aware in (False, True))
    return replace(library, neighbours=dm1 | dm2)


def _movement(rng: np.random.Generator) -> Movement:
    poses = np.tile(STANDING, (_KEYS, 1))
    for name, (low, high) in _STANCE.items():
        for column in (name,) if name in COLUMNS else (f"l.{name}", f"r.{name}"):
            poses[:, COLUMNS.index(column)] = rng.uniform(low, high)
    for name, (low, high) in _ARM.items():
        poses[:, COLUMNS.index(name)] = rng.uniform(low, high, _KEYS)
    return Movement(_BETWEEN_S * np.arange(_KEYS, dtype=np.float64), poses, (0.0, 0.0))
