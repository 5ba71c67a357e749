"""Tuned numbers of the monocular estimator, one a line: unit, meaning, and where it comes from.

A unit of 1 is a ratio, a probability or a logarithm. Angles are in degrees, as people read them.
"By eye" says that a number was chosen when its method was written and never varied on its own.
"""

from dataclasses import dataclass

Range = tuple[float, float]


@dataclass(frozen=True)
class FilterSettings:
    """Likelihood and pruning of the tree's filter (`tree.descent`, `tree.paper_filter`)."""

    sigma: float = 0.07
    """1. Standard deviation of the silhouette distance of the true pose, eq. (10), as a fraction of
    the silhouette's own weight. Source unknown: the paper does not state it."""
    survivors: float = 1e-3
    """1. A node's children are scored if its posterior reaches this fraction of the best node's.
    The exact posterior is kept (tests/silhouette_core/monocular/test_ablation.py)."""
    first_deg: float = 45.0
    """Degrees. Deviation of every angle from the upright pose that faces the camera, in the paper's
    first frame. By eye: the paper does not state it."""


@dataclass(frozen=True)
class MotionModel:
    """Steps from one frame to the next (`tree.transitions`, `tree.base_poses`)."""

    sigma_scale: float = 2.5
    """1. Factor on the measured sigmas: with 54 joint angles, these would leave nearly all of a
    transition to two samples, and the filter could not recover from a wrong pose. With 3.5
    and 5 turn1 had 163.4 mm instead of 185.8 (2026-11-22); one recording decided nothing."""
    least_sigma_deg: float = 0.5  #: Degrees. Smallest step size of a joint angle. By eye.
    hidden_share: float = 0.15
    """1. Of the largest area that a part usually shows, below which it is occluded: T_A of eq. (3),
    which the paper has in pixels. By eye."""
    magnification: float = 5.0  #: 1. Factor on the sigmas of an occluded part: m of eq. (5).


@dataclass(frozen=True)
class Distances:
    """Assumed distances of the person, and when it is lost. All by eye."""

    first_range: float = 0.30
    """1. Logarithm by which distances differ from the upright one that are tried in a first frame:
    the person may crouch, or hold the arms up."""
    step: float = 0.05
    """1. Logarithm by which the other distances of a frame differ from the expected one."""
    gain: float = 0.4  #: 1. Share of the measured change of the distance that is believed.
    pitch_sigma_deg: float = 8.0  #: Degrees. Deviation of the library's pitch from the camera's.
    lost_factor: float = 2.5
    """1. A frame is lost where the distance of the best node, or of the best tracked hypothesis,
    exceeds the usual one by this factor and `lost_excess`."""
    lost_excess: float = 0.05  #: 1. In units of the silhouette distance.
    longest_gap_s: float = 1.0  #: Seconds without a person, after which tracking starts again.


@dataclass(frozen=True)
class RootSearch:
    """Poses of a body that is no person's (`tree.root_search`, `tree.sample_proposer`).

    Source of all of them unknown: chosen on the examples of `python -m benchmarks.bodies`.
    """

    first_reach_m: float = 0.20
    """Metres. With a free root, contours are first matched as far, then as of a near pose."""
    sigma_m: float = 0.06
    """Metres between the roots of two frames, and between a body and a sample of the tree."""
    sigma_deg: float = 8.0  #: Degrees between the roots of two frames.
    sigma_error: float = 0.03  #: 1. Deviation of the silhouette error.
    loose_rad: float = 0.6  #: Radians. Deviation of joint angles from those of the library's pose.
    sample_rad: float = 0.20  #: Radians. The same from those of a sample of the tree,
    sample_turn_rad: float = 0.15  #: Radians. and of its orientation.


@dataclass(frozen=True)
class Tree:
    """Division of a library's samples (`tree.build`)."""

    thresholds: tuple[float, float, float] = (0.0173, 0.0110, 0.0074)
    """1. Largest silhouette distances of samples from their nodes, level by level: with them, the
    default library's levels have the paper's shares of nodes, 7,828, 26,805 and 44,108 of 57,136.
    The paper states no thresholds."""


@dataclass(frozen=True)
class SampledMotion:
    """Motion of a body of which none was recorded (`body_library`). Chosen by eye."""

    spread: float = 0.5  #: 1. Deviation about rest, of the way to a limit: few are at a limit.
    tilt_deg: float = 6.0  #: Degrees. Lean of a root that is free, about each level axis.


@dataclass(frozen=True)
class Training:
    """Learning of the proposal (`making.network_training`, `making.proposal_learning`).

    Chosen by the error over virtual frames of held-out motion; not ablated one by one.
    """

    last_rate: float = 1e-5  #: 1. Learning rate at the end.
    largest_gradient: float = 300.0  #: 1. Longer gradients are shortened.
    claimed: float = 0.4  #: 1. Share of the steps in which the nearest mode alone learns.
    share: float = 0.3  #: 1. Share of all modes meanwhile, at first.
    least_share: float = 0.02  #: 1. Share of all modes meanwhile, at last.
    last_gain: float = 0.3  #: 1. Of the first weights of the last layer, and of every block's.
    withheld: float = 1 / 3
    """1. Share of the samples that read no later frames, and of those whose inside is not read."""


