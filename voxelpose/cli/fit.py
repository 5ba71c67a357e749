"""voxelpose fit, and what `voxelpose track` shares with it: arguments and the estimation."""

from __future__ import annotations

import tomllib
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from tyro.conf import Suppress, arg

from silhouette_core import setting_types
from voxelpose.cli import arguments
from voxelpose.cli.terminal import Progress

if TYPE_CHECKING:
    from silhouette_core.estimator import Settings
    from silhouette_core.progress import Reporter
    from voxelpose.recording.folder import Recording
    from voxelpose.results import Result

SHARES = tomllib.loads(Path(__file__).with_name("stage_shares.toml").read_text(encoding="utf-8"))
"""By estimator, the shares of the time that its stages usually take, in their order."""


@dataclass(frozen=True, kw_only=True)
class EstimationArguments(arguments.PosingArguments, ABC):
    """Arguments of `voxelpose fit` and `voxelpose track` alike."""

    groups: ClassVar = arguments.GROUPS
    estimator_options: ClassVar[Mapping[str, str]]
    """Options of the estimator, and the fields that hold them."""
    people_seen: ClassVar = True
    """Whether as many people as are seen can be asked for."""
    recording: arguments.RecordingFolder
    out: Annotated[Path, arg(metavar="OUT")]
    """Folder to be made for the results."""
    body: arguments.BodyName = None
    people: Annotated[int | str, arg(metavar="N|auto")] = "auto"
    """Number of people: each is followed. auto: as many as are seen. 1: one, whoever else passes
    by."""
    frames: arguments.Frames = None
    overwrite: arguments.OverwriteResult = False
    smooth: bool = True
    """Filter the motion over time; with track, --no-smooth uses previous frames only."""
    filter: setting_types.FilterKind = "auto"
    """Low-pass filter of the finished motion, without lag; savgol: Savitzky-Golay; auto:
    butterworth, or none with --method paper."""
    cutoff: Annotated[float, arg(metavar="HZ")] = 7.0
    """Cut-off: the frequency at which half of the amplitude is left."""
    filter_order: Annotated[setting_types.FilterOrder | None, arguments.optional("N")] = None
    """Order of the Butterworth filter, applied forward and backward, or degree of Savitzky-Golay's
    polynomial. Default: 2 or 3."""
    gap_limit: Annotated[int | str, arg(metavar="N|SECONDSs")] = "0"
    """Longest gap of frames without a pose that is filled: frames, 12, or seconds, 0.2s."""
    gap_method: setting_types.GapMethod = "linear"
    """How gaps are filled: straight (rotations by slerp), by a monotone cubic, or not."""
    background: setting_types.BackgroundKind = "auto"
    """Background of cameras without an empty view: a uniform backdrop where there is one (auto),
    one known to be uniform, or what is seen while the person moves. paper: as auto, silhouettes as
    in Okada and Stenger 5.1, which --method paper has anyway."""
    threads: arguments.Threads = None
    estimator: Annotated[str | None, arg(metavar="NAME")] = "multiview"
    """Estimator to run; `voxelpose doctor` lists those that are installed."""
    pictures: bool = True
    """Draw the overlay videos and the contact sheet."""
    verbose: bool = False
    """Print the durations of the stages and the ranges of the quality, too."""
    sources: Suppress[Mapping[str, str]] = field(default_factory=dict)
    """Files that options were taken from, by their names; see `folder_settings`."""
    listed: Suppress[bool] = False
    """Whether it is a batch that tells them, for messages."""

    @abstractmethod
    def filmed(self) -> tuple[Path, Sequence[str] | None]:
        """Folder of the recording and the cameras that are used, None: all. InputError where there
        are none, or one is to be chosen.
        """

    @property
    def chosen_estimator(self) -> str:
        """Name of the estimator that runs."""
        return self.estimator or "multiview"

    def people_wanted(self) -> int | None:
        """Number of people; None: as many as are seen. InputError where it is none."""
        from voxelpose.multiview.people import number_of_people

        setting = self.setting_text("people")
        return number_of_people(str(self.people), setting, auto=self.people_seen)

    def check(self) -> None:
        """Refuses, by an InputError, what cannot be done, before anything is begun."""
        self.people_wanted()
        self.filmed()

    def run(self) -> None:
        """Estimates the motion, writes the result, prints a summary."""
        self.check()
        with Progress(SHARES.get(self.chosen_estimator)) as progress:
            progress.note_compilation(self.chosen_estimator)
            results = self.estimate(progress)
        from voxelpose.cli.summary import print_people, print_result

        if len(results) > 1:
            print_people(self.out, results)
        else:
            print_result(results[0], self.verbose)

    def estimate(self, reporter: Reporter) -> list[Result]:
        """Estimates the motion and writes the result; returns one for each person."""
        reporter.stage("opening")
        from voxelpose.fitting import Output, fit_people

        people, settings, recording = self.people_wanted(), self.settings(), self.open()
        if recording.calibration_path is None:
            reporter.note(
                f"{recording.folder} holds no calibration: a level camera with a field of view of"
                " 53 degrees is assumed, and distances are only rough"
            )
        output = Output(self.out, self.overwrite, self.pictures, self.sources)
        return fit_people(recording, output, settings, self.chosen_estimator, reporter, people)

    def settings(self) -> Settings:
        """Settings of the estimator; InputError where a value makes no sense."""
        from silhouette_core.estimator import Settings
        from silhouette_core.motion.body_source import resolved_body
        from silhouette_core.motion.conditioning import Conditioning

        body = {} if self.body is None else {"body": resolved_body(self.body)}
        return Settings(
            stature_m=self.stature,
            chest_m=self.chest,
            sex=self.sex,
            background=self.background,
            network=self.network,
            smooth=self.smooth,
            up=arguments.up_direction(self.up, self.setting_text("up", "=")),
            threads=self.threads,
            backend=self.backend,
            conditioning=Conditioning(
                self.filter, self.cutoff, self.filter_order, self.gap_limit, self.gap_method
            ),
            options=arguments.unusual(self, self.estimator_options) | body,
        )

    def open(self) -> Recording:
        """The recording; InputError where it cannot be used, or a setting is not understood."""
        from voxelpose.recording.folder import Recording

        folder, cameras = self.filmed()
        limits = self.frame_limits()
        return Recording.open(folder, limits, cameras, self.unit, self.fps, self.label)

    def frame_limits(self) -> tuple[int | None, int | None] | None:
        """First frame and one past the last, None where there is no limit. InputError where the
        setting is not understood.
        """
        from voxelpose.recording.folder import frame_range

        return frame_range(self.frames, self.setting_text("frames"))

    def setting_text(self, name: str, between: str = " ") -> str:
        """How a setting is told, with {} for its value."""
        return f'{name} = "{{}}"' if self.listed else f"--{name}{between}{{}}"


