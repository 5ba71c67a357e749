"""The pose library of the arm-swing experiment: somebody standing in profile, the right arm moved
in many ways.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.library.base_poses import base_poses
from silhouette_core.library.build import build_library
from silhouette_core.library.pose_library import LibrarySettings, PoseLibrary
from silhouette_core.library.transitions import find_neighbours
from silhouette_core.motion.keyposes.notation import COLUMNS, STANDING, Movement
from silhouette_core.motion.keyposes.perform import perform
from silhouette_core.progress import Reporter

NEIGHBOURS = 512
SAMPLES = 3417  # the paper's
_NODE_SHARES = (693 / 3417, 3013 / 3417, 3318 / 3417)  # the paper's
_CLIPS, _KEYS, _BETWEEN_S = 6, 60, 0.7
# From, to (degrees) of what moves, see silhouette_core.motion.keyposes.notation: the right arm
# anywhere it reaches in profile ...
_ARM = {"r.arm": (-70, 110), "r.out": (0, 35), "r.elbow": (0, 90), "r.turn": (-20, 40)}
# ... and the rest as somebody stands, the same throughout a clip.
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
    """A library that is seen from around one side only.

    Attributes: middle_deg: yaw of that side: 90 shows the right side, the body facing right in the
        picture; -90 the left side. sides: how many yaws about it, `yaw_step_deg` apart.
    """

    middle_deg: float = 90.0
    sides: int = 3

    @property
    def views_count(self) -> int:
        """Number of views of each base pose."""
        return self.sides * len(self.pitches_deg)

    def views(self) -> NDArray[np.float64]:
        """Returns (V, 2) yaw and pitch, radians."""
        yaws = self.middle_deg + self.yaw_step_deg * (np.arange(self.sides) - (self.sides - 1) / 2)
        return np.radians([[yaw, pitch] for pitch in self.pitches_deg for yaw in yaws])


def swing_library(
    model: BodyModel,
    near: bool,
    pitch_deg: float,
    reporter: Reporter | None = None,
    samples: int = SAMPLES,
) -> PoseLibrary:
    """Makes the library.

    Args:
        model: the body.
        near: the right side is toward the camera; else the trunk hides the right arm as it passes.
        pitch_deg: how far the camera looks down.
        reporter: told of every stage.
        samples: how many at most.

    Returns: About as many samples as in the paper, and as many nodes; the arm goes from one place
        to another at random, as in no recording.

    Source: Okada and Stenger, section 7: mostly profile poses, the right arm moved in various ways.
    """
    settings = ProfileSettings(
        poses=samples,
        yaw_step_deg=8.0,
        pitches_deg=(pitch_deg,),
        mirror=False,
        node_shares=_NODE_SHARES,
        middle_deg=90.0 if near else -90.0,
    )
    rng = np.random.default_rng(_SEED)
    motions = {f"right arm {k + 1}": perform(_movement(rng), model) for k in range(_CLIPS)}
    library = build_library(base_poses(motions, settings), model, settings, reporter)
    # Hidden arms reach hundreds of so few poses: more than a library usually keeps.
    return replace(
        library, neighbours=find_neighbours(library, min(NEIGHBOURS, len(library)), reporter)
    )


def _movement(rng: np.random.Generator) -> Movement:
    poses = np.tile(STANDING, (_KEYS, 1))
    for name, (low, high) in _STANCE.items():
        for column in (name,) if name in COLUMNS else (f"l.{name}", f"r.{name}"):
            poses[:, COLUMNS.index(column)] = rng.uniform(low, high)
    for name, (low, high) in _ARM.items():
        poses[:, COLUMNS.index(name)] = rng.uniform(low, high, _KEYS)
    return Movement(_BETWEEN_S * np.arange(_KEYS, dtype=np.float64), poses, (0.0, 0.0))
