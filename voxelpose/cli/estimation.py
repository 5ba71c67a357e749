"""What `voxelpose fit` and `voxelpose track` share: arguments, and the estimation itself."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Suppress, arg

from voxelpose.cli.arguments import (
    BodyName,
    Cutoff,
    Filter,
    FilterOrder,
    Fps,
    Frames,
    GapLimit,
    GapMethod,
    OptionalLength,
    OverwriteResult,
    RecordingFolder,
    Sex,
    Threads,
    Unit,
    Up,
    up_direction,
)


@dataclass(frozen=True, kw_only=True)
class EstimationArguments:
    """Arguments of `voxelpose fit` and `voxelpose track` alike."""

    recording: RecordingFolder
    out: Annotated[Path, arg(metavar="OUT")]
    """Folder to be made for the results."""
    stature: OptionalLength = None
    """Height in metres. Default: from subject.toml, else estimated (fit) or 1.70 (track)."""
    chest: OptionalLength = None
    """Chest girth in metres. Default: from subject.toml, else average for the stature."""
    body: BodyName = None
    sex: Sex = "unknown"
    frames: Frames = None
    unit: Unit = None
    fps: Fps = None
    up: Up = None
    overwrite: OverwriteResult = False
    smooth: bool = True
    """Filter the motion over time; with track, --no-smooth uses previous frames only."""
    filter: Filter = "butterworth"
    cutoff: Cutoff = 7.0
    filter_order: FilterOrder = None
    gap_limit: GapLimit = "0"
    gap_method: GapMethod = "linear"
    background: Annotated[
        Literal["auto", "uniform", "moving", "refined", "paper"], arg(metavar="KIND")
    ] = "auto"
    """Where a camera without an empty view has its background from: a uniform backdrop where there
    is one (auto), a backdrop known to be uniform, or the person's movement (moving). paper: as
    auto, silhouettes as in Okada and Stenger 5.1; refined: as auto."""
    segmenter: Annotated[str | None, arg(metavar="FILE", help_behavior_hint="")] = None
    """Network that tells where people are, .onnx or .tflite, or a registered name; for cameras
    without an empty view. Default: none."""
    backend: Annotated[str, arg(metavar="NAME")] = "cpu"
    """Implementation of pose scoring; `voxelpose doctor` lists those that are installed."""
    threads: Threads = None
    pictures: bool = True
    """Draw the overlay videos and the contact sheet."""
    sources: Suppress[Mapping[str, str]] = field(default_factory=dict)
    """Files that options were taken from, by their names; see `folder_settings`."""

    def estimate(
        self,
        cameras: tuple[str, ...] | None,
        options: Mapping[str, bool | int | float | str],
        estimator: str,
    ) -> int:
        """Estimates the motion, writes the result and prints a summary; returns the exit code.

        Args:
            cameras: names of the cameras to use; None for all.
            options: settings of the estimator alone.
            estimator: name under which the estimator is registered.
        """
        from voxelpose.cli.progress import Progress

        with Progress() as progress:
            progress.note_compilation()
            progress.stage("opening")
            from silhouette_core.estimator import Settings
            from silhouette_core.image.segmenter import resolved_segmenter
            from silhouette_core.motion.body_source import resolved_body
            from silhouette_core.motion.conditioning import Conditioning
            from voxelpose.fitting import Output, fit
            from voxelpose.recording.folder import Recording, frame_range

            settings = Settings(
                stature_m=self.stature,
                chest_m=self.chest,
                sex=self.sex,
                background=self.background,
                segmenter=self.segmenter and resolved_segmenter(self.segmenter),
                smooth=self.smooth,
                up=up_direction(self.up),
                threads=self.threads,
                backend=self.backend,
                conditioning=Conditioning(
                    self.filter, self.cutoff, self.filter_order, self.gap_limit, self.gap_method
                ),
                options=dict(options)
                | ({} if self.body is None else {"body": resolved_body(self.body)}),
            )
            frames = frame_range(self.frames)
            recording = Recording.open(self.recording, frames, cameras, self.unit, self.fps)
            if recording.calibration_path is None:
                progress.note(
                    f"{self.recording} holds no calibration: a level camera with a field of view of"
                    " 53 degrees is assumed, and distances are only rough"
                )
            output = Output(self.out, self.overwrite, self.pictures, self.sources)
            result = fit(recording, output, settings, estimator, progress)
        from voxelpose.cli.summary import print_result

        print_result(result)
        return 0