@dataclass(frozen=True, kw_only=True)
class Fit(EstimationArguments):
    """Estimates the motion of a person, or of several, from several cameras.

    RECORDING holds a video per camera, calibration.toml and, if possible, background/ with videos
    or images of the empty view. OUT receives joints.csv, motion.bvh, motion.safetensors,
    summary.json, overlay videos and contact_sheet.png. Of several people OUT/person_1 and so on
    receive them, and OUT joints.csv and pictures of all.

      voxelpose fit walk --out walk_fit --stature 1.75
      voxelpose fit walk --out walk_fit --frames 0:100 --overwrite
      voxelpose fit walk --out walk_fit --filter savgol --cutoff 10 --gap-limit 0.2s
      voxelpose fit run --out run_fit --body walk_fit
      voxelpose fit run --out run_fit --body 92A5
      voxelpose fit dance --out dance_fit --people 2
      voxelpose fit dance --out dance_fit --persons "Anna 1.68 female, Ben 1.82 male"
    """

    estimator_options: ClassVar = {
        "interference": "interference",
        "tolerance": "tolerance",
        "repair": "repair",
        "voxel_size_m": "voxel",
    }
    cameras: arguments.Cameras = None
    persons: Annotated[str | None, arguments.optional("TEXT")] = None
    """What is known of several people, in the order of their numbers: name, stature in metres, sex,
    as in "Anna 1.68 female, Ben 1.82". A first fit shows who has which number."""
    interference: bool = True
    """Match body parts jointly where their movable areas overlap; else one after the other."""
    voxel: Annotated[setting_types.VoxelSize | None, arguments.optional("M")] = None
    """Edge of a voxel in metres. Default: chosen by the program."""
    tolerance: Annotated[setting_types.Tolerance, arg(metavar="N")] = 0
    """Number of cameras that may see background where the body is; 1 tolerates one bad camera."""
    repair: setting_types.Repair = "auto"
    """Cameras that were turned or come late, by the silhouettes: put right where that is sure, only
    say so, or do not look."""

    def settings(self) -> Settings:
        """See `EstimationArguments.settings`."""
        from voxelpose.multiview.people import people_told

        people = people_told(self.persons or "", self.setting_text("persons"))
        return replace(super().settings(), people=people)

    def filmed(self) -> tuple[Path, Sequence[str] | None]:
        """See `EstimationArguments.filmed`."""
        return self.recording, arguments.camera_names(self.cameras)
