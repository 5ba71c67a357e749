"""From a folder and the addresses of cameras to the settings of a session."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np

from calib.camera import Rig
from calib.errors import InputError
from calib.upright import axis_name
from silhouette_core.estimator import Settings, read_options
from silhouette_core.monocular.monocular_stages import MonocularOptions
from silhouette_core.monocular.tree_estimator import TreeOptions
from silhouette_core.progress import Reporter
from silhouette_core.scoring.backend import load_backend
from voxelpose.live.camera_source import CameraSource
from voxelpose.live.live_estimators import LiveEstimator, LiveMonocular, LiveMultiView, LiveTree
from voxelpose.live.session import SessionSettings
from voxelpose.multiview.people import require_cameras
from voxelpose.recording.folder import Recording, default_camera
from voxelpose.recording.subject import Subject

_BACKGROUND_FRAMES = 60
_USUAL_SIZE = (640, 480)  # of a webcam without a calibration
_USUAL_FPS = 30


@dataclass(frozen=True)
class LiveInput:
    """What a session works on, opened; its recording has no frames if these come from cameras."""

    recording: Recording
    sources: dict[str, CameraSource]
    fps: float

    def upright(self, up: tuple[float, float, float] | None, reporter: Reporter) -> "LiveInput":
        """The same cameras in a world with z up, in which a session works and sends; the reporter
        is told if `up`, a direction in the calibration's world, is not z. None: as that states,
        else as the cameras stand.
        """
        frame = self.recording.upright_frame(up)
        if not frame.is_world:
            reporter.note(
                f"up is {axis_name(frame.up)} of the calibration's world (--up z keeps z); the"
                " session works and sends in a world with z up"
            )
        rig = frame.rig(self.recording.rig)
        return replace(self, recording=replace(self.recording, rig=rig, up=None))

    def settings(self, subject: Subject) -> SessionSettings:
        """Settings of a session; the empty view is read from background/."""
        recording = self.recording
        calibrated = recording.calibration_path is not None
        readers = recording.backgrounds() if calibrated or recording.readers else {}
        empty = {
            name: [picture.copy() for picture in islice(reader, _BACKGROUND_FRAMES)]
            for name, reader in readers.items()
        }
        return SessionSettings(
            recording.rig,
            self.sources,
            empty,
            recording.regions() if calibrated or recording.readers else {},
            recording.silhouettes_given,
            subject,
            self.fps if recording.readers else None,
        )


def open_input(
    folder: Path | None,
    sources: Sequence[CameraSource],
    cameras: Sequence[str] | None,
    unit: str | None = None,
    fps: float | None = None,
    label: str | None = None,
) -> LiveInput:
    """Opens the cameras' calibration, and the videos that stand in for cameras; InputError where
    something is missing, or does not fit.

    Args:
        folder: a recording folder, whose videos are played if there are no sources; None: a single
            source without calibration.
        cameras: names of the cameras to use; None: all.
        unit: of the calibration's lengths, where its file does not state it.
        fps: rate of the cameras; None: as the files state, or 30.
        label: of the person in masks/; None: found.
    """
    if not sources:
        if folder is None:
            raise InputError("no cameras: give a recording folder, or --source NUMBER of a webcam")
        recording = Recording.open(folder, None, cameras, unit, fps, label)
        played = {
            name: CameraSource(name, str(reader.path), reader)
            for name, reader in recording.readers.items()
        }
        return LiveInput(recording, played, recording.fps)
    named = _sources_by_camera(sources, folder, unit)
    if cameras is not None:
        named = {name: source for name, source in named.items() if name in cameras}
    if folder is None:
        name = next(iter(named))
        rig = Rig((default_camera(name, _USUAL_SIZE),))
        nothing = Path()  # a folder without background and regions is not looked for
        recording = Recording(nothing, None, rig, {}, 0, 0, 1.0, np.zeros(0), Subject())
    else:
        recording = Recording.without_frames(folder, list(named), unit)
    return LiveInput(recording, named, fps or _USUAL_FPS)


def make_estimator(
    live: LiveInput,
    settings: Settings,
    reporter: Reporter,
    method: str = "monocular",
    people: int = 1,
) -> LiveEstimator:
    """Estimator for one camera or for several, with what is known about the person, and options of
    the estimator of one camera, `monocular` or `tree`; InputError where these or the library cannot
    be used, or where the cameras do not tell so many people apart.
    """
    recording = live.recording
    require_cameras(people, len(recording.rig))
    load_backend(settings.backend)  # refuses an unknown name before a process is begun
    if len(recording.rig) > 1:
        return LiveMultiView(recording.rig, settings, people)
    if method == "tree":
        chosen = read_options(TreeOptions, settings.options, method)
        return LiveTree(recording.rig.cameras[0], settings, chosen, live.fps, reporter)
    options = read_options(MonocularOptions, settings.options, "monocular")
    coloured = not recording.silhouettes_given
    return LiveMonocular(recording.rig.cameras[0], settings, options, coloured, reporter)


def _sources_by_camera(
    sources: Sequence[CameraSource], folder: Path | None, unit: str | None
) -> dict[str, CameraSource]:
    """Sources by camera name; a single one may be without."""
    if len(sources) == 1 and not sources[0].name:
        name = "camera"
        if folder is not None:
            names = list(Recording.without_frames(folder, unit=unit).rig.names)
            if len(names) > 1:
                raise InputError(
                    f"--source {sources[0].address} could be any of {', '.join(names)}: write"
                    f" {names[0]}={sources[0].address}"
                )
            name = names[0]
        return {name: CameraSource(name, sources[0].address)}
    for source in sources:
        if not source.name:
            raise InputError(
                f"--source {source.address} belongs to no camera: write NAME={source.address}, with"
                " the name in the calibration"
            )
    if folder is None:
        raise InputError(
            "several cameras need their calibration: give the folder that holds calibration.toml"
        )
    named = {source.name: source for source in sources}
    if len(named) < len(sources):
        raise InputError("two sources have one name: give every camera its own")
    return named
