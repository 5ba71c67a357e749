"""Tuned numbers of the multi-view estimator: name, unit, what each does, where it comes from."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Refining:
    """Refinement of poses on the silhouettes (`matching.pose_search`, `carving.observe`)."""

    searched_reach_m: float = 0.30
    """m. First reach of a refinement from a search, whose samples are so far off. By eye."""
    step_reach_m: float = 0.18
    """m. First reach from a pose that is predicted, or right but for a limb. Tuned for the live
    follower on walk4 and seeds 221 to 228 by `python -m benchmarks.follower`."""
    smooth_reach_m: float = 0.08
    """m. First reach where nothing but the neighbours in time is new. Chosen by eye."""
    last_reach_m: float = 0.06
    """m. Last reach of every refinement: five sigmas of a contour residual. Chosen by eye."""
    shrinkage: float = 0.7
    """1. Each reach over the one before, about. Of the sequences that were tuned before."""
    spacing_m: float = 0.035
    """m. Distance between contour points on the body. Tuned on walk4 and seed 123 (40 frames of
    true silhouettes, root_mm): 0.05 15.0 and 17.8, 0.035 14.6 and 17.4, 0.025 14.8 and 17.3."""
    margin: float = 0.25
    """1. Of a silhouette's longer side: distances from it are exact as far. As `step_reach_m`."""


@dataclass(frozen=True)
class Tracking:
    """The step from a pose to that of the next frame, off line and live (`tracking`)."""

    better: float = 0.97
    """1. Of a pose's error, below which another replaces it. Chosen by eye, not ablated."""
    lost: float = 0.45
    """1. Largest error of a pose that is kept. Chosen by eye; right ones have 0.06 to 0.10."""
    suspect: float = 0.16
    """1. Error above which a pose may be a wrong one, or the body another. Chosen by eye."""
    poor: float = 1.2
    """1. Of the usual error, above which a frame is tried a second time. Chosen by eye."""
    poor_by: float = 0.01
    """1. Excess over that, of outlines that fit nearly perfectly. Chosen by eye."""
    bad: float = 1.4
    """1. Of the usual error, above which a search is due. Chosen by eye."""
    recent: int = 12
    """Frames whose median error is the usual one: 0.4 s. Chosen by eye."""
    long_steps: float = 2.5
    """1 / FPS. Time between frames from which a refinement reaches as far as after a search. Tuned
    on walk4 by `python -m benchmarks.follower --every 3 --late 2`."""
    longest_steps: float = 6.0
    """1 / FPS. Time after which process noise grows no more. As `long_steps`."""
    unexpected: float = 3.0
    """Sigmas of the process noise about the last pose in a second try. Chosen by eye."""


@dataclass(frozen=True)
class OffLine:
    """Repair of a whole recording's poses (`tracking.tracking`)."""

    again: float = 0.12
    """1. Median error from which a recording is begun again; right ones have 0.06 to 0.10."""
    again_frames: int = 9
    """Frames that are searched then. Chosen by eye."""
    again_placements: int = 20
    """Placements of the torso that are tried then. Chosen by eye."""
    beside: int = 3
    """Frames beside a searched one that are not searched as well. Chosen by eye."""
    limbs_again_s: float = 0.5
    """s. Time between the frames in which arms and legs are searched. Chosen by eye."""
    jump_m: float = 0.10
    """m. Mean step of the joints within 1 / FPS from which it may be a jump: 3 m/s. By eye."""
    jump_ratio: float = 3.0
    """1. Over the steps around it, from which it is one. Chosen by eye."""
    continued: float = 1.1
    """1. Of a stretch's error, up to which one that continues its neighbours replaces it."""
    continued_short: float = 1.5
    """1. The same of a short stretch. Chosen by eye."""
    short_s: float = 0.25
    """s. Length of a short stretch. Chosen by eye."""


