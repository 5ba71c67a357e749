"""Tuned numbers of the application, each with its unit, what it does and where it comes from."""

from __future__ import annotations

from dataclasses import dataclass


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
