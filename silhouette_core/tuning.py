"""Numbers of the shared core that were tuned or chosen, each with its unit and where it comes from.

"By eye" says that a number was chosen when its method was written and never varied on its own; what
is told after it measures the method as a whole. "Noise" of an image is a colour channel's standard
deviation at a pixel, as rescaled for the frame.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Background:
    """Background model and the paper's subtraction (`image.background`)."""

    noise: float = 1.0  #: Grey levels. Least noise, and that assumed of a single picture. By eye.
    log_likelihood: float = -30.0
    """Logarithm of a density. The paper's first threshold; the paper gives no value: by eye."""
    raw_difference: float = 90.0  #: Grey levels. The paper's second threshold, likewise.


@dataclass(frozen=True)
class Foreground:
    """The refined subtraction (`image.foreground`, `image.difference`).

    Source unknown but where said: chosen by eye, not ablated. As a whole: `python -m
    benchmarks.silhouettes`.
    """

    pooled: float = 3.0
    """Noise. Limit of the pooled difference of brightness where clothes or a shadow may be."""
    possible: float = 1.2
    """Noise. Limit of the pooled chromatic residual where clothes may resemble the background: in
    seed 322, 99 % of the missing pixels exceed it, and 1 % of those outside."""
    chroma_pixel: float = 6.0  #: Noise. Limit of a single pixel's chromatic residual.
    shadow: float = 0.5
    """1. Darkest cast shadow over the background's brightness, where it is not measured."""
    contrast: float = 10.0  #: Grey levels. Edges between colours closer than this are not moved.
    area: float = 3e-4  #: 1. Of the image: smaller components, or holes in colours, are removed.
    body_share: float = 0.01  #: 1. Of the largest component: smaller ones are removed.
    hole: float = 4e-5  #: 1. Of the image: holes up to this are filled.
    empty_share: float = 0.8  #: 1. Quantile of a frame's differences that a person does not reach.
    beyond: float = 2.0  #: 1. Multiple of that quantile from which a difference is not noise.
    usual_chroma: float = 0.7  #: Noise. Pooled chromatic residual of an empty scene.


@dataclass(frozen=True)
class CastShadow:
    """The darkest cast shadow of a recording (`image.cast_shadow`).

    By eye. As a whole: `python -m benchmarks.completed`.
    """

    chroma: float = 1.0  #: Noise. Largest pooled chromatic residual of what light explains.
    brightness: float = 5.0  #: Noise. Least difference of its brightness.
    margin: float = 0.1  #: 1. Darkest shadow below the peak of the ratios of brightness.
    core: float = 0.05  #: 1. Share of the pixels that may be the core of a soft shadow.
    core_margin: float = 0.03  #: 1. Darkest shadow below the core's ratio.
    range: tuple[float, float] = (0.25, 0.65)
    """1. Ratios: below the first nothing is a cast shadow, and the darkest, however soft, does not
    exceed the second."""
    uneven: tuple[float, float] = (0.03, 0.1)
    """1. Scales of what a scaled background does not explain in the brightness of a shadow, and of
    clothes. On walk4 and traffic4 turned grey: medians 0.035 and 0.125."""


@dataclass(frozen=True)
class ExposureField:
    """Exposure that varies over the picture (`image.exposure`). By eye, on opencap_walk."""

    dark: float = 20.0  #: Grey levels at which a pixel says half of what a bright one does.
    stiffness: float = 2e-5  #: 1. Weight of a flat field, relative to the pixels.
    least: float = 0.02  #: 1. Least scale of the logarithms' residuals: noise.


@dataclass(frozen=True)
class EmptyScene:
    """The empty scene from occupied frames (`image.empty_scene`).

    Chosen by eye on opencap_walk, woman_white, balancing4, jumping1 and le2i_c2. As a whole:
    `python -m benchmarks.footage` and `python -m benchmarks.without_empty_view`.
    """

    side_px: int = 200
    """px. Shorter side of the pictures that are labelled: costs of areas and edges depend on it."""
    changed: float = 6.0  #: Noise. Radius of a mode: differences summed over the channels.
    least_noise: float = 2.0  #: Grey levels. Least noise, summed over the channels.
    hidden: float = 0.15
    """1. Cost of a background that no frame shows, at a pixel; a moving step costs 1."""
    unseen: float = 0.6  #: 1. Of that: cost of a pixel whose background is taken to be unknown.
    border: float = 0.5  #: 1. Cost of the border of such a region, at a pixel.
    still: float = 0.05  #: 1. Cost of a step between colours that does not move.
    piece: float = 0.05
    """1. Of the largest piece that differs from the background in a frame: least of the others."""
    always: float = 4.0
    """1. Power of the share of frames in which somebody is before a pixel, by which that counts."""
    least_sigma: float = 4.0  #: Grey levels. Least deviation: what is left of exposure, and lights.
    guess: float = 6.0  #: Grey levels. Standard deviation of a continued colour.


