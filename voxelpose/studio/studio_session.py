"""What the studio's page shows of its folder, and what it has done there."""

import threading
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import msgspec
import numpy as np
from msgspec import Meta, Struct

from calib.errors import InputError
from calib.storage.atomic import write_whole
from calib.storage.documents import visible_entries
from voxelpose.cli.correct import Correct
from voxelpose.cli.fit import SHARES
from voxelpose.cli.options import FolderSetting, folder_settings
from voxelpose.recording.folder import Recording, calibration_path
from voxelpose.recording.subject import SETTINGS_FILE
from voxelpose.report.page import sheet_image
from voxelpose.results import people_folders
from voxelpose.setup_page.drawn_places import change_section
from voxelpose.setup_page.opened_folder import OpenedFolder
from voxelpose.setup_page.page_requests import Typed
from voxelpose.setup_page.setup_session import SetupSession
from voxelpose.studio.calibration_step import CalibrationAsked, CalibrationStep
from voxelpose.studio.command_forms import errors_at_fields, export_formats, filled_in, form_of
from voxelpose.studio.file_places import Chosen, takes_among
from voxelpose.studio.live_step import LiveAsked, LiveStep
from voxelpose.studio.project_changes import ProjectChanges
from voxelpose.studio.projects import StudioFolder, check_plain_name
from voxelpose.studio.record_step import JobWord, RecordAsked, RecordStep
from voxelpose.studio.studio_jobs import JobsFile, correct_result, demo, estimate, export
from voxelpose.studio.uploads import (
    check_size,
    conflicts_of,
    picture_of,
    present_at,
    project_files,
    remove_file,
)
from voxelpose.view.images.canvas import encoded
from voxelpose.view.serving.page_answers import Name, not_understood
from voxelpose.view.serving.page_job import PageJob
from voxelpose.view.viewer.browser import Browser
from voxelpose.view.viewer.result_scenes import ResultScenes

Command = Literal["fit", "track"]
_MOST_VIEWERS = 4
_DEMO = "demo_recording"  # the name of its project
Bytes = Annotated[int, Meta(ge=0, le=2**50)]
_MOST_FILES = 200_000


class FilesChosen(Struct, forbid_unknown_fields=True):
    """Files that somebody would like to send: path in the folder that was chosen, bytes, and time
    of modification, s since 1970.
    """

    files: Annotated[
        list[tuple[Annotated[str, Meta(max_length=1000)], Bytes, float]],
        Meta(min_length=1, max_length=_MOST_FILES),
    ]
    project: Annotated[str, Meta(max_length=200)] = ""  # "": a new one
    chosen: Chosen = ""
    camera: Annotated[str, Meta(max_length=200)] = ""  # of pictures without a folder


class FileSent(Struct, forbid_unknown_fields=True):
    """A file that is sent, and where it belongs in its project."""

    project: Name
    path: Name
    bytes: Bytes
    replace: Literal["", "1"] = ""


class FitAsked(Struct, forbid_unknown_fields=True, tag=True):
    """An estimation, with the settings that are typed in; None: the usual value."""

    project: Name
    command: Command
    out: Annotated[str, Meta(max_length=200)] = ""  # "": a name that is free
    overwrite: bool = False
    settings: Typed = {}


class DemoAsked(Struct, forbid_unknown_fields=True, tag=True):
    """The program's own recording, and its estimation."""


class ExportAsked(Struct, forbid_unknown_fields=True, tag=True):
    """An export of a result."""

    result: Name
    formats: Annotated[list[Name], Meta(max_length=20)]
    report: bool = False
    pictures: bool = False
    person: str = ""
    settings: Typed = {}


class CorrectAsked(Struct, forbid_unknown_fields=True, tag=True):
    """A correction of a result that takes long, by options of `voxelpose correct`."""

    result: Name
    fit_again: str | None = None
    without: str | None = None
    set_joints: str | None = None


_AnyAsked = (
    FitAsked | DemoAsked | ExportAsked | CorrectAsked | CalibrationAsked | RecordAsked | LiveAsked
)


