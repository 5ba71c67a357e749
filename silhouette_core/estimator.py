"""What an estimator is, and how estimators are found.

An estimator is a class without constructor arguments, registered under the entry point group
`silhouette_core.estimators`:

    [project.entry-points."silhouette_core.estimators"]
    multiview = "voxelpose.multiview:MultiViewEstimator"

All take the same frames and give the same Motion; nothing downstream knows which one ran.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from silhouette_core.progress import Reporter

if TYPE_CHECKING:
    from calib.camera import Rig
    from silhouette_core.motion.motion import Motion

GROUP = "silhouette_core.estimators"

Frame = NDArray[np.uint8]
"""(H, W, 3) uint8, BGR, as the camera recorded it (lens distortion included)."""


class FrameSource(Protocol):
    """Frames of one or several synchronous cameras: a Recording, or anything that looks like one."""

    @property
    def rig(self) -> Rig:
        """The cameras."""
        ...

    @property
    def fps(self) -> float:
        """Frames per second."""
        ...

    @property
    def frame_count(self) -> int:
        """How many time steps an iteration yields."""
        ...

    @property
    def silhouettes_given(self) -> bool:
        """Whether the frames are silhouettes already (white on black) and need no background."""
        ...

    def backgrounds(self) -> Mapping[str, Iterable[Frame]]:
        """Returns frames of the empty view for each camera that has them."""
        ...

    def regions(self) -> Mapping[str, NDArray[np.bool_]]:
        """Returns where the person may be, (H, W) bool, for each camera that is told."""
        ...

    def __iter__(self) -> Iterator[tuple[int, float, Mapping[str, Frame]]]:
        """Yields (frame number in the recording, time in seconds, a frame per camera name); may be
        started more than once.
        """
        ...


@dataclass(frozen=True)
class Settings:
    """What an estimator is told.

    Attributes: stature_m: height of the person, metres; None: estimated. chest_m: chest girth,
        metres; None: usual for the stature. sex: whose proportions. background: `paper` is Okada
        and Stenger 5.1 as written; `refined` adds what this project does against shadows and noise.
        smooth: smooth the finished motion over time (off-line, without lag). threads: None: all
        cores. options: settings of one estimator only, by name (`interference`, `voxel_size_m` of
        the multi-view one). An estimator refuses
            names that it does not know with an InputError.
    """

    stature_m: float | None = None
    chest_m: float | None = None
    sex: Literal["male", "female", "unknown"] = "unknown"
    background: Literal["refined", "paper"] = "refined"
    smooth: bool = True
    threads: int | None = None
    options: Mapping[str, bool | int | float | str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Estimate:
    """What an estimator gives.

    Attributes: motion: the poses. stage_s: stage -> (n,) float64 seconds, one value per frame (or a
        single one for a stage that runs once). facts: what else is worth keeping in summary.json
        (numbers, words, lists of them): the estimated stature, the voxel size, ... hypotheses:
        other poses that the frames allow: (frame number, probabilities (n,), joints (n, 15, 3)
        world m) each, likeliest first.
    """

    motion: Motion
    stage_s: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    facts: Mapping[str, object] = field(default_factory=dict)
    hypotheses: Iterable[tuple[int, NDArray, NDArray]] | None = None


@runtime_checkable
class Estimator(Protocol):
    """Frames in, motion out."""

    name: str

    def estimate(self, source: FrameSource, settings: Settings, reporter: Reporter) -> Estimate:
        """Estimates the motion.

        Args: source: the frames. Held one time step at a time: memory must not grow with the
            recording's length. settings: see Settings. reporter: told of every stage and step.

        Returns:
            The motion, how long each stage took, and facts.

        Raises: InputError: the source or the settings cannot be used, in one line that names the
            remedy.
        """
        ...


def available_estimators() -> dict[str, EntryPoint]:
    """Returns the registered estimators by name, without importing any."""
    return {point.name: point for point in entry_points(group=GROUP)}


def load_estimator(name: str) -> Estimator:
    """Imports and makes an estimator.

    Args:
        name: as registered.

    Returns:
        A new one.

    Raises:
        InputError: none is registered under this name.
        TypeError: what is registered is not an estimator.
    """
    points = available_estimators()
    if name not in points:
        raise InputError(
            f"no estimator is called {name!r}: installed are {', '.join(sorted(points)) or 'none'}"
        )
    made = points[name].load()()
    if not isinstance(made, Estimator):
        raise TypeError(
            f"{points[name].value} is registered as an estimator but has no name or no estimate()"
        )
    return made
