"""Recording in the studio: its cameras, and what is recorded of them into a project."""

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, Literal

from msgspec import Meta, Struct

from calib.camera import Camera
from calib.errors import InputError
from calib.files import read_rig
from calib.storage.documents import visible_entries
from voxelpose.cli.options import folder_settings
from voxelpose.live.camera_source import CameraSource, list_webcams
from voxelpose.recording.camera_files import SUBFOLDERS, pictures_by_camera
from voxelpose.recording.folder import calibration_path
from voxelpose.recording.frame_reader import VIDEOS
from voxelpose.recording.subject import SETTINGS_FILE
from voxelpose.setup_page.drawn_places import change_section
from voxelpose.studio.calibration_step import LENSES
from voxelpose.studio.command_forms import board_in
from voxelpose.studio.projects import StudioFolder, check_plain_name
from voxelpose.studio.recording_job import RecordingPlan, record
from voxelpose.view.serving.page_answers import Name
from voxelpose.view.serving.page_job import PageJob

RECORDING = "recording"
"""Kind of the job."""
_TARGETS = {"take": "", "boards": "boards", "board_walk": "board_walk"}
# Least time between moments, ms: of the board, which is held still, and carried.
_EVERY_MS = {"take": 0, "boards": 700, "board_walk": 200}
_MOST_VIDEOS = 300
_LAST_WEBCAM = 99
_NO_TEXT = re.compile(r"[\x00-\x20\x7f]")
JobWord = Literal["record", "finish", "background", "start", "stop", "end recording"]
"""What may be asked of the job that is running."""
_Seconds = Annotated[float, Meta(ge=0, le=3600)]


class SourceNamed(Struct, forbid_unknown_fields=True):
    """A camera: number of a webcam, address of a stream, or a video of the studio's folder."""

    name: Name
    address: Annotated[str, Meta(min_length=1, max_length=1000)]


class RecordAsked(Struct, forbid_unknown_fields=True, tag=True):
    """Cameras that are to be opened, and what is recorded when they have been looked at."""

    project: Name
    sources: Annotated[list[SourceNamed], Meta(min_length=1, max_length=64)]
    what: Literal["take", "boards", "board_walk"] = "take"
    replace: bool = False
    loop: bool = True
    countdown: _Seconds = 5.0
    empty: _Seconds = 2.0
    length: Annotated[float, Meta(gt=0, le=36_000)] | None = None


