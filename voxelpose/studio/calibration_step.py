"""Calibration in the studio: the board, pictures of it, and what the commands found in them."""

from pathlib import Path
from typing import Any, Literal

from msgspec import Struct

from calib.errors import InputError
from calib.points import read_points
from calib.storage.documents import LARGEST_CALIBRATION, load_text, parse_json
from voxelpose.recording.camera_files import pictures_by_camera
from voxelpose.recording.folder import calibration_path
from voxelpose.recording.subject import SETTINGS_FILE
from voxelpose.recording.timestamps import TIMESTAMPS
from voxelpose.setup_page.clicked_points import POINTS_FILE
from voxelpose.setup_page.drawn_places import change_section
from voxelpose.setup_page.page_requests import Typed
from voxelpose.studio.command_forms import filled_in, form_of
from voxelpose.studio.projects import StudioFolder
from voxelpose.studio.studio_jobs import calibrate
from voxelpose.studio.uploads import project_files
from voxelpose.view.serving.page_answers import Name
from voxelpose.view.serving.page_job import PageJob

SHEET = "board.pdf"
"""File of a project that holds the board to be printed."""
RIG_PICTURE = "calibration_rig.png"
"""File beside a calibration that shows the cameras in the room."""
LENSES = "lenses.toml"
"""File of a project that holds the lenses, without positions."""
_STILLS, _WALK = "boards", "board_walk"
_CALIBRATION = "calibration.toml"
_LENS_REPORT, _RIG_REPORT = "lenses_lenses.json", "calibration_places.json"
_COMMANDS = "board", "intrinsics", "extrinsics", "sync"
_OF_BOARD = "board", "square", "marker", "dictionary"  # which two commands share
_KINDS = {
    ("intrinsics", "boards"): "lens calibration",
    ("extrinsics", "boards"): "position calibration",
    ("extrinsics", "points"): "position calibration",
    ("sync", "boards"): "board synchronisation",
    ("sync", "take"): "synchronisation",
}


class CalibrationAsked(Struct, forbid_unknown_fields=True, tag=True):
    """A calibration, with the settings that are typed in, of the board's pictures, of clicked
    points, or of the project's own videos.
    """

    project: Name
    command: Literal["intrinsics", "extrinsics", "sync"]
    of: Literal["boards", "points", "take"] = "boards"
    settings: Typed = {}


class BoardAsked(Struct, forbid_unknown_fields=True):
    """A board to be printed."""

    project: Name
    settings: Typed = {}


