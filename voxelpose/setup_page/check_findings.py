"""The check of the cameras as a job of the page, and what it found."""

from typing import Any

from silhouette_core.progress import Reporter
from voxelpose.calibration.check import Check, check_recording, remedy, verdict_on
from voxelpose.calibration.pictures import draw_check
from voxelpose.recording.folder import Recording
from voxelpose.view.images.canvas import png


def find_disagreement(reporter: Reporter, recording: Recording) -> dict[str, Any]:
    """What a check of a recording with a calibration finds, as `voxelpose calibrate check` prints
    it, and its `picture`, PNG. InputError where it is not possible.
    """
    check = check_recording(recording, None, reporter)
    return _findings_of(check) | {"picture": png(draw_check(check))}


def _findings_of(check: Check) -> dict[str, Any]:
    return {
        "agrees": check.agreement.agrees,
        "summary": check.agreement.summary,
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
        "repairs": [
            {"summary": repair.summary, "remedy": remedy(check, repair.camera)}
            for repair in check.repairs
        ],
        "after": None if check.after is None else check.after.summary,
        "notes": list(check.notes),
    }