class RecordStep:
    """What the step shows of a project, and has done."""

    def __init__(self, folder: StudioFolder, job: PageJob) -> None:
        self._folder, self._job = folder, job

    def state(self, project: str) -> dict[str, Any]:
        """Webcams, videos that may stand for cameras, the cameras of the last time, and what is
        recorded already. InputError where there is no such project.
        """
        folder = self._folder.project(project)
        texts, _ = folder_settings("live", folder).get("source", ((), ""))
        sources = list(self._known_sources(texts))
        return {
            "webcams": [
                {"number": number, "name": what} for number, what in list_webcams().items()
            ],
            "videos": list(self._videos()),
            "sources": [
                {"name": source.name, "address": self._address_text(source)} for source in sources
            ],
            "cameras": [camera.name for camera in _calibrated(folder)],
            "board": board_in(folder) is not None,
            "there": {
                what: list(pictures_by_camera(folder / inside)) for what, inside in _TARGETS.items()
            },
        }

    def start(self, asked: RecordAsked) -> None:
        """Opens the cameras, which are kept in the project's settings. InputError where another job
        is running, an address is none, or it is recorded already.
        """
        project = self._folder.project(asked.project)
        sources = self.sources(asked.sources)
        target = project / _TARGETS[asked.what]
        recorded = pictures_by_camera(target)
        if recorded and not asked.replace:
            raise InputError(
                f"{', '.join(recorded)} {'is' if len(recorded) == 1 else 'are'} there already: make"
                " a new project for another take, or replace what is there"
            )
        target.mkdir(exist_ok=True)
        is_take = asked.what == "take"
        plan = RecordingPlan(
            target,
            sources,
            {camera.name: camera.size for camera in _calibrated(project)},
            asked.loop,
            asked.countdown,
            asked.empty if is_take else 0.0,
            asked.length,
            _EVERY_MS[asked.what] / 1000,
            None if is_take else board_in(project),
        )
        self._job.start(RECORDING, asked.project, record, plan, step="record", asked=asked)
        self.keep(project, sources, asked.loop)

    def sources(self, named: list[SourceNamed]) -> tuple[CameraSource, ...]:
        """Cameras by name and address. InputError where one has none, or a file outside of the
        studio's folder.
        """
        for source in named:
            check_plain_name(source.name)
            if source.name.casefold() in SUBFOLDERS or "=" in source.name:
                raise InputError(f"no camera can be called {source.name}: rename it")
        if len({source.name.casefold() for source in named}) < len(named):
            raise InputError("two cameras have one name: give every camera its own")
        sources = tuple(CameraSource(source.name, self._address(source)) for source in named)
        if len({source.address for source in sources}) < len(sources):
            raise InputError("two cameras have one address: give every camera its own")
        return sources

    def keep(self, project: Path, sources: tuple[CameraSource, ...], loop: bool) -> None:
        """Keeps cameras for the next time, and for the command `live`."""
        listed = [f"{source.name}={self._address_text(source, project)}" for source in sources]
        change_section(project / SETTINGS_FILE, "live", {"source": listed, "loop": loop})

    def _address(self, named: SourceNamed) -> str:
        address = named.address.strip()
        kind = CameraSource(named.name, address).kind
        if kind == "webcam":
            if len(address) > 2 or int(address) > _LAST_WEBCAM:
                raise InputError(f"{named.name}: webcams have numbers from 0 to {_LAST_WEBCAM}")
            return address
        if kind == "stream":
            if _NO_TEXT.search(address):
                raise InputError(f"{named.name}: an address has no spaces: correct it")
            return address
        path = self._folder.root / address
        if not self._folder.holds(path) or not path.is_file():
            raise InputError(
                f"{named.name}: {address[:80]!r} is neither the number of a webcam, nor an address"
                " such as rtsp://…, nor a video in the studio's folder"
            )
        if path.suffix.lower() not in VIDEOS:
            raise InputError(f"{named.name}: {path.name} is no video: choose another")
        return str(path)

    def _address_text(self, source: CameraSource, base: Path | None = None) -> str:
        """An address as it is typed: videos relative to a folder, of the studio unless another."""
        if source.kind != "file":
            return source.address
        path = os.path.relpath(Path(source.address).resolve(), base or self._folder.root)
        return Path(path).as_posix()

    def _known_sources(self, texts: Sequence[str]) -> Iterator[CameraSource]:
        """Cameras that settings name, but for videos that are gone, or lie elsewhere."""
        for text in texts:
            with suppress(InputError):
                source = CameraSource.parse(text)
                if source.kind != "file" or self._folder.holds(Path(source.address)):
                    yield source

    def _videos(self) -> Iterator[str]:
        """Videos of the studio's folder and of the folders in it."""
        count = 0
        root, holds = self._folder.root, self._folder.holds
        for folder in filter(holds, (root, *visible_entries(root))):
            for path in filter(holds, visible_entries(folder)):
                if path.suffix.lower() in VIDEOS and path.is_file() and count < _MOST_VIDEOS:
                    count += 1
                    yield path.relative_to(root).as_posix()


def _calibrated(project: Path) -> tuple[Camera, ...]:
    """Cameras whose pictures have a known size."""
    known = project / LENSES if (project / LENSES).is_file() else calibration_path(project)
    try:
        return () if known is None else read_rig(known, lenses=True).cameras
    except InputError:  # other steps say so
        return ()
