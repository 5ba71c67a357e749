"""The check of the cameras as a job of the page, what it found, and the repair of the folder."""

import tempfile
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from calib.storage.atomic import write_whole, writing
from silhouette_core.progress import Reporter
from voxelpose.calibration.check import (
    Check,
    check_findings,
    check_recording,
    verdict_on,
    write_repair,
)
from voxelpose.calibration.pictures import draw_check
from voxelpose.recording.camera_files import REPLACED
from voxelpose.recording.folder import Recording
from voxelpose.recording.input_digests import input_digests
from voxelpose.view.images.canvas import png


def find_disagreement(reporter: Reporter, recording: Recording) -> dict[str, Any]:
    """What a check of a recording with a calibration finds, as `voxelpose calibrate check` prints
    it, its `picture`, PNG, the `repaired` files by name, text, and digests of the `inputs` that
    they replace. InputError where it is not possible.
    """
    inputs = replaced_inputs(recording)
    check = check_recording(recording, reporter)
    repaired: dict[str, str] = {}
    if check.repaired is not None:
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            out = write_repair(check, recording, Path(folder) / "repaired")
            repaired = {path.name: path.read_text("utf-8") for path in out.iterdir()}
    known = {"picture": png(draw_check(check)), "repaired": repaired, "inputs": inputs}
    return _findings_of(check) | known


def replaced_inputs(recording: Recording) -> dict[str, str]:
    """Digests of the files of a recording that a repair replaces. InputError where one cannot be
    read.
    """
    digests = input_digests(recording, "multiview")
    return {name: digests[name] for name in ("calibration", "timestamps")}


def repair_folder(folder: Path, repaired: Mapping[str, str]) -> list[Path]:
    """Writes repaired files of a recording, and returns them. What they replace is kept in
    `REPLACED`: of several repairs, the files before the first. InputError where the system refuses.
    """
    for name in repaired:
        old, backup = folder / name, folder / REPLACED / name
        if old.is_file() and not backup.exists():
            with writing(backup):
                backup.parent.mkdir(exist_ok=True)
            write_whole(backup, old.read_bytes())
    for name, text in repaired.items():
        write_whole(folder / name, text)
    return [folder / name for name in repaired]


def _findings_of(check: Check) -> dict[str, Any]:
    return {
        "agrees": check.agreement.agrees,
        "summary": check.agreement.summary,
        "findings": [asdict(finding) for finding in check_findings(check, "press Repair")[1:]],
        "cameras": [
            {
                "camera": line.camera,
                "error_px": line.error_px,
                "others_px": line.others_px,
                "planes": line.planes,
                "verdict": verdict_on(check, line.camera),
            }
            for line in check.agreement.table
        ],
    }
