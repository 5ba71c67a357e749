"""Numbers of the calibration that were tuned or chosen, each with its unit and where it comes from.

"By eye" says that a number was chosen when its method was written and never varied on its own; what
is told after it measures the method as a whole. Pixels "of a small image" are those of 480 x 360 px
and grow with the image, see `agreement.image_scale`; the error of outlines that are perfect but for
the pixels follows from these, `agreement.ROUNDING_PX`.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Agreement:
    """Agreement of cameras by their outlines (`agreement`, `repair`, `synchronise`).

    All by eye; `python -m benchmarks.agreement whole bumps breaks sync` on walk4, traffic4, dance8,
    standing4 and balancing4 accuses no camera that should not be.
    """

    trimmed: float = 0.8
    """1. Fraction of the errors in the trimmed mean: the rest are shadows and lost limbs."""
    ends: float = 0.04
    """1. Fraction of a recording left out at either end: people come and go."""
    culprit_gain: float = 2.5
    """1. A camera is a culprit if its error is so many times that of the others; a picture of a
    board or a point is an outlier whose error is so many times the median."""
    disagree_px: float = 2.5
    """px of a small image. Distance that errors of silhouettes do not reach: cameras beyond it
    disagree, and an outline has moved."""
    step_frames: float = 0.25
    """Frames. Step in which offsets are tried, and half width of difference quotients:
    interpolated errors have kinks at frames."""
    explained_gain: float = 2.0
    """1. Multiple of the others' error, and inverse of the part of its own, below which an
    explanation has to bring a camera's error. A repair of a recording that does so is sure,
    although not all cameras agree yet: seed 322 of level 2."""
    alike_gain: float = 1.4
    """1. Errors that differ by less are as good as equal: the simpler explanation is preferred."""
    perfect_gain: float = 1.2
    """1. The same for a changed pose or image, which look alike."""
    stretched: float = 0.04
    """1. Logarithm of a scale from which an image is stretched and not a camera moved."""


@dataclass(frozen=True)
class Outline:
    """Outlines of silhouettes and their tangent planes (`tangency`). By eye, as above."""

    gap: float = 0.01
    """1. Of the image's diagonal: components so near to each other count as one."""
    large_component: float = 0.25
    """1. Of the largest component's area, from which another one counts."""


@dataclass(frozen=True)
class Signal:
    """Clock offsets from signals (`signals`).

    All by eye; `python -m benchmarks.out_of_step person pointing shared board`: offsets right or
    called unsure, but for somebody who only points with one arm.
    """

    sigma_s: float = 0.06
    """s. Standard deviation of the Gaussian by which they are smoothed."""
    overlap: float = 0.25
    """1. Of the shorter signal, or of the planes that are compared elsewhere: least overlap for an
    offset to be judged."""
    alike: float = 0.3
    """1. Correlation below which two signals do not show the same."""
    rival: float = 0.6
    """1. Of the best offset's correlation: from there on another offset may be as likely,"""
    telling: float = 4.0
    """1. unless it leaves so many times more of the variance unexplained."""
    apart_s: float = 0.24
    """s. Least difference of offsets that are not the same peak."""


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
    """px. Scale of the soft L1 loss of the bundle adjustment, and least error of an outlier that is
    told."""
    tangential_sigma: float = 0.05
    """1. Scale of tangential distortion terms, of which that of radial ones is 1."""
    sparse: float = 0.25
    """1. Fraction of a region's cells with corners below which there are hardly any."""
    far_px: float = 20.0
    """px at a focal length of 1000 px. Boards that start farther off are left out."""
    same_pose: float = 0.1
    """Radians, and metres per metre. Relative poses that differ less agree."""


@dataclass(frozen=True)
class Upright:
    """Up from how cameras stand (`upright`).

    All by eye; measured as a whole in docs/results.md, "Calibration".
    """

    same_deg: float = 20.0
    """Degrees. Directions nearer to each other than this are one: of up, or of a camera that looks
    straight up or down and does not tell."""
    ambiguous: float = 0.85
    """1. Of what the best direction explains: another that does so may be up, and an axis of the
    world near it is."""
    equal: float = 0.98
    """1. The same for any axis: one camera leaves open how far it looks down."""
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
