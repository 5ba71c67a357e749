"""Protocol of an estimator, its settings and result, and the registry of estimators.

An estimator is a class without constructor arguments, registered under the entry point group
`silhouette_core.estimators`:

    [project.entry-points."silhouette_core.estimators"]
    multiview = "voxelpose.multiview.multiview_estimator:MultiViewEstimator"

All estimators take the same frames and return the same Motion; nothing downstream knows which ran.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Protocol, TypeVar, get_type_hints, runtime_checkable

from numpy.typing import NDArray

from calib.checks import BoolArray, ByteArray, FloatArray
from calib.errors import InputError
from silhouette_core.entry_points import load_registered
from silhouette_core.motion.conditioning import Conditioning
from silhouette_core.motion.pose import JointTarget
from silhouette_core.progress import Reporter
from silhouette_core.setting_types import (
    BackgroundKind,
    Chest,
    NetworkUse,
    Sex,
    Stature,
    Threads,
    checked,
)

if TYPE_CHECKING:
    from calib.camera import Rig
    from calib.upright import UprightFrame
    from silhouette_core.motion.motion import Motion

GROUP = "silhouette_core.estimators"
ONE_CAMERA = "monocular", "tree"  #: Estimators of `voxelpose track`.

ONE_PERSONS = "what was told of the person is one person's, and is not used"
"""Note where several people are estimated, see `Settings.of_anybody`."""

Frame = ByteArray  #: (H, W, 3) uint8, BGR, as the camera recorded it (lens distortion included).


class FrameSource(Protocol):
    """Frames of one or several synchronous cameras, such as a Recording."""

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
        """Number of time steps that an iteration yields."""
        ...

    @property
    def silhouettes_given(self) -> bool:
        """Whether the frames are silhouettes already (white on black) and need no background."""
        ...

    def backgrounds(self) -> Mapping[str, Iterable[Frame]]:
        """Frames of the empty view, by camera name, for the cameras that have them."""
        ...

    def regions(self) -> Mapping[str, BoolArray]:
        """Regions in which the person may be, (H, W) bool, by camera name, where given."""
        ...

    def unknown(self) -> Mapping[str, BoolArray]:
        """Where nothing is known of the person, (H, W) bool, by camera name, where given."""
        ...

    def at(self, steps: Sequence[int]) -> Iterator[Mapping[str, Frame]]:
        """Yields the frames of selected time steps, counted from 0, in ascending order."""
        ...

    def __iter__(self) -> Iterator[tuple[int, float, Mapping[str, Frame]]]:
        """Yields frame number, time in seconds and the frames by camera name.

        Every call starts again at the first frame.
        """
        ...


@dataclass(frozen=True)
class KnownPerson:
    """What is known of one of several people before the estimation."""

    name: str = ""
    stature_m: Stature | None = None  #: height, metres; None: estimated.
    sex: Sex = "unknown"


@dataclass(frozen=True)
class Settings:
    """Settings of an estimation."""

    stature_m: Stature | None = None  #: height of the person, metres; None: estimated.
    chest_m: Chest | None = None  #: chest girth, metres; None: usual for the stature.
    sex: Sex = "unknown"  #: It decides the proportions.
    background: BackgroundKind = "auto"  #: see `BackgroundKind`.
    network: NetworkUse = "auto"
    """Either "auto", which uses the pose network where it is installed, see
    `silhouette_core.network_files`, or "off"."""
    up: tuple[float, float, float] | None = None
    """Direction of up in the world, three numbers; None: as the calibration states, else found from
    the cameras and the person."""
    smooth: bool = True  #: Use later frames, and filter the finished motion (off line, no lag).
    threads: Threads | None = None  #: number of threads; None: all cores.
    backend: str = "cpu"  #: Scoring backend, a name as for `scoring.backend.load_backend`.
    conditioning: Conditioning = field(default_factory=Conditioning)
    """Gaps of the finished motion that are filled, and its filter."""
    options: Mapping[str, bool | int | float | str] = field(default_factory=dict)
    """Settings of one estimator only, by name (`interference`, `voxel_size_m` of the multi-view
    one); see `read_options`."""

    people: tuple[KnownPerson, ...] = ()
    """What is known of several people, in the order of their numbers; of others nothing is."""
    targets: tuple[JointTarget, ...] = ()  #: Joints of one person that were set by hand.

    def of_person(self, number: int) -> Settings:
        """The same of one of several people, counted from 0: with what is known of that one."""
        known = self.people[number : number + 1]
        person = known[0] if known else KnownPerson()
        return replace(self.of_anybody, people=known, stature_m=person.stature_m, sex=person.sex)

    @property
    def of_anybody(self) -> Settings:
        """The same where several people are estimated: without what is one person's."""
        options = {name: value for name, value in self.options.items() if name != "body"}
        return replace(
            self, stature_m=None, chest_m=None, sex="unknown", options=options, targets=()
        )

    def upright_targets(self, frame: UprightFrame) -> tuple[JointTarget, ...]:
        """The joints that were set, in an upright frame."""
        return tuple(
            replace(one, place_m=tuple(frame.points(one.place_m).tolist())) for one in self.targets
        )

    @property
    def applied_conditioning(self) -> Conditioning:
        """What is done to the motion: no filter where it shall not be smoothed."""
        return (
            self.conditioning
            if self.smooth
            else replace(self.conditioning, filter="none", filter_order=None)
        )


