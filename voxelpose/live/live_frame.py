"""What the stages of live estimation hand to each other and show."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.motion.pose import Pose

Phase = Literal["no background", "countdown", "learning", "searching", "following", "stopped"]
"""What the estimation is doing: it has no background yet, waits until the view is empty, learns
the background, looks for a person, follows one, or was stopped.
"""

Hypotheses = tuple[tuple[float, NDArray[np.float64]], ...]
"""Likely poses: probability and joints (15, 3) m of each, likeliest first."""


@dataclass(frozen=True, eq=False)
class PosedBody:
    """Body found in one frame.

    Attributes:
        part_rotation: (27, 3, 3) float64, world from part, the identity at rest.
        part_origin_m: (27, 3) float64, world positions of the parts' joints.
        joints_m: (15, 3) float64, world, in the order of `joints.LANDMARK_NAMES`.
        joint_confidence: (15,) float64, from 0 to 1.
        confidence: of the whole pose, from 0 to 1: one minus XOR over OR of the silhouettes.
        hypotheses: other likely poses of one camera.
        hull_m: (n, 3) float32, centres of the hull's voxels; None where no hull was carved.
    """

    model: BodyModel
    pose: Pose
    part_rotation: NDArray[np.float64]
    part_origin_m: NDArray[np.float64]
    joints_m: NDArray[np.float64]
    joint_confidence: NDArray[np.float64]
    confidence: float
    hypotheses: Hypotheses = ()
    hull_m: NDArray[np.float32] | None = None


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """One moment, seen by all cameras, and what was found in it.

    Attributes:
        number: of the frame, counted from the session's start, dropped ones included.
        time_s: time of capture, seconds since the session's start.
        pictures: (H, W, 3) uint8 BGR by camera name, as captured.
        silhouettes: (h, w) bool by camera name, of the pictures or of these scaled down.
        body: the person; None where none was found.
        note: one line about this frame for the user, such as a second person; empty: nothing.
        captured_unix_s: time of capture, Unix time, for receivers on other clocks; nan: unknown.
    """

    number: int
    time_s: float
    pictures: Mapping[str, NDArray[np.uint8]]
    silhouettes: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)
    body: PosedBody | None = None
    note: str = ""
    captured_unix_s: float = float("nan")


@dataclass(frozen=True)
class SessionState:
    """State of a live session, for the page and the terminal.

    Attributes:
        message: the same in words for the user, with the remedy where something is wrong.
        dropped: number of frames dropped because newer ones had come.
        fps: frames estimated per second, recently.
        latency_s: from capture to the pose, median of recent frames; nan before the first.
        stage_s: median seconds of recent frames, by stage.
        cameras: one word or line about each camera: "ok", or what is wrong.
    """

    phase: Phase
    message: str
    recording: bool = False
    frames: int = 0
    dropped: int = 0
    fps: float = 0.0
    latency_s: float = float("nan")
    stage_s: Mapping[str, float] = field(default_factory=dict)
    cameras: Mapping[str, str] = field(default_factory=dict)