@dataclass(frozen=True)
class Mixture:
    """Deviations of a pose's joints in the proposal (`proposal`). By eye."""

    sigma: float = 0.05  #: Statures. Deviation at a logarithm of 0, and of the first modes.
    joint_log_sigma: Range = (-1.6, 2.2)  #: 1. Range of a joint's log deviation.
    offset_log_sigma: Range = (-2.0, 3.0)  #: 1. The same of the person's place.


@dataclass(frozen=True)
class FoundPerson:
    """The person among the components of the foreground (`person`). By eye."""

    least_piece: float = 0.02
    """1. Of the person's area: smaller components are noise; a hand behind a gap is larger."""
    largest_gap: float = 0.25  #: 1. Between a component and the main one, of the latter's size.
    slender: float = 2.0
    """1. Height over width of most silhouettes: what is wider counts for less beside a person, as a
    board on the floor, or a box."""
    least_of_usual: float = 0.2  #: 1. Smallest area of the person, relative to the usual one.
    border: float = 0.02
    """1. Length of contact with the border, relative to the size, up to which nobody is cut."""


@dataclass(frozen=True)
class Head:
    """The head in a picture (`tracking.colour_evidence`). By eye."""

    from_neck: float = 0.35  #: 1. Of the way from the neck to the top: above it is the head.
    radius: float = 0.15  #: 1. Of the head, relative to that way.


@dataclass(frozen=True)
class BodyAdaptation:
    """The person's body (`tracking.body_adaptation`). By eye."""

    stature_sigma_m: float = 0.008  #: Metres. Deviation of the stature.
    contour_m: float = 0.02  #: Metres. Standard deviation of a contour residual.
    independence: float = 0.15  #: 1. Fraction of contour points that count as independent.
    shod_sigma: float = 0.02  #: Statures by which shoes and clothes make a person taller.
    sole_m: float = 0.012  #: Metres. Height of the lowest sampled point of a standing foot.


@dataclass(frozen=True)
class BodyHeading:
    """How the body is headed (`tracking.body_heading`). By eye."""

    independence: float = 0.5
    """1. Frames read the same silhouettes: each counts as this fraction of an observation."""
    sigma_deg: float = 18.0  #: Degrees. Deviation of a mode's heading.
    expected: float = 2.0  #: 1. Concentration of the heading expected in the first frame.


@dataclass(frozen=True)
class ProposedModes:
    """Modes that become hypotheses (`tracking.pose_modes`). By eye."""

    pelvis_sigma_m: float = 0.15  #: Metres. Deviation of its pelvis.
    usual_height: float = 0.53  #: Statures. Height of a person's middle.
    heights: Range = (0.15, 1.1)  #: Statures. Range of it in which z = 0 may be the floor.


@dataclass(frozen=True)
class VariedMotion:
    """Chances and sizes of variations of recorded motion (`making.varied_motion`).

    Chosen by the error on random recordings, seeds 1 to 40 of level 1; not ablated singly.
    """

    other_upper_body: float = 0.25  #: 1. Chance of the upper body of another recording.
    other_arms: float = 0.6  #: 1. Chance of the arms of another recording.
    both: float = 0.5
    """1. Chance that these are both from the same; that both limbs of any pose do much the same."""
    reversed: float = 0.3  #: 1. Chance that what is taken from another recording runs backwards.
    deviating: float = 0.7  #: 1. Chance of slow deviations of all joints.
    deviation_deg: Range = (2.0, 12.0)  #: Degrees. Standard deviation of these.
    any_limb: float = 0.25  #: 1. Chance that both arms, or both legs, take any pose.
    leaning: float = 0.4  #: 1. Chance that the body leans.
    lean_deg: float = 30.0  #: Degrees. Largest standard deviation of the lean.
    tumbling: float = 0.15  #: 1. Chance that the body lies or turns over.
    tumble_deg: float = 6.0  #: Degrees a frame. Standard deviation of the turn.