Options = TypeVar("Options")


def read_options(
    kind: type[Options], options: Mapping[str, bool | int | float | str], estimator: str
) -> Options:
    """Options of one estimator as its dataclass, checked by the types of its fields.

    Args:
        kind: the dataclass; its fields are the options that exist.
        options: options by name, see `Settings`.

    Raises:
        InputError: an option does not exist, or has a value of another type or range.
    """
    known = get_type_hints(kind, include_extras=True)
    unknown = sorted(set(options) - set(known))
    if unknown:
        raise InputError(
            f"the {estimator} estimator has no option {unknown[0]!r}: it has {', '.join(known)}"
        )
    return kind(**{name: checked(value, known[name], name) for name, value in options.items()})


@dataclass(frozen=True, eq=False)
class Estimate:
    """Result of an estimation."""

    motion: Motion
    stage_s: Mapping[str, FloatArray] = field(default_factory=dict)
    """Stage -> (n,) float64 seconds, one per frame (or a single one for a stage that runs once)."""
    facts: Mapping[str, object] = field(default_factory=dict)
    """Further entries of summary.json (numbers, strings, lists of them), such as the estimated
    stature or the voxel size."""
    hypotheses: Iterable[tuple[int, NDArray, NDArray]] | None = None
    """Alternative poses of each frame: frame number, probabilities (n,) and joints (n, 15, 3) in
    the world, m, likeliest first."""
    rig: Rig | None = None  #: the cameras as they were found to stand; None: as the source says.
    absent_frames: frozenset[int] = frozenset()  #: frames in which the person is not there.


@runtime_checkable
class Estimator(Protocol):
    """Estimates the motion of a person from frames.

    One with the option `body` may say so by an attribute `takes_body`: then the subject's is given.
    An attribute `usual_background` replaces the background `auto`.
    """

    name: str

    def estimate(self, source: FrameSource, settings: Settings, reporter: Reporter) -> Estimate:
        """Estimates the motion.

        Args:
            source: the frames. Held one time step at a time: memory must not grow with the
                recording's length.

        Returns:
            The motion, the durations of the stages, and facts.

        Raises:
            InputError: the source or the settings cannot be used; one line that names the remedy.
        """
        ...


@runtime_checkable
class PeopleEstimator(Estimator, Protocol):
    """An estimator that estimates several people, too."""

    def estimate_people(
        self, source: FrameSource, settings: Settings, reporter: Reporter, people: int | None
    ) -> list[Estimate]:
        """Estimates the motion of everybody.

        Args:
            source: the frames, as of `estimate`.
            people: how many there are; None: as many as are seen.

        Returns:
            An estimate of each.

        Raises:
            InputError: as `estimate`; fewer people are there.
        """
        ...


def load_estimator(name: str) -> Estimator:
    """New instance of a registered estimator.

    Raises:
        InputError: no estimator is registered under this name.
        TypeError: the registered object is not an estimator.
    """
    return load_registered(GROUP, "estimator", Estimator, name)