class CalibrationStep:
    """What the step shows of a project, and has done."""

    def __init__(self, folder: StudioFolder, job: PageJob) -> None:
        self._folder, self._job = folder, job

    def state(self, project: str) -> dict[str, Any]:
        """Forms of the commands, files of the board, and what was found in them. InputError where
        there is no such project, or a file is damaged.
        """
        folder = self._folder.project(project)
        points, calibration = folder / POINTS_FILE, calibration_path(folder)
        picture = folder / RIG_PICTURE
        return {
            "forms": {command: form_of(f"calibrate.{command}", folder) for command in _COMMANDS},
            "sheet": (folder / SHEET).is_file(),
            "files": [file for file in project_files(folder) if file["place"] in (_STILLS, _WALK)],
            "videos": len(pictures_by_camera(folder)),
            "in_step": {
                "boards": (folder / _WALK / TIMESTAMPS).is_file(),
                "take": (folder / TIMESTAMPS).is_file(),
            },
            "points": len(read_points(points).known_m) if points.is_file() else 0,
            "lenses": _report(folder / _LENS_REPORT) if (folder / LENSES).is_file() else None,
            "rig": _report(folder / _RIG_REPORT) if (folder / _CALIBRATION).is_file() else None,
            "rig_picture": picture.stat().st_mtime if picture.is_file() else None,
            "calibration": None if calibration is None else calibration.name,
        }

    def sheet(self, asked: BoardAsked) -> dict[str, Any]:
        """Writes the board to be printed; returns what to measure on the print, and the settings
        for the other commands, which are kept. InputError where it does not fit the paper.
        """
        project = self._folder.project(asked.project)
        fixed = {"out": project / SHEET}
        command = filled_in("calibrate.board", self._folder, project, fixed, asked.settings)
        board, (width_m, height_m) = command.write()
        change_section(project / SETTINGS_FILE, "calibrate.board", asked.settings)
        known = {
            "board": f"{board.columns}x{board.rows}",
            "square": board.square_m,
            "marker": board.marker_m,
            "dictionary": None if board.marker_m is None else board.dictionary,
        }
        self._keep_board(project, known)
        return {
            **known,
            "page_mm": [round(1000 * width_m), round(1000 * height_m)],
            "squares": [board.columns + 1, board.rows + 1],
            "symmetric": board.is_symmetric,
        }

    def start(self, asked: CalibrationAsked) -> None:
        """Begins a calibration, and keeps its settings in the project. InputError where another job
        is running, a setting makes no sense, or something must be done before.
        """
        project, name = self._folder.project(asked.project), asked.command
        kind = _KINDS.get((name, asked.of))
        if kind is None:
            raise InputError(f"{name} cannot be made of the {asked.of}: choose another")
        fixed = self._files(project, asked)
        given = asked.settings
        if name == "sync" and asked.of == "take":  # whatever is in the files: nobody carries one
            given = given | dict.fromkeys(_OF_BOARD)
        command = filled_in(f"calibrate.{name}", self._folder, project, fixed, given)
        self._job.start(kind, asked.project, calibrate, command, step="calibrate", asked=asked)
        settings = {key: value for key, value in asked.settings.items() if key not in _OF_BOARD}
        change_section(project / SETTINGS_FILE, f"calibrate.{name}", settings)
        if name != "sync":
            board = {key: asked.settings[key] for key in _OF_BOARD if key in asked.settings}
            self._keep_board(project, board)

    def _files(self, project: Path, asked: CalibrationAsked) -> dict[str, Any]:
        """The files that a calibration reads and writes. InputError where one is not there yet."""
        command, of = asked.command, asked.of
        lenses = project / LENSES if (project / LENSES).is_file() else calibration_path(project)
        walk = project / _WALK
        if command == "intrinsics":
            if not pictures_by_camera(project / _STILLS):
                raise InputError("there are no pictures of the board: add them above")
            return {"pictures": (project / _STILLS,), "out": project / LENSES}
        if of == "boards" and not pictures_by_camera(walk, stills=True):
            raise InputError("there are no videos of the carried board: add them above")
        if command == "sync":
            folder = project if of == "take" else walk
            known = None if of == "take" else lenses
            return {"recording": folder, "out": folder / TIMESTAMPS, "intrinsics": known}
        present = calibration_path(project)
        if present is not None and present.name != _CALIBRATION:
            raise InputError(f"{present.name} is there: remove it in Import first")
        if lenses is None:
            raise InputError("the lenses are not known: calibrate them first, or import them")
        points = project / POINTS_FILE
        if of == "points" and not points.is_file():
            raise InputError("no point is saved: click points in the step Check first")
        return {
            "recording": None if of == "points" else walk,
            "points": points if of == "points" else None,
            "intrinsics": lenses,
            "out": project / _CALIBRATION,
        }

    def _keep_board(self, project: Path, board: dict[str, Any]) -> None:
        """Keeps what the board looks like for the commands that look for it."""
        for command in ("intrinsics", "extrinsics"):
            change_section(project / SETTINGS_FILE, f"calibrate.{command}", board)


def _report(path: Path) -> dict[str, Any] | None:
    """What a command wrote about its calibration; None where that is gone."""
    if not path.is_file():
        return None
    report = parse_json(load_text(path, LARGEST_CALIBRATION), path)
    if not isinstance(report, dict):
        raise InputError(f"{path} is damaged: remove it, or calibrate again")
    return report