@dataclass(frozen=True)
class VirtualPeople:
    """Bodies and clothes of virtual takes (`making.virtual_takes`). Source as of `VariedMotion`."""

    spread: float = 0.8  #: 1. Deviation of shapes, relative to the spread of adults.
    stout: float = 0.12  #: 1. Common deviation of all girths.
    shape_limits: Range = (-0.3, 0.45)  #: 1. Least and largest change of a shape's axis.
    clothes_m: Range = (0.005, 0.035)  #: Metres at 1.75 m. Distance of wide clothes from the skin.
    cap: float = 0.2  #: 1. Chance of a cap or much hair: nothing else has the colours of the head.
    bare_arms: tuple[float, float, float] = (0.96, 0.6, 0.25)
    """1. Chance of bare hands; of forearms if hands are; of upper arms if forearms are."""
    bare_legs: float = 0.12  #: 1. Chance of bare shins, and that of bare feet.
    skin_like: float = 0.08  #: 1. Chance of clothes of the head's colours.
    surely_found: Range = (0.6, 1.0)  #: 1. Share of bare parts that is found as such.
    wrongly_found: Range = (0.0, 0.3)  #: 1. Share of the rest that is taken for bare, where any is.
    often: float = 0.4  #: 1. Chance that any is.
    skin_noise: Range = (0.0, 0.2)  #: 1. Standard deviation of the noise of what is found.
    exposure: float = 0.02  #: 1. Logarithm of brightness: standard deviation of a frame's exposure.
    grain: Range = (0.005, 0.05)  #: 1. Logarithm of brightness: deviation of a cell's noise.


@dataclass(frozen=True)
class VirtualCameras:
    """Cameras of virtual takes (`making.virtual_takes`), in metres of a person of 1.75 m.

    Source as of `VariedMotion`.
    """

    distance_m: Range = (2.7, 7.5)  #: Metres from the middle of the room.
    height_m: Range = (0.4, 3.2)  #: Metres above the floor.
    nearest_m: float = 1.8  #: Metres between camera and person at least.
    away_m: float = 0.35  #: Metres. Deviation of the person's place from the middle of the room.
    raised: float = 0.08  #: 1. Chance that the person hangs or climbs.
    highest: float = 0.6  #: Statures. How high at most.
    wrong: float = 0.09  #: 1. Logarithm of the assumed distance's error: constant deviation.
    wander: float = 0.008  #: 1. The same: deviation of its change from frame to frame.
    steady: float = 0.95  #: 1. Share of the changing part that remains in the next frame.


@dataclass(frozen=True)
class VirtualDefects:
    """Defects of virtual silhouettes (`making.virtual_defects`), in pixels of the virtual pictures.

    Made larger until the worst of seeds 1 to 40 no longer improved (docs/decisions.md).
    """

    bout: float = 0.025
    """1. Chance that a bout of frames with defects begins; they make 30 % of the frames."""
    hole_px: Range = (1.5, 4.0)  #: Pixels. Radius of the holes at random places of the body.
    large_holes: tuple[float, float] = (0.5, 0.25)  #: 1. Chance of each of two larger holes.
    large_holes_px: tuple[Range, Range] = ((4.0, 9.0), (6.0, 14.0))  #: Pixels. Their radii.
    strange: float = 0.35  #: 1. Chance of foreground beside the body in a bout.
    strange_px: Range = (3.0, 9.0)  #: Pixels. Its radius.
    strange_away_px: float = 6.0  #: Pixels. Deviation of its place from the body's.
    alike: float = 0.15
    """1. Chance that one of the colours is like the background's in places, which are at the same
    places of the body in all frames."""
    place_count: tuple[int, int] = (2, 9)  #: Places of that kind, the last excluded.
    place_px: Range = (2.5, 8.0)  #: Pixels. Their radii.
    often: Range = (0.4, 1.0)  #: 1. Share of the frames in which they are missing.
    shadowed: float = 0.15  #: 1. Chance of a shadow on the floor.
    light_deg: Range = (35.0, 80.0)  #: Degrees. Elevation of the light that casts it.
    shadow_of: Range = (0.1, 1.1)  #: Statures. Height of the part of the body whose shadow is seen.


@dataclass(frozen=True)
class VirtualShading:
    """Light on virtual people (`making.virtual_shading`).

    Chosen by the error over virtual takes of held-out motion; not ablated one by one.
    """

    light_deg: Range = (15.0, 90.0)  #: Degrees. Elevation of the light.
    direct: Range = (0.15, 0.65)  #: 1. Its share of all light.
    sky: Range = (0.0, 0.4)  #: 1. Share of the sky in the rest.
    patterned: float = 0.4  #: 1. Chance of patterns on the clothes.
    pattern: float = 0.3  #: 1. Logarithm: largest deviation of their brightness.
    of_parts: float = 0.5  #: 1. How much of it is that of whole parts.
    alike: float = 0.2  #: 1. Chance of two colours alike.
    patch: float = 0.4  #: 1. Logarithm: deviation of their brightness from each other.


FILTER = FilterSettings()
MOTION_MODEL = MotionModel()
DISTANCES = Distances()
ROOT_SEARCH = RootSearch()
TREE = Tree()
SAMPLED_MOTION = SampledMotion()
TRAINING = Training()
MIXTURE = Mixture()
PERSON = FoundPerson()
HEAD = Head()
ADAPTING = BodyAdaptation()
HEADING = BodyHeading()
MODES = ProposedModes()
VARIED_MOTION = VariedMotion()
VIRTUAL_PEOPLE = VirtualPeople()
VIRTUAL_CAMERAS = VirtualCameras()
VIRTUAL_DEFECTS = VirtualDefects()
VIRTUAL_SHADING = VirtualShading()
