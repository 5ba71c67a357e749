"""Tuned numbers of the monocular estimator, one a line: unit, meaning, and where it comes from.

A unit of 1 is a ratio, a probability or a logarithm. Angles are in degrees, as people read them.
"""

from __future__ import annotations

from dataclasses import dataclass

Range = tuple[float, float]


@dataclass(frozen=True)
class FilterSettings:
    """Likelihood and pruning of the tree's filter (`tree.tree_filter`)."""

    sigma: float = 0.07
    """1. Standard deviation of the silhouette distance of the true pose, eq. (10), as a fraction
    of the silhouette's own weight. Source unknown: the paper does not state it."""
    coarse: float = 1.5
    """1. Factor on sigma for every level above the last, where a representative stands for a larger
    node. Source unknown: chosen by eye, not ablated."""
    survivors: float = 1e-3
    """1. A node's children are scored if its posterior reaches this fraction of the best node's.
    The exact posterior is kept (tests/silhouette_core/monocular/test_ablation.py)."""
    most: int = 1500
    """Largest number of nodes kept per level. Source as of `survivors`."""
    moved: int = 500
    """Number of nodes per level that are moved to where they fit best, if there are more than twice
    as many: those that are likely where they are. Source as of `survivors`."""
    floor: float = 0.10
    """1. Fraction of the prior that is spread evenly over the library, so that the filter recovers
    from a wrong pose. Source unknown: chosen by eye, not ablated."""


FILTER = FilterSettings()


@dataclass(frozen=True)
class MotionModel:
    """Steps from one frame to the next (`tree.transitions`, `making.base_poses`)."""

    sigma_scale: float = 2.5
    """1. Factor on the measured sigmas: with 54 joint angles, these would leave nearly all of a
    transition to two samples, and the filter could not recover from a wrong pose. 3.5 and 5 were
    no better on one recording (docs/results.md)."""
    least_sigma_deg: float = 0.5
    """Degrees. Smallest step size of a joint angle. Source unknown: chosen by eye, not ablated."""


MOTION_MODEL = MotionModel()


@dataclass(frozen=True)
class Distances:
    """Assumed distances of the person, and when it is lost (`tree.forward`).

    Source of all of them unknown: chosen by eye, not ablated.
    """

    first_range: float = 0.30
    """1. Logarithm by which distances differ from the upright one that are tried in a first frame:
    the person may crouch, or hold the arms up."""
    step: float = 0.05
    """1. Logarithm by which the other distances of a frame differ from the expected one."""
    gain: float = 0.4
    """1. Share of the measured change of the distance that is believed."""
    pitch_sigma_deg: float = 8.0
    """Degrees. Deviation of the library's pitch from the camera's."""
    lost_factor: float = 2.5
    """1. A frame is lost where the best node's distance exceeds the usual one by this factor and
    `lost_excess`."""
    lost_excess: float = 0.05
    """1. In units of the silhouette distance."""
    longest_gap_s: float = 1.0
    """Seconds without a person, after which the filter starts again."""


DISTANCES = Distances()


@dataclass(frozen=True)
class RootSearch:
    """A root that stands still (`tree.root_search`).

    Source of all of them unknown: chosen on the examples of `python -m benchmarks.bodies`.
    """

    start_reaches_m: tuple[float, ...] = (0.20, 0.15, 0.12, 0.10, 0.08, 0.06, 0.06)
    """Metres. How far contours are matched in the rounds of the refinement, root free."""
    held_reaches_m: tuple[float, ...] = (0.15, 0.12, 0.10, 0.08, 0.06, 0.06)
    """Metres. The same with a root that is held."""
    sigma_m: float = 0.06
    """Metres between the roots of two frames."""
    sigma_deg: float = 8.0
    """Degrees between the roots of two frames."""
    sigma_error: float = 0.03
    """1. Deviation of the silhouette error."""
    loose_rad: float = 0.6
    """Radians. Deviation of joint angles from those of the library's pose."""


ROOT_SEARCH = RootSearch()


