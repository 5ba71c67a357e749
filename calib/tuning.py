"""Numbers of the calibration that were tuned or chosen, each with its unit and where it comes from.

"By eye" says that a number was chosen when its method was written and never varied on its own; what
is told after it measures the method as a whole. Pixels "of a small image" are those of 480 x 360 px
and grow with the image, see `agreement.image_scale`.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Agreement:
    """Agreement of cameras by their outlines (`agreement`, `suspect`, `repair`, `synchronise`).

    All by eye; `python -m benchmarks.agreement whole bumps breaks sync` on walk4, traffic4, dance8,
    standing4 and balancing4 accuses no camera that should not be.
    """

    kept: float = 0.8
    """1. Fraction of the errors in the trimmed mean: the rest are shadows and lost limbs."""
    ends: float = 0.04
    """1. Fraction of a recording left out at either end: people come and go."""
    culprit_gain: float = 2.5
    """1. A camera is a culprit if its error is so many times that of the others; a picture of a
    board is left out whose error is so many times the median picture's."""
    accurate_px: float = 0.28
    """px of a small image. Error below which silhouettes cannot be told from perfect ones."""
    disagree_px: float = 2.5
    """px of a small image. Error above which cameras disagree, whoever is to blame."""
    good_px: float = 0.4
    """px of a small image. Error of cameras that agree, with silhouettes as they usually are."""
    soft_px: float = 0.5
    """px of a small image. Scale of the soft L1 loss of tangency errors."""
    subframe: float = 0.6
    """Frames. Offsets up to this do no harm and cannot be corrected by whole frames: half a frame,
    and the error of its estimate."""
    offset_step_frames: float = 0.5
    """Frames. Step in which offsets of a pair of cameras are tried."""
    suspect_step_frames: float = 0.25
    """Frames. The same for one camera against all others."""
    slope_frames: float = 0.2
    """Frames. Half width of the difference quotient: interpolated errors have kinks at frames."""
    moved_px: float = 2.5
    """px of a small image. Movement within a quarter of a recording; edges flicker by one."""
    lost_px: float = 20.0
    """px of a small image. Error of a plane that is lost, so that losing all is not best."""
    simpler_gain: float = 1.4
    """1. A simpler explanation is preferred up to so many times the smallest error."""
    helping_share: float = 0.5
    """1. Fraction of the error below which an explanation has to bring it. A repair of a recording
    that does so is sure, although not all cameras agree yet: seed 322 of level 2."""
    explained_gain: float = 2.0
    """1. Multiple of the others' error below which an explanation has to bring it."""
    late_enough_gain: float = 1.5
    """1. Multiple of the others' error at which an offset ends the search, and from which a camera
    is remarked on in a table."""
    perfect_gain: float = 1.2
    """1. The same for a changed pose or image, which look alike."""
    stretched: float = 0.04
    """1. Logarithm of a scale from which an image is stretched and not a camera moved."""
    shifted: float = 0.01
    """1. Of the image's longer side: shift from which a scaling is not about the middle."""


@dataclass(frozen=True)
class Outline:
    """Outlines of silhouettes and their tangent planes (`tangency`). By eye, as above."""

    gap: float = 0.01
    """1. Of the image's diagonal: components so near to each other count as one."""
    large_component: float = 0.25
    """1. Of the largest component's area, from which another one counts."""
    widest_deg: float = 150.0
    """Degrees that a body takes about a baseline; beyond, this passes through or close to it."""
    least_across: float = 0.05
    """1. Sine of a ray's least angle to the baseline."""


@dataclass(frozen=True)
class Signal:
    """Clock offsets from signals (`correlation`, `signals`).

    All by eye; `python -m benchmarks.out_of_step person pointing shared board`: offsets right or
    called unsure, but for somebody who only points with one arm.
    """

    step_s: float = 0.01
    """s. Step at which signals are sampled."""
    sigma_s: float = 0.06
    """s. Standard deviation of the Gaussian by which they are smoothed."""
    overlap: float = 0.25
    """1. Of the shorter signal: least overlap for a correlation."""
    alike: float = 0.3
    """1. Correlation below which two signals do not show the same."""
    rival: float = 0.6
    """1. Of the best offset's correlation: from there on another offset may be as likely,"""
    telling: float = 4.0
    """1. unless it leaves so many times more of the variance unexplained."""
    apart_sigmas: float = 4.0
    """1. Sigmas of the smoothing by which offsets differ that are not the same peak."""
    apart_s: float = 0.05
    """s. The least that they differ by."""


@dataclass(frozen=True)
class Board:
    """Boards, lenses and poses (`board`, `intrinsics`, `extrinsics`, `pairs`, `points`, `adjust`).

    All by eye; `python -m benchmarks.calibration`: as accurate as cv2.calibrateMultiview with known
    lenses, and more so with unknown ones.
    """

    least_square_px: float = 8.0
    """px. Smallest side of a square whose corners are found well."""
    blur: float = 0.25
    """Squares. Width of an edge from which a picture is blurred."""
    bend: float = 0.12
    """Squares. Deviation from a plane's image that no lens makes: lenses' are some hundredths."""
    robust_px: float = 3.0
    """px. Scale of the soft L1 loss of the bundle adjustment."""
    radial_sigma: float = 1.0
    """1. Prior of radial distortion terms, against one corner's pixel: decides what cancels."""
    tangential_sigma: float = 0.05
    """1. The same of tangential terms."""
    picture_px: float = 0.5
    """px. Least error of a picture that is left out, see `Agreement.culprit_gain`."""
    sparse: float = 0.25
    """1. Fraction of a region's cells with corners below which there are hardly any."""
    far_px: float = 20.0
    """px at a focal length of 1000 px. Boards that start farther off are left out."""
    same_pose: float = 0.1
    """Radians, and metres per metre. Relative poses that differ less agree."""
    line_width: float = 1e-3
    """1. Width over length of points that lie on one line."""
    point_gain: float = 4.0
    """1. Multiple of the median error from which a point is remarked on,"""
    point_px: float = 2.0
    """px. and its least error."""


@dataclass(frozen=True)
class Upright:
    """Up from how cameras stand (`upright`).

    All by eye; measured as a whole in docs/results.md, "Which way is up".
    """

    same_deg: float = 20.0
    """Degrees. Directions of up nearer to each other than this are one."""
    ambiguous: float = 0.9
    """1. Of what the best direction explains: another that does so may be up."""
    alike: float = 0.8
    """1. The same for an axis of the world near the best direction: images lean."""
    equal: float = 0.98
    """1. The same for any axis: one camera leaves open how far it looks down."""
    possible: float = 0.6
    """1. Worth from which z is kept where nothing but the cameras can be asked."""
    straight: float = 0.95
    """1. Cosine from which a camera looks straight up or down, and does not tell."""
    on_its_side: float = 0.7
    """1. Worth of a camera that lies on its side; upright it is 1."""
    upside_down: float = 0.3
    """1. Worth of a camera that hangs upside down."""
    pull: float = 0.01
    """1. Toward the images' mean vertical, where the horizontals leave a choice."""


AGREEMENT = Agreement()
OUTLINES = Outline()
SIGNALS = Signal()
BOARDS = Board()
UPRIGHT = Upright()