@dataclass(frozen=True)
class Backdrop:
    """A uniform backdrop (`image.backdrop`).

    By eye. As a whole: `python -m benchmarks.screens`. 74 cameras of rooms, real and rendered, have
    at most 0.69 of the rim explained and woman_white 0.94.
    """

    tolerance: float = 15.0
    """Grey levels, summed over the channels, between a field and what it explains: folds, light."""
    width: float = 0.03  #: 1. Of the shorter side: the rim.
    layer: float = 0.15
    """1. Of the rim: least that a field explains. A floor has 0.4 in the demo's views."""
    rim: float = 0.8  #: 1. Of the rim: least that the fields of a uniform backdrop explain.
    before: float = 0.5
    """1. Of what moves: least that shows a field at other times, too. woman_white has 0.77."""


@dataclass(frozen=True)
class Cut:
    """A frame cut into person and background (`image.cut`). By eye, as `EmptyScene`."""

    side_px: int = 240  #: px. Shorter side of the pictures that are cut; edges are then sharpened.
    link: float = 3.0  #: Nats. Cost of neighbours that differ, without contrast.
    least_link: float = 0.45  #: Nats. The same, over the sharpest edge.
    least_contrast: float = 4.0
    """Grey levels. Usual contrast of neighbours, summed over the channels, at least."""
    beside: float = 3.0
    """Nats. Most that anything but colours says of a pixel: that nobody saw its background, when
    colours are first learned."""
    typical: float = 0.25
    """1. Of the scene's density of a colour, from which the person's makes it one of clothes."""
    worn: float = 0.03
    """1. Weight of what speaks for the background in colours that the person has, too."""
    alike: float = 0.03
    """1. Of the colours of somebody unknown, share of the scene's: of walk4's grey people 0.42 are
    found without it, 0.94 with it, and 0.91 with ten times as much."""
    seen: float = 0.5
    """1. Of the colours of somebody who is looked at as frames come, share of those seen so far. Of
    0, 0.1, 0.5 and 1 this has the largest overlap on seed 6 and all above 0.95 on grey people."""
    flicker: float = 0.05  #: 1. Relative deviation of the background's brightness: lights.
    shaded: float = 0.045  #: 1. How often a pixel lies in a shadow.
    otherwise: float = 0.02
    """1. How often an estimated background shows another of its colours: it flickers, or moves."""


@dataclass(frozen=True)
class Colours:
    """Colours of a person, a head, and their shading (`image.*_colours`, `image.shading`).

    By eye. As a whole, the person's: `python -m benchmarks.completed`.
    """

    smoothing_bins: float = 0.8  #: Bins. Smoothing of histograms of colours.
    any_share: float = 0.01  #: 1. Of the pixels of a person, or of a head, have any colour.
    own_share: float = 0.95  #: 1. Of the person's pixels have a colour that counts as the person's.
    most_odds: float = 5.0  #: Nats. Largest logarithm of a single pixel's odds.
    lit: float = 0.85
    """1. How often a pixel of the background is lit as it was; else it lies in a shadow."""
    otherwise: float = 1e-3  #: 1. How often it has any colour.
    dark: float = 8.0
    """Grey levels. Added to brightness, since noise of dark clothes is not their shading."""
    shading: float = 1.0  #: Nats. Largest shading that is told.


@dataclass(frozen=True)
class Presence:
    """People followed by the pose network (`image.person_windows`)."""

    sure: float = 0.99
    """1. Presence from which the network is sure. Chairs of le2i_c2 have at most 0.96, people who
    stand or sit still at least 0.993. Below it joints are 140 mm off and more in the median, above
    it 44 (395 frames of seeds 1 to 14 and 41 to 46)."""


@dataclass(frozen=True)
class Plausibility:
    """Whether silhouettes can be a person's (`image.plausibility`). By eye."""

    covered: float = 0.7  #: 1. Of the picture: what covers more is no person.
    solid: float = 0.3  #: 1. Of the foreground, left by an opening of 3 x 3 px: less is specks.
    rectangle: float = 0.93
    """1. Of its upright rectangle: what fills more is a wall. People fill up to 0.7."""
    changed: float = 0.01
    """1. Of both silhouettes' union, between moments: what changes less is no person's that is cut
    off by two borders. People who stand still change by more, if only by noise."""


