"""Tuned numbers of the application, each with its unit, what it does and where it comes from."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Reliability:
    """The verdict on a result (`reliability`)."""

    lost: float = 0.1
    """1. Fraction of frames without a pose above which a result is doubtful. By reasoning."""

    right: float = 0.5
    """1. Probability of a frame to be right below which it counts as wrong: more likely than not.
    A quarter of such frames makes a result doubtful."""

    agreement: float = 0.75
    """1. Outline agreement below which that is the reason, and the measure of one camera. Tuned on
    seeds 1 to 40 of `benchmarks.trials` with one camera."""

    open_mm: float = 75.0
    """mm. Error to expect from one camera above which its poses are open. Tuned on seeds 1 to 40 of
    `benchmarks.trials` with one camera."""

    seam_mm: float = 80.0
    """mm. Mean distance of the joints of two pieces in the frames that they share. Source unknown:
    chosen by eye, not ablated."""

    near: float = 0.5
    """1. Probability of a joint to be within 30 mm below which it is named: as likely as not."""

    uncertain: float = 0.5
    """1. Fraction of such joints above which a result is doubtful: most. Of 13 right results of
    random recordings none has more than 3 of 15; opencap_walk, 309 mm wrong, has 11."""

    half_turn: float = 1.5
    """1. Ratio of what the body leaves open turned half round and as found, below which the heading
    is the reason. Source unknown: chosen by eye, not ablated."""


RELIABILITY = Reliability()


@dataclass(frozen=True)
class BoardSearch:
    """Search for calibration boards in videos (`calibration.board_views`, `board_moments`).

    None of these was ablated: they were chosen by eye on rendered and real boards.
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


BOARD_SEARCH = BoardSearch()


@dataclass(frozen=True)
class Synchronisation:
    """Clock offsets from a board, sound and silhouettes (`calibration.sync`)."""

    doubtful_px: float = 0.8
    """px of a picture of 480 x 360. Disagreement of the outlines above which an offset is unsure.
    Source unknown: chosen by eye, not ablated."""

    subframe: float = 0.6
    """frames. Offsets up to this do no harm and cannot be corrected: half a frame, and the error of
    its estimate."""

    board_hz: float = 12.0
    """Hz. How often a carried board is looked for. Enough on the boards of docs/results.md."""

    sound_sigma_s: float = 0.002
    """s. Noise of a sudden sound's time. Source unknown: chosen by eye, not ablated."""

    sudden: float = 1.5
    """1. Rise of the logarithm of sound's energy over the quietest moment of a second around, above
    which it is sudden. Source unknown: chosen by eye, not ablated."""

    around_s: float = 0.02
    """s. Time over which sound's energy is smoothed; a quarter of it for the sudden sound."""


SYNCHRONISATION = Synchronisation()


@dataclass(frozen=True)
class Live:
    """Live sessions (`live`).

    None of these was ablated: they were chosen by eye on webcams and on videos played as cameras.
    """

    apart: float = 0.6
    """1. Share of the shortest interval between pictures by which time stamps of one moment may
    differ: a picture at half an interval belongs to either moment."""

    silent_s: float = 0.4
    """s. Time without a picture, or three of its intervals, after which a camera is left out."""

    beginning_s: float = 2.0
    """s. Beginning of a session in which every camera's first picture is waited for."""

    interval_smoothing: float = 0.1
    """1. Weight of the newest interval between pictures in their mean."""

    first_wait_s: float = 0.5
    """s. First wait before a camera or receiver that failed is tried again; each is twice as long
    as the last."""

    longest_wait_s: float = 8.0
    """s. Longest wait before it is tried again."""

    searching_s: float = 0.09
    """s. Time between frames while a person is searched: the search needs the processor."""

    window_margin: float = 0.15
    """1. Margin about a silhouette in which the next one is looked for, of its size."""

    second_component: float = 0.3
    """1. Area of somebody else's silhouette, of the largest component, from which it is noted."""

    second_picture: float = 0.004
    """1. The same of the picture: what is smaller is noise."""


LIVE = Live()


@dataclass(frozen=True)
class LongRecording:
    """Division of long recordings into pieces (`batch.pieces`)."""

    longer: float = 1.5
    """1. Length of a recording, in pieces, from which it is divided: from there two halves are
    nearer to a piece than the whole is. By reasoning, not ablated."""

    overlap_s: float = 1.0
    """s. Time that two pieces share. Source unknown: chosen by eye, not ablated."""


LONG_RECORDING = LongRecording()


@dataclass(frozen=True)
class Report:
    """Assessment of a result in its report (`report`).

    Source unknown: chosen by eye, not ablated. The program's own verdict has measured limits.
    """

    sure: float = 0.85
    """1. Outline agreement from which a result is good."""

    doubtful: float = 0.7
    """1. Outline agreement below which a frame, or in the median the result, is doubtful."""

    covered: float = 0.7
    """1. Share of a part inside the hull from which it is covered."""

    often_uncovered: float = 0.1
    """1. Share of the frames with an uncovered part above which the part is named."""

    lost: float = 0.05
    """1. Share of the frames without a pose above which the result is bad."""

    camera_apart: float = 0.06
    """1. How far the overlap of body and silhouette in a camera is below the median camera's where
    the camera is named."""


REPORT = Report()


@dataclass(frozen=True)
class Viewer:
    """What the viewer marks (`view.viewer`). Source unknown: chosen by eye, not ablated."""

    outlying_m: float = 0.05
    """m. Distance from the body above which a voxel is unexplained: a hull of few cameras is larger
    than the body."""

    weak_overlap: float = 0.5
    """1. Share of a part inside the hull below which the part is named."""


VIEWER = Viewer()