@dataclass(frozen=True)
class Tree:
    """Division of a library's samples (`making.build`)."""

    thresholds: tuple[float, float, float] = (0.0173, 0.0110, 0.0074)
    """1. Largest silhouette distances of samples from their nodes, level by level: with them, the
    default library's levels have the paper's shares of nodes, 7,828, 26,805 and 44,108 of 57,136.
    The paper states no thresholds."""


TREE = Tree()


@dataclass(frozen=True)
class SampledMotion:
    """Motion of a body of which none was recorded (`making.sampled_motion`). Chosen by eye."""

    spread: float = 0.5
    """1. Standard deviation about rest, of the way to a limit: few joints are at a limit."""
    tilt_deg: float = 6.0
    """Degrees. Lean of a root that is free, about each level axis."""


SAMPLED_MOTION = SampledMotion()


@dataclass(frozen=True)
class Training:
    """Learning of the proposal (`making.network_training`, `making.proposal_learning`).

    Chosen by the error over virtual frames of held-out motion; not ablated one by one.
    """

    last_rate: float = 1e-5
    """1. Learning rate at the end."""
    largest_gradient: float = 300.0
    """1. Longer gradients are shortened."""
    claimed: float = 0.4
    """1. Share of the steps in which the nearest mode alone learns."""
    share: float = 0.3
    """1. Share of all modes meanwhile, at first."""
    least_share: float = 0.02
    """1. Share of all modes meanwhile, at last."""
    causal: float = 1 / 3
    """1. Share of the samples that read no later frames."""
    colourless: float = 1 / 3
    """1. Share of the samples whose inside is not read."""


TRAINING = Training()


@dataclass(frozen=True)
class VariedMotion:
    """Chances and sizes of variations of recorded motion (`making.varied_motion`).

    Chosen by the error on random recordings, seeds 1 to 40 of docs/results.md; not ablated one by
    one.
    """

    other_upper_body: float = 0.25
    """1. Chance of the upper body of another recording."""
    other_arms: float = 0.6
    """1. Chance of the arms of another recording."""
    both_arms: float = 0.5
    """1. Chance that these are both from the same."""
    reversed: float = 0.3
    """1. Chance that what is taken from another recording runs backwards."""
    deviating: float = 0.7
    """1. Chance of slow deviations of all joints."""
    deviation_deg: Range = (2.0, 12.0)
    """Degrees. Standard deviation of these."""
    any_limb: float = 0.25
    """1. Chance that both arms, or both legs, take any pose."""
    alike: float = 0.5
    """1. Chance that both do much the same then."""
    leaning: float = 0.4
    """1. Chance that the body leans."""
    lean_deg: float = 30.0
    """Degrees. Largest standard deviation of the lean."""
    tumbling: float = 0.15
    """1. Chance that the body lies or turns over."""
    tumble_deg: float = 6.0
    """Degrees a frame. Standard deviation of the turn."""


VARIED_MOTION = VariedMotion()


@dataclass(frozen=True)
class VirtualPeople:
    """Bodies and clothes of virtual takes (`making.virtual_takes`). Source as of `VariedMotion`."""

    spread: float = 0.8
    """1. Deviation of shapes, relative to the spread of adults."""
    stout: float = 0.12
    """1. Common deviation of all girths."""
    shape_limits: Range = (-0.3, 0.45)
    """1. Least and largest change of a shape's axis."""
    clothes_m: Range = (0.005, 0.035)
    """Metres of a person of 1.75 m. Distance of wide clothes from the skin."""
    cap: float = 0.2
    """1. Chance of a cap or much hair: nothing else has the colours of the head."""
    bare_arms: tuple[float, float, float] = (0.96, 0.6, 0.25)
    """1. Chance of bare hands; of forearms if hands are; of upper arms if forearms are."""
    bare_legs: float = 0.12
    """1. Chance of bare shins, and that of bare feet."""
    skin_like: float = 0.08
    """1. Chance of clothes of the head's colours."""
    surely_found: Range = (0.6, 1.0)
    """1. Share of bare parts that is found as such."""
    wrongly_found: Range = (0.0, 0.3)
    """1. Share of the rest that is taken for bare, where any is."""
    often: float = 0.4
    """1. Chance that any is."""
    skin_noise: Range = (0.0, 0.2)
    """1. Standard deviation of the noise of what is found."""
    exposure: float = 0.02
    """1. Logarithm of brightness: standard deviation of a frame's exposure."""
    grain: Range = (0.005, 0.05)
    """1. Logarithm of brightness: standard deviation of a cell's noise."""