@dataclass(frozen=True)
class CameraMotion:
    """Whether a camera stands still (`image.camera_motion`)."""

    still_px: float = 0.5
    """Pixels of a picture of 640. Of 59 fixed cameras, real and rendered, none is farther than 0.3
    from where it usually stands in the upper quartile of a take; of four that pan or are held, the
    first frame is hardly ever found again."""
    over_noise: float = 4.0
    """1. An edge's slope over that of half the rim. Slopes of noise alone exceed it once in 70,000
    (Rayleigh's distribution). Likewise the difference of an empty view over what its exposure
    leaves: 1 to 2.5 of four real and rendered ones, 9 to 40 with another exposure or HLG."""


@dataclass(frozen=True)
class Measuring:
    """Tape measures, and bodies with given measurements (`body.*_m*`, `body.shape`)."""

    usual_m: float = 1.70
    """m. Stature of whom nothing is known. ANSUR II has 1.756 for men, 1.629 for women."""
    hollow: float = 6.0  #: 1. How much shorter clothes stand off, the hollower the surface. By eye.
    tolerance: float = 0.005
    """1. Largest relative difference of a body's measurement from the wanted one. By eye."""
    limb_slope: float = 0.9  #: 1. Growth of the limbs' girths with the trunk's. By eye.
    chest_slope: float = 0.5
    """1. The same with the chest's girth alone: a regression over adults, its data not recorded."""
    most_odds: float = 3.0
    """Nats. Nobody's sex is more certain than this by the stature, and children have one."""
    bone_radius: float = 0.12  #: 1. Radius of a bone without a surface, of its length. By eye.


@dataclass(frozen=True)
class Dynamics:
    """Movement from frame to frame (`motion.dynamics`, `motion.floor`)."""

    momentum: float = 0.8
    """1. Fraction of the last step that the next one is expected to repeat. By eye."""
    root_step_m: float = 0.05  #: m. Standard deviation of the root's step along each axis. By eye.
    root_step_rad: float = 0.12  #: Radians. The same of its turn about each axis. By eye.
    standing: float = 0.3
    """1. Quantile of the lowest points that is the floor: jumps are above, bad frames below."""
    floor_m: float = 0.1  #: m. So near, the floor is the world's: feet are found less well.
    cutoff_hz: float = 7.0
    """Hz. Usual cut-off: voluntary movement has little power above 6 Hz (Winter, Biomechanics and
    Motor Control)."""
    cutoff_share: float = 0.4  #: 1. Highest cut-off over the frame rate.


@dataclass(frozen=True)
class Retargeting:
    """Recorded motion on the body (`motion.mocap`, `motion.inverse_kinematics`).

    By eye. Weights are relative to that of a limb's bone or the thorax.
    """

    straight_deg: float = 15.0  #: Degrees by which a standing skeleton deviates from straight.
    upright: float = 0.2  #: 1. Fraction of the frames, most upright, that show the trunk's axes.
    trunk: float = 0.2  #: 1. Weight of lumbar spine, head and clavicles.
    foot: float = 0.03
    """1. Weight of a foot's two directions, and of a limb's turn about its axis, which matters
    little while it is straight."""
    hand: float = 0.1  #: 1. Weight of the hand.
    rest: float = 1e-3
    """1. Weight of rest where the directions leave angles free: a spine bends evenly."""


