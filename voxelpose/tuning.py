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
