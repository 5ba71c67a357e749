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
    """Body found in one frame."""

    model: BodyModel
    pose: Pose
    part_rotation: NDArray[np.float64]  # (27, 3, 3) float64, world from part, the identity at rest
    part_origin_m: NDArray[np.float64]  # (27, 3) float64, world positions of the parts' joints
    joints_m: NDArray[np.float64]  # (15, 3) float64, world, in the order of `joints.LANDMARK_NAMES`
    joint_confidence: NDArray[np.float64]  # (15,) float64, from 0 to 1
    confidence: float  # of the whole pose, from 0 to 1: one minus XOR over OR of the silhouettes
    hypotheses: Hypotheses = ()  # other likely poses of one camera
    # (n, 3) float32, centres of the hull's voxels; None where no hull was carved.
    hull_m: NDArray[np.float32] | None = None


People = tuple[PosedBody | None, ...]
"""Each of several people, or the one, by number; None where nobody was found."""


def hidden_note(people: People) -> str:
    """One line that names those of several people of whom others hide joints; else nothing."""
    hidden = [
        f"person {k + 1}"
        for k, body in enumerate(people)
        if len(people) > 1 and body is not None and np.ptp(body.joint_confidence)
    ]
    return f"hidden in part by others: {', '.join(hidden)}" if hidden else ""


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """One moment, seen by all cameras, and what was found in it."""

    number: int  # of the frame, counted from the session's start, dropped ones included
    time_s: float  # time of capture, seconds since the session's start
    pictures: Mapping[str, NDArray[np.uint8]]  # (H, W, 3) uint8 BGR by camera name, as captured
    # (h, w) bool by camera name, of the pictures or of these scaled down.
    silhouettes: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)
    # Of each person that is asked for, in the order of their numbers; None where nobody was found.
    people: People = (None,)
    # One line about this frame for the user, such as a second person; empty: nothing.
    note: str = ""
    # Time of capture, Unix time, for receivers on other clocks; nan: unknown.
    captured_unix_s: float = float("nan")

    @property
    def body(self) -> PosedBody | None:
        """The person, of several the first."""
        return self.people[0]


@dataclass(frozen=True)
class SessionState:
    """State of a live session, for the page and the terminal."""

    phase: Phase
    message: str  # the same in words for the user, with the remedy where something is wrong
    recording: bool = False
    frames: int = 0
    dropped: int = 0  # number of frames dropped because newer ones had come
    fps: float = 0.0  # frames estimated per second, recently
    arriving_fps: float = 0.0  # frames that came from the cameras per second, recently
    # From capture to the pose, median of recent frames; nan before the first.
    latency_s: float = float("nan")
    # Median seconds of recent frames, by stage.
    stage_s: Mapping[str, float] = field(default_factory=dict)
    # One word or line about each camera: "ok", or what is wrong.
    cameras: Mapping[str, str] = field(default_factory=dict)

    @property
    def pace(self) -> str:
        """One line with a remedy where a person is followed in far fewer frames than come; else
        nothing.
        """
        if self.phase != "following" or not 3 * self.fps < 2 * self.arriving_fps:
            return ""
        return (
            f"this machine follows {self.fps:.0f} of {self.arriving_fps:.0f} pictures a second:"
            " use fewer cameras, set them to fewer or smaller pictures, or record and fit, which"
            " uses every one"
        )