class OpenedViewers:
    """The viewers of the results that were asked for last."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._browsers: dict[str, Browser] = {}  # by name, the latest last

    def open(self, name: str, folder: Path, begin: Callable[[dict[str, str]], None]) -> None:
        """Opens a result, if it is not open already, and closes the oldest of many; `begin` begins
        a correction that takes long.
        """
        with self._lock:
            if name in self._browsers:
                self._browsers[name] = self._browsers.pop(name)
                return
            if len(self._browsers) == _MOST_VIEWERS:
                self._browsers.pop(next(iter(self._browsers))).close()
            scenes = ResultScenes(folder)
            frames = [*scenes.time_s] or scenes.frames.tolist()
            try:
                middle = frames[len(frames) // 2]
                self._browsers[name] = Browser(scenes, None, middle, begin=begin)
            except BaseException:
                scenes.close()
                raise

    def browser(self, name: str) -> Browser:
        """The viewer of a result. InputError where it is not open any more."""
        browser = self._browsers.get(name)
        if browser is None:
            raise InputError("this viewer was closed: load this page again")
        return browser

    def close(self) -> None:
        """Closes what is open."""
        with self._lock:
            while self._browsers:
                self._browsers.popitem()[1].close()


class StudioSession:
    """The studio's folder, its jobs, its viewers, and the set-up of one project."""

    def __init__(self, folder: StudioFolder) -> None:
        """InputError where the file of interrupted jobs is damaged."""
        self.folder, self.viewers, self._jobs_file = folder, OpenedViewers(), JobsFile(folder.root)
        self.job = PageJob(self._jobs_file.read(), self._jobs_file.write)
        self.changes = ProjectChanges(folder)
        self.calibration = CalibrationStep(folder, self.job)
        self.recording = RecordStep(folder, self.job)
        self.live = LiveStep(folder, self.job, self.recording)
        self._lock = threading.Lock()
        self._setup: tuple[str, SetupSession] | None = None

    def close(self) -> None:
        """Ends what is running."""
        self.job.close()
        self._jobs_file.close()
        self.viewers.close()
        if self._setup is not None:
            self._setup[1].close()

    def state(self) -> dict[str, Any]:
        """Projects, results, and what was deleted."""
        return {
            "folder": str(self.folder.root),
            "projects": self.folder.projects(),
            "results": self.folder.results(),
            "bin": self.changes.bin(),
            "formats": export_formats(),
            "export": form_of("export", self.folder.root),
        }

    def project(self, project: str) -> dict[str, Any]:
        """Files of a project, and what the program's own reader says about them."""
        folder = self.folder.project(project)
        files = project_files(folder)
        known: dict[str, Any] = {"name": project, "files": files}
        try:
            values = folder_settings("fit", folder)
            unstated = _unstated(values)
            recording, fault = OpenedFolder.open(folder, **unstated).recording, ""
            names = list(recording.rig.names)
            chosen = str(values.get("cameras", ("", ""))[0])
            cameras = [word.strip() for word in chosen.split(",") if word.strip()]
            if len(names) == 1:  # which needs no calibration
                cameras = names
            try:
                recording = Recording.open(folder, cameras=cameras or None, **unstated)
            except InputError as error:
                fault = str(error)
        except InputError as error:
            return known | {"fault": str(error), "cameras": [], "command": None}
        empty = {Path(file["name"]).stem for file in files if file["place"] == "background"}
        return known | {
            "fault": fault,
            "cameras": [{"name": name, "empty": name in empty} for name in recording.rig.names],
            "frames": recording.frame_count,
            "fps": recording.fps,
            "notes": list(recording.notes),
            "command": "fit" if len(names) > 1 else "track",
            "outs": {command: self._free_out(project, command) for command in get_args(Command)},
        }

    def plan(self, asked: FilesChosen) -> dict[str, Any]:
        """Where files belong: `takes`, each with its `project`, whether that is `new`, its `files`
        (number, path in the project, whether that replaces another) and `conflicts`; and lines on
        what belongs nowhere. InputError where that cannot be taken now.
        """
        if asked.project:
            self.folder.project(asked.project)
            self._check_idle(asked.project)
        takes, lines = takes_among([path for path, *_ in asked.files], asked.chosen, asked.camera)
        plans, taken = [], {path.name.casefold() for path in self.folder.root.iterdir()}
        for take in takes:
            name, coming = asked.project, 0
            if is_new := not name or (len(takes) > 1 and take.name != ""):
                name = _free_name(take.name or "recording", taken)
                taken.add(name.casefold())
            for path, number in [*take.files.items()]:
                try:
                    check_size(self.folder.root, path, asked.files[number][1], coming)
                    coming += asked.files[number][1]
                except InputError as error:
                    lines.append(str(error))
                    del take.files[path]
            conflicts, replaced = conflicts_of(self.folder.root / name, take, asked.files)
            files = [(number, path, path in replaced) for path, number in take.files.items()]
            plans.append({"project": name, "new": is_new, "files": files, "conflicts": conflicts})
        return {"takes": plans, "refused": lines}

    def target(self, asked: FileSent) -> tuple[Path, Path | None]:
        """Where a file that is to be sent belongs, and what is there in its place. InputError where
        it cannot be taken now, or nobody was asked whether to replace that.
        """
        project = self.folder.project(asked.project)
        self._check_idle(asked.project)
        check_size(project, asked.path, asked.bytes)
        present = present_at(project, asked.path)
        if present is not None and not asked.replace:
            raise InputError(f"{present.name} is there: add {asked.path} again, or remove it first")
        return project / asked.path, present

    def remove(self, project: Name, name: Name) -> None:
        """Removes a file of a project. InputError where that cannot be."""
        folder = self.folder.project(project)
        self._check_idle(project)
        remove_file(folder, name)

    def picture(self, project: str, name: str) -> bytes:
        """A picture of a project's file, as JPEG. InputError where there is none."""
        return picture_of(self.folder.project(project), name)

    def take_calibration(self, project: Name, of: Name) -> None:
        """Copies the calibration of another project, whose cameras have not been moved since.
        InputError where there is none, or another one is there.
        """
        folder, other = self.folder.project(project), self.folder.project(of)
        self._check_idle(project)
        source, present = calibration_path(other), calibration_path(folder)
        if source is None or not source.is_file():
            raise InputError(f"{of} has no calibration in a file: choose another project")
        if present is not None:
            raise InputError(f"{present.name} is there: remove it first")
        write_whole(folder / source.name, source.read_bytes())

    def _check_idle(self, project: str) -> None:
        state = self.job.status(of=project)
        if state["state"] == "running":
            raise InputError(
                f"the {state['kind']} of {project} reads its files: wait for its end, or stop it"
            )

    def ask(self, word: JobWord) -> None:
        """Asks something of the job that is running."""
        self.job.ask(word)

    def rename(self, name: Name, to: Name) -> None:
        """Gives a project or a result another name. InputError where that cannot be."""
        self._let_go(name)
        self.changes.rename(name, to)

    def delete(self, name: Name) -> None:
        """Moves a project or a result into the bin. InputError where that cannot be."""
        self._let_go(name)
        self.changes.delete(name)

    def _let_go(self, name: str) -> None:
        """Closes what reads a project or result. InputError where a job does."""
        self._check_idle(name)
        self.viewers.close()
        with self._lock:
            if self._setup is not None and self._setup[0] == name:
                self._setup[1].close()
                self._setup = None

    def form(self, project: str, command: Command, like: str = "") -> list[dict[str, Any]]:
        """Settings of an estimation of a project, or those that an earlier result was made with."""
        folder = self.folder.project(project)
        return form_of(command, folder, self.folder.result(like) if like else None)

    def _free_out(self, project: str, command: Command) -> str:
        """A name for the next result of a project."""
        taken = [path.name for path in visible_entries(self.folder.root)]
        jobs = [job.asked for job in self.job.unfinished()]
        taken += [asked.out for asked in jobs if isinstance(asked, FitAsked)]
        return _free_name(f"{project}_{command}", {name.casefold() for name in taken})

    def start_fit(self, asked: FitAsked) -> None:
        """Begins an estimation, or lets it wait for other jobs, and keeps its settings in the
        project. InputError where a setting makes no sense, or the result must not be written there.
        """
        project = self.folder.project(asked.project)
        if not asked.out:
            asked = msgspec.structs.replace(asked, out=self._free_out(project.name, asked.command))
        out = self.folder.out(asked.out, asked.overwrite)
        fixed = {"recording": project, "out": out, "overwrite": asked.overwrite}
        command = filled_in(asked.command, self.folder, project, fixed, asked.settings)
        with errors_at_fields(asked.command):  # before the work, not in it
            command.check()
            command.settings()
            command.open()
        self._begin_estimation(asked.command, estimate, command, asked)
        change_section(project / SETTINGS_FILE, asked.command, asked.settings)

    def start_fits(self, projects: Annotated[list[Name], Meta(max_length=1000)]) -> dict[str, Any]:
        """Begins an estimation of each of several projects, one after the other, with its own
        settings; returns why some are `refused`, by their names.
        """
        refused: dict[str, str] = {}
        for name in projects:
            try:
                known = self.project(name)
                command = known["command"]
                if command is None or (known["fault"] and command == "fit"):
                    raise InputError(known["fault"])
                self.start_fit(FitAsked(name, command))
            except InputError as error:
                refused[name] = str(error)
        return {"refused": refused}

    def start_demo(self, asked: DemoAsked) -> None:
        """Makes a recording and estimates its motion. InputError where its result is there."""
        out = self.folder.out(f"{_DEMO}_fit", overwrite=False)
        project = self.folder.root / _DEMO
        if project.exists():
            self.folder.project(_DEMO)
        fixed = {"recording": project, "out": out, "overwrite": False}
        command = filled_in("fit", self.folder, project, fixed, {})
        self._begin_estimation("fit", demo, command, asked)

    def _begin_estimation(
        self, kind: Command, work: Callable[..., dict[str, Any]], command: Any, asked: Struct
    ) -> None:
        shares, root = SHARES.get(command.chosen_estimator), self.folder.root
        of = command.recording.name
        self.job.start(kind, of, work, command, root, shares=shares, asked=asked, waits=True)

    def start_export(self, asked: ExportAsked) -> None:
        """Begins an export, of one of several people or of all, or lets it wait for other jobs.
        InputError where there is no such result or person, or a setting makes no sense.
        """
        folder = self.folder.result(asked.result)
        known = [name for name in export_formats() if name in asked.formats]
        if not known and not asked.report and not asked.pictures:
            raise InputError("nothing is chosen: choose a format, the report or the pictures")
        people = {one.name: one for one in people_folders(folder)} if asked.person else {"": folder}
        if asked.person not in people:
            raise InputError(f"{asked.result} has no person {asked.person[:40]!r}: choose another")
        fixed = {"result": people[asked.person], "to": ",".join(known), "out": None}
        command = filled_in("export", self.folder, folder, fixed, asked.settings)
        self.job.start(
            "export", asked.result, export, folder, command, asked.report, asked.pictures,
            asked=asked, waits=True, project=self.folder.project_of(folder) or "",
        )  # fmt: skip

    def start_correction(self, asked: CorrectAsked) -> None:
        """Begins a correction of a result that takes long, or lets it wait for other jobs."""
        folder = self.folder.result(asked.result)
        command = Correct(
            folder, fit_again=asked.fit_again, without=asked.without, set_joints=asked.set_joints
        )
        self.job.start(
            "fit", asked.result, correct_result, command, asked.result,
            asked=asked, waits=True, project=self.folder.project_of(folder) or "",
        )  # fmt: skip

    def repeat(self, number: int) -> None:
        """Begins a job that was interrupted, stopped, or has failed once more, as it was asked for.
        InputError where that cannot be.
        """
        content = msgspec.to_builtins(self.job.asked(number))
        try:
            asked = msgspec.convert(content, _AnyAsked)
        except msgspec.ValidationError as error:
            raise not_understood(error) from None
        begins: dict[type[Struct], Callable[[Any], None]] = {
            FitAsked: self.start_fit,
            DemoAsked: self.start_demo,
            ExportAsked: self.start_export,
            CorrectAsked: self.start_correction,
            CalibrationAsked: self.calibration.start,
            RecordAsked: self.recording.start,
            LiveAsked: self.live.start,
        }
        begins[type(asked)](asked)
        self.job.stop(number)  # it is named no more

    def sheet(self, result: str) -> bytes:
        """The contact sheet of a result as JPEG. InputError where there is none."""
        image = sheet_image(self.folder.result(result))
        if image is None:
            raise InputError("this result has no pictures: estimate again with `pictures`")
        return encoded(np.ascontiguousarray(image), ".jpg")

    def setup(self, name: str, reopen: bool) -> SetupSession:
        """The set-up of a project, opened where another was, or once more. InputError where it
        cannot be opened.
        """
        with self._lock:
            if self._setup is None or self._setup[0] != name or reopen:
                folder = self.folder.project(name)
                opened = OpenedFolder.open(folder, **_unstated(folder_settings("fit", folder)))
                self._setup = name, SetupSession(opened, self.job, "../../")
            return self._setup[1]

    def open_viewer(self, name: str) -> None:
        """Opens the viewer of a result. InputError where it cannot be read."""
        folder = self.folder.result(name)
        self.viewers.open(
            name, folder, lambda options: self.start_correction(CorrectAsked(name, **options))
        )


def _free_name(stem: str, taken: Collection[str]) -> str:
    """A folder's name, with a number where it is taken. InputError where it cannot be one."""
    check_plain_name(stem)
    names = (stem, *(f"{stem}_{number}" for number in range(2, len(taken) + 3)))
    return next(name for name in names if name.casefold() not in taken)


def _unstated(values: Mapping[str, FolderSetting]) -> dict[str, Any]:
    """Unit, frame rate and label, without which some folders cannot be read."""
    return {name: values.get(name, (None, ""))[0] for name in ("unit", "fps", "label")}
