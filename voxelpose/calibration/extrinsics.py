"""Camera poses from a recording of a board."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from calib.board import Board
from calib.camera import Rig
from calib.errors import InputError
from calib.extrinsics import Extrinsics, board_errors, calibrate_extrinsics
from calib.pairs import check_lens_size
from silhouette_core.progress import Reporter
from voxelpose.calibration.board_views import as_printed, board_moments
from voxelpose.recording.camera_files import not_read, pictures_by_camera, renaming
from voxelpose.recording.chapters import open_camera
from voxelpose.recording.file_times import ends_apart, recorded_times
from voxelpose.recording.frame_reader import FrameReader
from voxelpose.recording.timestamps import TIMESTAMPS, Times, rates_differ


@dataclass(frozen=True)
class ExtrinsicsSettings:
    """Settings of the calibration of poses."""

    floor: int | None = None
    """Frame at which the board lies on the floor, of the first camera if there are time stamps;
    None if there is none."""
    max_moments: int = 150
    cameras: Sequence[str] | None = None  #: Names of the cameras used; None for all.
    refine_lenses: bool = False
    earlier: Rig | None = None
    """A calibration whose error in the same pictures is told; None if there is none."""


def extrinsics_from_recording(
    board: Board, lenses: Rig, folder: Path, settings: ExtrinsicsSettings, reporter: Reporter
) -> Extrinsics:
    """Estimates the poses of cameras. InputError where cameras and pictures do not match, or the
    pictures do not determine the poses.

    Args:
        folder: A video, a folder of frames or a still per camera: synchronous, or with the times
            of all frames in timestamps.csv or the videos.
    """
    readers, lenses = _readers(folder, lenses, settings.cameras)
    times, notes = recorded_times(folder, readers)
    for note in notes:
        reporter.note(note)
    _check_start(folder, readers, times, reporter)
    board = as_printed(board, readers, reporter)
    views, seen = board_moments(
        board, readers, times, settings.floor, settings.max_moments, reporter
    )
    if not views:
        counts = ", ".join(f"{name} {count}" for name, count in seen.items())
        raise InputError(
            f"no two cameras saw the board at the same moment (moments: {counts}): carry it where"
            " two see it at once"
        )
    reporter.stage("bundle adjustment")
    floor = None if settings.floor is None else f"frame {settings.floor}"
    extrinsics = calibrate_extrinsics(board, lenses, views, floor, settings.refine_lenses)
    if settings.earlier is None:
        return extrinsics
    with suppress(InputError):  # of other cameras, or of another size
        return replace(extrinsics, before_px=board_errors(board, settings.earlier, views))
    return extrinsics


def _readers(
    folder: Path, lenses: Rig, cameras: Sequence[str] | None
) -> tuple[dict[str, FrameReader], Rig]:
    """Opens the pictures of all cameras and checks their consistency."""
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
            + not_read(folder, " ({})")
        )
    remedy = "name videos after the calibration's cameras, or choose some with --cameras"
    lacking = [name for name in lenses.names if name not in paths]
    if unknown := [name for name in paths if name not in lenses]:
        remedy = renaming({name: paths[name] for name in unknown}, lacking) or remedy
        raise InputError(
            f"no lens for {', '.join(unknown)} of {folder}: the calibration has"
            f" {', '.join(lenses.names)}: {remedy}"
        )
    if lacking:
        raise InputError(f"no pictures of {', '.join(lacking)} in {folder}: {remedy}")
    readers = {name: open_camera(paths[name]) for name in lenses.names}
    for name, reader in readers.items():
        check_lens_size(lenses[name], reader.size)
    return readers, lenses


def _check_start(
    folder: Path,
    readers: Mapping[str, FrameReader],
    times: Mapping[str, Times] | None,
    reporter: Reporter,
) -> None:
    """Refuses videos of different rates without times, and tells that they end apart."""
    if (folder / TIMESTAMPS).exists():
        return
    remedy = (
        f"`voxelpose calibrate sync {folder} --by board --out {folder / TIMESTAMPS}` (see its"
        " --help) finds the time of every frame"
    )
    rates = {name: reader.fps for name, reader in readers.items() if reader.fps}
    counts = {name: reader.frame_count for name, reader in readers.items()}
    doubt = used = ""
    if times is not None:
        doubt = ends_apart(times)
    elif rates_differ(rates.values()):
        listed = ", ".join(f"{name} {rate:.2f}" for name, rate in rates.items())
        raise InputError(f"the videos have different rates ({listed} frames per second): {remedy}")
    elif len(set(counts.values())) > 1:
        listed = ", ".join(f"{name} {count}" for name, count in counts.items())
        doubt = f"the videos differ in length ({listed} frames)"
        used = f", the first {min(counts.values())} are used"
    if doubt:
        reporter.note(f"{doubt}: taken to start together{used}; if they do not, {remedy}")


def extrinsics_notes(result: Extrinsics) -> dict[str, object]:
    """Accuracy of each camera's pose, for the calibration file."""
    notes = {}
    for line in result.table:
        note: dict[str, object] = {"rms_px": round(line.rms_px, 4), "seen": line.seen}
        if np.isfinite(line.position_mm):
            note |= {
                "position_standard_error_mm": round(line.position_mm, 3),
                "rotation_standard_error_deg": round(line.rotation_deg, 4),
            }
        notes[line.camera] = note
    return notes


def extrinsics_report(result: Extrinsics) -> dict[str, object]:
    """The calibration's accuracy in full, for a JSON file."""
    return {
        "rms_px": result.rms_px,
        "cameras": {
            camera.name: {
                "center_m": camera.center_m,
                "seen": line.seen,
                "rms_px": line.rms_px,
                "before_rms_px": result.before_px.get(camera.name),
                "position_standard_error_mm": line.position_mm,
                "rotation_standard_error_deg": line.rotation_deg,
            }
            for camera, line in zip(result.rig, result.table, strict=True)
        },
        "shared": [
            {"cameras": pair, "count": count} for pair, count in result.shared_boards.items()
        ],
        "advice": result.advice,
    }
