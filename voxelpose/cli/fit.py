"""voxelpose fit, and what `voxelpose track` shares with it: arguments and the estimation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from tyro.conf import Suppress, arg

from voxelpose.cli import arguments
from voxelpose.cli.terminal import Progress

if TYPE_CHECKING:
    from silhouette_core.progress import Reporter
    from voxelpose.results import Result

SHARES = {  # a hundred seconds of the recording of `voxelpose demo`, 2026-11, with pictures
    "multiview": {
        "opening": 2,
        "background": 8,
        "silhouettes": 17,
        "completion": 10,
        "people": 1,
        "hulls": 2,
        "first poses": 25,
        "tracking": 7,
        "limbs": 3,
        "proportions": 3,
        "refinement": 9,
        "quality": 5,
        "files": 1,
        "pictures": 8,
    },
    "monocular": {
        "opening": 2,
        "background": 7,
        "motion model": 2,
        "tracking": 18,
        "last frames": 67,
        "files": 1,
        "pictures": 3,
    },
    "tree": {
        "opening": 2,
        "background": 3,
        "pose library": 2,
        "taking pictures": 25,
        "tree, level 1": 15,
        "tree, level 2": 4,
        "tree, level 3": 6,
        "motion model": 6,
        "tracking": 30,
        "pictures": 7,
    },
}


@dataclass(frozen=True)
class Asked:
    """What an estimation command is asked for."""

    recording: Path
    cameras: tuple[str, ...] | None
    options: Mapping[str, bool | int | float | str]  # of the estimator
    estimator: str
    people: int | None = 1  # None: as many as are seen


@dataclass(frozen=True, kw_only=True)
class EstimationArguments(ABC):
    """Arguments of `voxelpose fit` and `voxelpose track` alike."""

    groups: ClassVar = arguments.GROUPS
    recording: arguments.RecordingFolder
    out: Annotated[Path, arg(metavar="OUT")]
    """Folder to be made for the results."""
    stature: arguments.OptionalLength = None
    """Height in metres. Default: from subject.toml, else estimated (fit) or 1.70 (track)."""
    chest: arguments.OptionalLength = None
    """Chest girth in metres. Default: from subject.toml, else average for the stature."""
    body: arguments.BodyName = None
    sex: arguments.Sex = "unknown"
    frames: arguments.Frames = None
    unit: arguments.Unit = None
    fps: arguments.Fps = None
    label: arguments.Label = None
    up: arguments.Up = None
    overwrite: arguments.OverwriteResult = False
    smooth: bool = True
    """Filter the motion over time; with track, --no-smooth uses previous frames only."""
    filter: arguments.Filter = "auto"
    cutoff: arguments.Cutoff = 7.0
    filter_order: arguments.FilterOrder = None
    gap_limit: arguments.GapLimit = "0"
    gap_method: arguments.GapMethod = "linear"
    background: Literal["auto", "uniform", "moving", "paper"] = "auto"
    """Background of cameras without an empty view: a uniform backdrop where there is one (auto),
    one known to be uniform, or what is seen while the person moves. paper: as auto, silhouettes as
    in Okada and Stenger 5.1, which --method paper has anyway."""
    network: arguments.Network = "auto"
    backend: Annotated[str, arg(metavar="NAME")] = "cpu"
    """Implementation of pose scoring; `voxelpose doctor` lists those that are installed."""
    threads: arguments.Threads = None
    pictures: bool = True
    """Draw the overlay videos and the contact sheet."""
    verbose: bool = False
    """Print the durations of the stages and the ranges of the quality, too."""
    sources: Suppress[Mapping[str, str]] = field(default_factory=dict)
    """Files that options were taken from, by their names; see `folder_settings`."""

    @abstractmethod
    def asked(self) -> Asked:
        """What is to be estimated, of the command's own options. InputError where they contradict
        each other.
        """

    def run(self) -> None:
        """Estimates the motion, writes the result, prints a summary."""
        asked = self.asked()
        with Progress(SHARES.get(asked.estimator)) as progress:
            progress.note_compilation(asked.estimator)
            results = self.estimate(progress, asked)
        from voxelpose.cli.summary import print_people, print_result

        if len(results) > 1:
            print_people(self.out, results)
        else:
            print_result(results[0], self.verbose)

    def estimate(self, reporter: Reporter, asked: Asked) -> list[Result]:
        """Estimates the motion and writes the result; returns one for each person."""
        reporter.stage("opening")
        from silhouette_core.estimator import Settings
        from silhouette_core.motion.body_source import resolved_body
        from silhouette_core.motion.conditioning import Conditioning
        from voxelpose.fitting import Output, fit_people
        from voxelpose.recording.folder import Recording, frame_range

        settings = Settings(
            stature_m=self.stature,
            chest_m=self.chest,
            sex=self.sex,
            background=self.background,
            network=self.network,
            smooth=self.smooth,
            up=arguments.up_direction(self.up),
            threads=self.threads,
            backend=self.backend,
            conditioning=Conditioning(
                self.filter, self.cutoff, self.filter_order, self.gap_limit, self.gap_method
            ),
            options=dict(asked.options)
            | ({} if self.body is None else {"body": resolved_body(self.body)}),
        )
        folder, frames = asked.recording, frame_range(self.frames)
        recording = Recording.open(folder, frames, asked.cameras, self.unit, self.fps, self.label)
        if recording.calibration_path is None:
            reporter.note(
                f"{folder} holds no calibration: a level camera with a field of view of 53 degrees"
                " is assumed, and distances are only rough"
            )
        output = Output(self.out, self.overwrite, self.pictures, self.sources)
        return fit_people(recording, output, settings, asked.estimator, reporter, asked.people)


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
    """

    people: arguments.People = "auto"
    cameras: arguments.Cameras = None
    interference: bool = True
    """Match body parts jointly where their movable areas overlap; else one after the other."""
    voxel: arguments.OptionalLength = None
    """Edge of a voxel in metres. Default: chosen by the program."""
    tolerance: Annotated[int, arg(metavar="N")] = 0
    """Number of cameras that may see background where the body is; 1 tolerates one bad camera."""
    repair: Literal["auto", "say", "off"] = "auto"
    """Cameras that were turned or come late, by the silhouettes: put right where that is sure, only
    say so, or do not look."""
    estimator: Annotated[str, arg(metavar="NAME")] = "multiview"
    """Estimator to run; `voxelpose doctor` lists those that are installed."""

    def asked(self) -> Asked:
        """See `EstimationArguments.asked`."""
        from voxelpose.multiview.people import number_of_people

        options = arguments.unusual(
            self, "interference", "tolerance", "repair", voxel_size_m="voxel"
        )
        cameras, people = arguments.camera_names(self.cameras), number_of_people(self.people)
        return Asked(self.recording, cameras, options, self.estimator, people)
