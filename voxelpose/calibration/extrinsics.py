"""From a recording of a board, or from listed points, to where the cameras stand."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.board import Board
from calib.camera import Rig
from calib.errors import InputError
from calib.extrinsics import Extrinsics, calibrate_extrinsics
from silhouette_core.progress import Reporter
from voxelpose.calibration.board_views import board_moments
from voxelpose.recording.folder import pictures_by_camera
from voxelpose.recording.frame_reader import FrameReader

_RATES_DIFFER = 0.01


@dataclass(frozen=True)
class ExtrinsicsSettings:
    """How a recording of a board is read.

    Attributes:
        floor: Frame at which the board lies on the floor.
        wanted: Moments to use, at most.
        cameras: Cameras to use; None: all.
        refine_lenses: Whether the lenses may change too.
    """

    floor: int | None = None
    wanted: int = 150
    cameras: Sequence[str] | None = None
    refine_lenses: bool = False


def extrinsics_from_recording(
    board: Board, lenses: Rig, folder: Path, settings: ExtrinsicsSettings, reporter: Reporter
) -> Extrinsics:
    """Finds where cameras stand.

    Args:
        board: The board that was carried about.
        lenses: Cameras with their lenses.
        folder: A video, a folder of frames or a still per camera, synchronous.
        settings: How to read it.
        reporter: Hears of every moment.

    Raises: InputError: Cameras and pictures do not belong together, or the pictures do not say
        where the cameras stand.
    """
    readers, lenses = _readers(folder, lenses, settings.cameras, reporter)
    moments = board_moments(board, readers, settings.floor, settings.wanted, reporter)
    if not moments.views:
        seen = ", ".join(f"{name} {count}" for name, count in moments.seen.items())
        raise InputError(
            f"no two cameras saw the board at the same moment (moments: {seen}): carry it where two"
            " see it at once"
        )
    reporter.stage("bundle adjustment")
    floor = None if settings.floor is None else f"frame {settings.floor}"
    return calibrate_extrinsics(board, lenses, moments.views, floor, settings.refine_lenses)


def _readers(
    folder: Path, lenses: Rig, cameras: Sequence[str] | None, reporter: Reporter
) -> tuple[dict[str, FrameReader], Rig]:
    """Opens the pictures of all cameras and checks that they belong together."""
    if not folder.is_dir():
        raise InputError(
            f"{folder} is no recording of a board: give a folder with a video (or a still) per"
            " camera"
        )
    paths = pictures_by_camera(folder, stills=True)
    if cameras is not None:
        paths = {name: path for name, path in paths.items() if name in cameras}
        lenses = lenses.select(list(cameras))
    if not paths:
        raise InputError(
            f"{folder} holds no pictures: put a video per camera there, named as in the calibration"
        )
    remedy = "name videos after the calibration's cameras, or choose some with --cameras"
    if unknown := [name for name in paths if name not in lenses]:
        raise InputError(
            f"no lens for {', '.join(unknown)} of {folder}: the calibration has"
            f" {', '.join(lenses.names)}: {remedy}"
        )
    if missing := [name for name in lenses.names if name not in paths]:
        raise InputError(f"no pictures of {', '.join(missing)} in {folder}: {remedy}")
    readers = {name: FrameReader.open(paths[name]) for name in lenses.names}
    for name, one in readers.items():
        if one.size != lenses[name].size:
            seen, known = (f"{w}x{h}" for w, h in (one.size, lenses[name].size))
            raise InputError(
                f"camera {name} recorded at {seen}, its lens was calibrated at {known}: use one"
                " size"
            )
    rates = {name: one.fps for name, one in readers.items() if one.fps}
    if rates and max(rates.values()) > (1 + _RATES_DIFFER) * min(rates.values()):
        told = ", ".join(f"{name} {rate:.2f}" for name, rate in rates.items())
        raise InputError(
            f"the videos have different rates ({told} frames per second): bring them to one rate"
            " first"
        )
    counts = {name: one.frame_count for name, one in readers.items()}
    if len(set(counts.values())) > 1:
        told = ", ".join(f"{name} {count}" for name, count in counts.items())
        reporter.note(
            f"the videos differ in length ({told} frames): taken to start together, the first"
            f" {min(counts.values())} are used"
        )
    return readers, lenses


def extrinsics_notes(found: Extrinsics) -> dict[str, object]:
    """Returns what to keep beside the numbers: how sure each camera's place is."""
    notes = {}
    for line in found.table:
        note: dict[str, object] = {"rms_px": round(line.rms_px, 4), "seen": line.seen}
        if np.isfinite(line.position_mm):
            note |= {
                "position_standard_error_mm": round(line.position_mm, 3),
                "rotation_standard_error_deg": round(line.rotation_deg, 4),
            }
        notes[line.camera] = note
    return notes


def extrinsics_report(found: Extrinsics) -> dict[str, object]:
    """Returns everything known of the places, for a JSON file."""
    return {
        "rms_px": found.rms_px,
        "cameras": {
            camera.name: {
                "center_m": camera.center_m,
                "seen": line.seen,
                "rms_px": line.rms_px,
                "position_standard_error_mm": line.position_mm,
                "rotation_standard_error_deg": line.rotation_deg,
            }
            for camera, line in zip(found.rig, found.table, strict=True)
        },
        "shared": [
            {"cameras": pair, "count": count} for pair, count in found.shared_boards.items()
        ],
        "advice": found.advice,
    }
