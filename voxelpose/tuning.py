"""Tuned numbers of the application, each with its unit, what it does and where it comes from.

"By eye" says that a number was chosen when its method was written and never varied on its own.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Reliability:
    """The verdict on a result (`reliability`)."""

    lost: float = 0.1
    """1. Fraction of frames without a pose above which a result is doubtful, and bad in its report,
    which names a part that is uncovered as often. By reasoning."""
    agreement: float = 0.75
    """1. Outline agreement below which that is the reason, and the measure of one camera; in the
    report, of a frame that is doubtful. Tuned on seeds 1 to 40 of `benchmarks.trials` with one
    camera."""
    open_mm: float = 45.0
    """mm. Mean error to expect from one camera above which its poses are open. Of seeds 1 to 10 and
    41 to 47 of level 1, with the pose network and without, all that are 70 mm off or more are above
    (50 mm and more), and of the others two (docs/decisions.md)."""
    seam_mm: float = 80.0
    """mm. Mean distance of the joints of two pieces in the frames that they share. By eye."""
    turn_deg_s: float = 1000.0
    """Degrees, a second, of the pelvis' transverse axis: faster than anybody turns. The fastest of
    the known recordings has 846 (dance8, a dancer), of 80 random ones 596."""
    half_turn: float = 1.5
    """1. Ratio of what the body leaves open turned half round and as found, below which the heading
    is the reason. By eye."""


@dataclass(frozen=True)
class BoardSearch:
    """Search for calibration boards in videos (`calibration.board_views`, `board_moments`).

    All by eye, on rendered and real boards.
    """

    new_view: float = 0.02
    """1. Distance of a board's corners in two views, of the picture's width, below which one of the
    views is redundant; a still board moves a quarter of it."""
    fast: float = 2.0
    """1. Speed, of the median, above which a board is blurred."""
    widest_s: float = 0.15
    """s. Time between two frames above which a carried board does not move straight."""
    same_frame: float = 0.02
    """1. Time to a frame, of the interval, below which that frame alone is taken."""


@dataclass(frozen=True)
class Synchronisation:
    """Clock offsets from a board, sound and silhouettes (`calibration.sync`)."""

    sound_sigma_s: float = 0.002
    """s. Noise of a sudden sound's time. By eye."""
    sudden: float = 1.5
    """1. Rise of the logarithm of sound's energy over the quietest moment of a second around, above
    which it is sudden. By eye."""
    around_s: float = 0.02
    """s. Time over which sound's energy is smoothed; a quarter of it for the sudden sound."""


@dataclass(frozen=True)
class Live:
    """Live sessions (`live`). All by eye, on webcams and on videos played as cameras."""

    apart: float = 0.6
    """1. Share of the shortest interval between pictures by which time stamps of one moment may
    differ: a picture at half an interval belongs to either moment."""
    silent_s: float = 0.4
    """s. Time without a picture, or three of its intervals, after which a camera is left out."""
    searching_s: float = 0.09
    """s. Time between frames while a person is searched: the search needs the processor."""
    window_margin: float = 0.15
    """1. Margin about a silhouette in which the next one is looked for, of its size."""
    second_component: float = 0.3
    """1. Area of somebody else's silhouette, of the largest component, from which it is noted."""
    occluded: float = 0.3
    """1. Confidence of a joint on a part that is occluded, relative to the pose's."""
    second_picture: float = 0.004
    """1. The same of the picture: what is smaller is noise."""


@dataclass(frozen=True)
class Report:
    """Assessment of a result in its report (`report`).

    By eye. The program's own verdict has measured limits.
    """

    sure: float = 0.85
    """1. Outline agreement from which a result is good."""
    covered: float = 0.7
    """1. Share of a part inside the hull from which it is covered, also in the viewer."""
    camera_apart: float = 0.06
    """1. How far the overlap of body and silhouette in a camera is below the median camera's where
    the camera is named."""


RELIABILITY = Reliability()
BOARD_SEARCH = BoardSearch()
SYNCHRONISATION = Synchronisation()
LIVE = Live()
REPORT = Report()