@dataclass(frozen=True)
class Live:
    """What the live follower does beside the step (`tracking.follower`, `tracking.track_jobs`)."""

    voxel_size_m: float = 0.025
    """m. Of the hull that is searched, as off line."""
    first_placements: int = 4
    """Placements of the torso in a first search: the fewer, the sooner it catches up."""
    placements: int = 10
    """The same in a search to improve, as off line."""
    longest_gap_s: float = 0.5
    """s. Time after which a track is given up. Chosen by eye."""
    longest_gap: float = 3.5
    """Frames of a slow camera after which it is given up. Tuned on walk4 with `--every 3`."""
    poor_again_s: float = 0.7
    """s. Least time between searches where poses are bad. Chosen by eye."""
    limbs_again_s: float = 3.0
    """s. Least time between searches of arms and legs where nothing is wrong. Chosen by eye."""
    adapted: int = 8
    """Frames to which proportions are adapted. Chosen by eye."""
    apart_s: tuple[float, ...] = (0.4, 1.5, 4.0)
    """s. Time between these, for a first adaptation and for later ones. Chosen by eye."""
    foreground: float = 0.002
    """1. Least fraction of a picture that a person takes. Chosen by eye."""
    caught_up: int = 2
    """Frames that may still be missing when a search has caught up. Chosen by eye."""
    forgotten_s: float = 6.0
    """s. Age after which the frames since a search began are forgotten. Chosen by eye."""
    longest_step_s: float = 0.14
    """s. Longest step of a track that catches up: frames are passed over up to it. Tuned on walk4
    by `python -m benchmarks.follower --every 3 --late 2`."""
    most_wrong: int = 5
    """Frames running that are wrong, after which a track that catches up is given up. As above."""
    given_sigma_m: float = 0.006
    """m. Standard deviation of a stature that was told. As off line."""
    hull_sigma: float = 0.05
    """1. The same of one by the hull, relative. As off line."""


@dataclass(frozen=True)
class Carving:
    """The visual hull, and one body's part of it (`carving`)."""

    coarse_m: float = 0.05
    """m. Voxels in which a body is looked for; twice as far its window reaches. Chosen by eye."""
    limb_m: float = 1.0
    """m. A leg's length with the foot: as far one camera's silhouette may show the body alone."""
    explained: float = 0.04
    """1. Largest unexplained share of a silhouette that the hull counts as explaining. By eye."""
    small: float = 0.02
    """1. Of a silhouette: a hand or a foot is smaller. Chosen by eye."""
    crumb: float = 0.03
    """1. Of the largest component, below which another is no limb. Chosen by eye."""
    gap_m: float = 0.25
    """m. Height of a gap between pieces of one body. Chosen by eye, on standing4."""
    smallest_m3: float = 0.004
    """m^3. A smaller hull is noise, not a body. Chosen by eye."""
    person_m3: float = 0.25
    """m^3. A person's hull is up to so large; larger ones count for less. standing4: board and man
    have 0.37 and 0.15."""
    person_m: float = 1.6
    """m. In most poses it is so long; shorter ones count for less. As `person_m3`."""
    near_m: float = 1.0
    """m. From the last position, where a component's weight falls to 1 / e. Chosen by eye."""
    least_shrinkage: float = 0.9
    """1. Of a box's volume, above which shrinking it ends: it costs no accuracy."""
    off_axis: float = 1.5
    """1. Largest magnification toward an image's corners. An assumption about lenses."""


@dataclass(frozen=True)
class Matching:
    """Paper B's matching of limbs, and the search for the torso before it (`matching`)."""

    step_deg: float = 15.0
    """degrees. Distance between sampled angles. Chosen by eye; Iiyama does not state his."""
    empty_cost: float = 1.0
    """Voxels. Cost of a part's voxel in empty space. Chosen by eye, not ablated."""
    taken_cost: float = 0.7
    """Voxels. The same inside a part that is already placed. Chosen by eye, not ablated."""
    reduce_again: float = 0.9
    """1. Of the placements, below which they are reduced again. It costs no accuracy."""
    lying_cost: float = 0.1
    """1. Of the torso: cost of lying on the side, as people mostly stand. Chosen by eye."""
    apart_m: float = 0.12
    """m. Distance from which placements of the torso are different. Chosen by eye."""
    apart_deg: float = 40.0
    """degrees. The same of turns, also of a limb whose turn is to show. Chosen by eye."""
    shown: float = 0.2
    """1. Of a limb's points, which leave its volume in a turn that shows. Chosen by eye."""


@dataclass(frozen=True)
class Evidence:
    """What speaks for and against a fitted pose (`quality`)."""

    square_m: float = 0.12
    """m. Half the side of the square around a joint. Chosen by eye."""
    least_seen: float = 0.3
    """1. Of such a square, which must be known. Chosen by eye."""
    least: float = 0.01
    """1. Share below which a joint's surroundings count as alike. Chosen by eye."""
    most_turned: float = 4.0
    """1. Largest half-turn ratio that counts. Chosen by eye."""
    at_limit_rad: float = 0.02
    """rad. From an angle's limit, up to which it is at it. Chosen by eye."""
    unsupported: float = 0.2
    """1. Overlap with the hull below which a part is unsupported. Chosen by eye."""


REFINING = Refining()
TRACKING = Tracking()
OFF_LINE = OffLine()
LIVE = Live()
CARVING = Carving()
MATCHING = Matching()
QUALITY = Evidence()
