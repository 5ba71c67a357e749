"""What the studio has done in a process of its own: an estimation, a calibration, an export; and
the file that tells which of it an end of the program has interrupted.
"""

import math
import zipfile
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import msgspec

from calib.errors import InputError
from calib.storage.atomic import FolderWriter, claimed, replacing, write_whole
from calib.storage.documents import load_bytes
from silhouette_core.progress import Reporter
from voxelpose.calibration.sync import Sync, sync_findings
from voxelpose.cli.calibrate_cameras import CalibrateExtrinsics, CalibrateIntrinsics
from voxelpose.cli.calibrate_sync import CalibrateSync
from voxelpose.cli.correct import Correct
from voxelpose.cli.export import Export
from voxelpose.cli.fit import EstimationArguments
from voxelpose.compile_ahead import compiling_beside
from voxelpose.demo.room import make_recording
from voxelpose.recording.folder import Recording, is_recording
from voxelpose.report.page import REPORT, write_report
from voxelpose.view.serving.page_job import StepError, Unfinished

EXPORTED = "export.zip"
"""File of a result's folder that holds the latest export."""
JOBS_FILE = ".studio_jobs.json"
"""Hidden file of the studio's folder with the jobs that have not ended."""
_LARGEST_JOBS = 10_000_000  # bytes
_PICTURES = "contact_sheet.png", "overlay_*.webm"
_OF_CHECK = "silhouette", "background", "region", "cameras do not agree", "calibrate check"


class JobsFile:
    """The jobs that have not ended, in a file of the studio's folder; it is neither read nor
    written while another studio is open in that folder, or where nothing can be written.
    """

    def __init__(self, root: Path) -> None:
        self._path, self._claim = root / JOBS_FILE, ExitStack()
        self._is_claimed = False
        with suppress(InputError):
            self._claim.enter_context(claimed(self._path))
            self._is_claimed = True

    def read(self) -> list[Unfinished]:
        """Jobs that an earlier end of the program has interrupted. InputError where the file is
        damaged.
        """
        if not self._is_claimed or not self._path.exists():
            return []
        try:
            content = load_bytes(self._path, _LARGEST_JOBS)
            return msgspec.json.decode(content, type=list[Unfinished])
        except (msgspec.DecodeError, UnicodeError, RecursionError):
            raise InputError(f"{self._path} is damaged: remove it") from None

    def write(self, unfinished: Sequence[Unfinished]) -> None:
        """Writes jobs that have not ended; no file where there is none."""
        with suppress(InputError, OSError):  # the jobs themselves go on
            if self._is_claimed and unfinished:
                write_whole(self._path, msgspec.json.encode(unfinished))
            elif self._is_claimed:
                self._path.unlink(missing_ok=True)

    def close(self) -> None:
        """Leaves the file to another studio."""
        self._claim.close()


def demo(reporter: Reporter, command: EstimationArguments, root: Path) -> dict[str, Any]:
    """Renders a small recording, unless it is there, and estimates its motion, see `estimate`."""
    if not is_recording(command.recording):
        reporter.stage("making a recording")
        with FolderWriter(command.recording) as folder:
            make_recording(folder)
    return estimate(reporter, command, root)


def estimate(reporter: Reporter, command: EstimationArguments, root: Path) -> dict[str, Any]:
    """Runs a command of estimation into a folder below `root`; returns the name of the `result`.
    StepError where a user can correct something.
    """
    try:
        with compiling_beside(reporter, [command.chosen_estimator]):
            results = command.estimate(reporter)
    except InputError as error:
        line = " ".join(str(error).split())
        raise StepError(line, _step_of(line, command.recording)) from error
    folder = results[0].folder if len(results) == 1 else results[0].folder.parent
    return {"result": folder.resolve().relative_to(root).as_posix()}


def _step_of(line: str, recording: Path) -> str:
    """Step that mends an error of an estimation."""
    try:
        Recording.open(recording)
    except InputError as fault:
        if " ".join(str(fault).split()) == line:  # of the files alone, whatever is set
            return "import"
    return "check" if any(word in line for word in _OF_CHECK) else "fit"


def calibrate(
    reporter: Reporter, command: CalibrateIntrinsics | CalibrateExtrinsics | CalibrateSync
) -> dict[str, Any]:
    """Runs a command of calibration; what it found is in its files, and of a synchronisation, too,
    `offsets` of the cameras and a `verdict` in lines. InputError where a user can correct it.
    """
    result: Any = command.calibrate(reporter)
    command.write(result)
    if not isinstance(result, Sync):
        return {}
    offsets = [
        {
            "camera": line.camera,
            "fps": result.fps[line.camera],
            "late_frames": line.frames,
            "late_ms": 1000 * line.offset_s,
            "error_ms": 1000 * line.error_s if math.isfinite(line.error_s) else None,
            "reference": line.camera == result.result.reference,
        }
        for line in result.result.offsets
    ]
    lines = [finding.words for finding in sync_findings(result)]
    return {"offsets": offsets, "verdict": [*lines, *result.notes]}


def correct_result(reporter: Reporter, command: Correct, name: str) -> dict[str, Any]:
    """Runs a correction; returns the name of the `result`. InputError where it cannot be made."""
    command.correct(reporter)
    return {"result": name}


def export(
    reporter: Reporter, folder: Path, command: Export, report: bool, pictures: bool
) -> dict[str, Any]:
    """Writes the files of a command, if it names formats, the report and what the fit drew into one
    archive in the folder of a result; returns the `files` in it and their `bytes`. InputError where
    a format does not fit, or files cannot be written.
    """
    reporter.stage("files")
    paths, notes = command.write() if command.to else ([], [])
    for note in notes:
        reporter.note(note)
    if report:
        paths.append(write_report(folder, folder / REPORT, overwrite=True, reporter=reporter))
    if pictures:
        paths += sorted(path for pattern in _PICTURES for path in folder.glob(pattern))
    if not paths:
        raise InputError(
            "this result has no pictures: estimate again with `pictures`, or choose more"
        )
    reporter.stage("archive", len(paths))
    with (
        replacing(folder / EXPORTED) as partial,
        zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        for path in paths:
            archive.write(path, path.relative_to(folder))
            reporter.advance()
    size = (folder / EXPORTED).stat().st_size
    return {"files": [path.relative_to(folder).as_posix() for path in paths], "bytes": size}