@dataclass(frozen=True)
class Refinement:
    """Poses and bodies refined on silhouettes (`refinement`).

    By eye. As a whole: `python -m benchmarks.accuracy`. Reaches are the largest accepted distances
    between contour and surface, one for each step: they shrink, since the correspondences get
    better.
    """

    searched_m: float = 0.30
    """m. First reach from a pose that was searched, within 0.3 m at every joint."""
    predicted_m: float = 0.18
    """m. First reach from a pose that is predicted."""
    shrinkage: float = 0.7
    """1. Each reach over the one before, about."""
    body_reaches_m: tuple[float, ...] = (0.12, 0.10, 0.08, 0.07, 0.06, 0.05, 0.05, 0.05)
    """m. Of a body's proportions; every other one from the third on settles the poses then."""
    contour_m: float = 0.012
    """m. Standard deviation of a contour residual with the right correspondence, and the least of a
    joint of a proposed mode."""
    independence: float = 0.35
    """1. Fraction of contour points that count as independent, at this spacing."""
    alike: float = 0.03
    """1. Correlation of the residuals of two silhouettes of one person, for the shape. Tuned on
    dance8, walk4, seeds 1301 to 1308 of level 1, and pairs of cameras of 1231 to 1240."""
    spacing_m: float = 0.035
    """m. Distance between contour points on the body. Walk4 and seed 123 (40 frames of true
    silhouettes, root_mm): 0.05 15.0 and 17.8, 0.035 14.6 and 17.4, 0.025 14.8 and 17.3."""
    outside: float = 0.5
    """1. Weight of a surface point outside a silhouette, relative to a contour point."""
    outside_m: float = 0.15
    """m. Scale of its robust weight."""
    trust_m: float = 0.10
    """m. Largest step of the root: beyond it the correspondences change."""
    trust_rad: float = 0.35
    """Radians. The same of every angle, in inverse kinematics, too."""
    margin: float = 0.25
    """1. Of a silhouette's longer side: how far around it distances are computed."""
    student_freedom: float = 4.0
    """1. Degrees of freedom of the proposal's t distribution, with which it is trained."""
    proposed: float = 0.1
    """1. Weight of a deviation from a proposed pose: its 42 coordinates are not independent. By
    eye."""
    largest_shape: float = 3.0
    """1. Largest deviation of a person's shape, in standard deviations; beyond it the hull's height
    says nothing of a stature, either: who crouches or reaches up is a factor of 1.16 off."""
    girth_sigma: float = 1.7
    """1. With one camera, multiple of the girths' standard deviations: clothes are loose."""
    length_sigma: float = 0.6
    """1. The same of the lengths, which one view confounds with depth."""
    build_sigma: float = 0.20
    """1. Deviation common to all girths, from slim to heavy."""
    same_root_m: float = 0.15
    """m. Roots of single frames farther than this from their median do not count."""

    def reaches_m(self, first_m: float) -> tuple[float, ...]:
        """Reaches that shrink evenly from a first one to the least that still finds a contour."""
        last_m = 5 * self.contour_m
        ratio = math.log(last_m / first_m)
        steps = max(round(ratio / math.log(self.shrinkage)), 0)
        return tuple(first_m * math.exp(ratio * k / max(steps, 1)) for k in range(steps + 1))

    @property
    def near_reaches_m(self) -> tuple[float, ...]:
        """Reaches from a pose that is predicted."""
        return self.reaches_m(self.predicted_m)


@dataclass(frozen=True)
class Trajectory:
    """Consecutive frames refined together (`tracking.trajectory_fit`). By eye."""

    acceleration: float = 0.35
    """1. Standard deviation of a pose's second differences, over `dynamics.pose_step_sigma`."""
    other_acceleration: float = 0.12
    """1. The same of the angles of bodies that are no person's, whose usual steps are wide."""
    foot_m: float = 0.02
    """m. Scale of the robust weight of a standing foot's movement, and standard deviation of the
    lowest point's height above the floor: as far soles are from where the body has them."""
    still: float = 0.3
    """1. Standard deviation of that movement over its scale."""
    stand_m: float = 0.16
    """m. Height of the ankle above the floor up to which a foot may stand; half of it is the scale
    of the robust weight of that height, since somebody may jump."""
    target_m: float = 0.003
    """m. Standard deviation of a joint that was set by hand: it overrules silhouettes and steps."""


@dataclass(frozen=True)
class Steps:
    """Steps between the hypotheses of consecutive frames (`tracking.step_costs`). By eye."""

    restart: float = 45.0
    """Nats. Largest cost of a step; what costs more is no movement."""
    longest_frame: float = 3.0
    """1 / FPS. Interval of frames up to which a frame counts more than one of 1 / FPS."""
    spacing_deg: float = 3.0
    """Degrees. Distance of angles that refinement does not tell apart."""
    spacing_m: float = 0.05
    """m. The same of places."""


BACKGROUND = Background()
FOREGROUND = Foreground()
SHADOW = CastShadow()
EXPOSURE = ExposureField()
SCENE = EmptyScene()
BACKDROP = Backdrop()
CUT = Cut()
COLOURS = Colours()
PRESENCE = Presence()
PLAUSIBILITY = Plausibility()
CAMERA_MOTION = CameraMotion()
MEASURING = Measuring()
STEPS = Steps()
DYNAMICS = Dynamics()
RETARGETING = Retargeting()
REFINEMENT = Refinement()
TRAJECTORY = Trajectory()