VIRTUAL_PEOPLE = VirtualPeople()


@dataclass(frozen=True)
class VirtualCameras:
    """Cameras of virtual takes (`making.virtual_takes`), in metres of a person of 1.75 m.

    Source as of `VariedMotion`.
    """

    distance_m: Range = (2.7, 7.5)
    """Metres from the middle of the room."""
    height_m: Range = (0.4, 3.2)
    """Metres above the floor."""
    nearest_m: float = 1.8
    """Metres between camera and person at least."""
    away_m: float = 0.35
    """Metres. Deviation of the person's place from the middle of the room."""
    raised: float = 0.08
    """1. Chance that the person hangs or climbs."""
    highest: float = 0.6
    """Statures. How high at most."""
    wrong: float = 0.09
    """1. Logarithm of the error of the assumed distance: its constant part's deviation."""
    wander: float = 0.008
    """1. The same: deviation of its change from frame to frame."""
    steady: float = 0.95
    """1. Share of the changing part that remains in the next frame."""


VIRTUAL_CAMERAS = VirtualCameras()


@dataclass(frozen=True)
class VirtualDefects:
    """Defects of virtual silhouettes (`making.virtual_defects`), in pixels of the virtual pictures.

    Made larger until the worst of seeds 1 to 40 no longer improved (docs/results.md).
    """

    bout: float = 0.025
    """1. Chance that a bout of frames with defects begins; they make 30 % of the frames."""
    hole_px: Range = (1.5, 4.0)
    """Pixels. Radius of the holes at random places of the body."""
    large_holes: tuple[float, float] = (0.5, 0.25)
    """1. Chance of each of two larger holes in a bout."""
    large_holes_px: tuple[Range, Range] = ((4.0, 9.0), (6.0, 14.0))
    """Pixels. Their radii."""
    strange: float = 0.35
    """1. Chance of foreground beside the body in a bout."""
    strange_px: Range = (3.0, 9.0)
    """Pixels. Its radius."""
    strange_away_px: float = 6.0
    """Pixels. Deviation of its place from the body's."""
    alike: float = 0.15
    """1. Chance that one of the colours is like the background's in places, which are at the same
    places of the body in all frames."""
    places: tuple[int, int] = (2, 9)
    """Number of such places, the last excluded."""
    place_px: Range = (2.5, 8.0)
    """Pixels. Their radii."""
    often: Range = (0.4, 1.0)
    """1. Share of the frames in which they are missing."""
    shadowed: float = 0.15
    """1. Chance of a shadow on the floor."""
    light_deg: Range = (35.0, 80.0)
    """Degrees. Elevation of the light that casts it."""
    shadow_of: Range = (0.1, 1.1)
    """Statures. Height of the part of the body whose shadow is seen."""


VIRTUAL_DEFECTS = VirtualDefects()


@dataclass(frozen=True)
class VirtualShading:
    """Light on virtual people (`making.virtual_shading`).

    Chosen by the error over virtual takes of held-out motion; not ablated one by one.
    """

    light_deg: Range = (15.0, 90.0)
    """Degrees. Elevation of the light."""
    direct: Range = (0.15, 0.65)
    """1. Its share of all light."""
    sky: Range = (0.0, 0.4)
    """1. Share of the sky in the rest."""
    patterned: float = 0.4
    """1. Chance of patterns on the clothes."""
    pattern: float = 0.3
    """1. Logarithm: largest deviation of their brightness."""
    of_parts: float = 0.5
    """1. How much of it is that of whole parts."""
    alike: float = 0.2
    """1. Chance of two colours alike."""
    patch: float = 0.4
    """1. Logarithm: deviation of their brightness from each other."""


VIRTUAL_SHADING = VirtualShading()
