"""Lens calibration of all cameras from pictures of a board."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace

from calib.board import Board, BoardView
from calib.camera import Rig
from calib.errors import InputError
from calib.intrinsics import Intrinsics, LensKind, calibrate_intrinsics, lens_error_px
from silhouette_core.progress import Reporter
from voxelpose.calibration.board_views import as_printed, find_views, stride
from voxelpose.recording.frame_reader import FrameReader


@dataclass(frozen=True, eq=False)
class Lens:
    """A camera's lens and the views by picture name from which it was calibrated."""

    camera: str
    intrinsics: Intrinsics
    views: Mapping[str, BoardView | str]
    before_px: float | None = None
    """Error of an earlier calibration of it in the views that were used; None where there is
    none."""

    def used(self) -> dict[str, BoardView]:
        """The views that were used."""
        pictures = {line.picture for line in self.intrinsics.pictures if line.left_out is None}
        return {
            name: view
            for name, view in self.views.items()
            if name in pictures and isinstance(view, BoardView)
        }


def calibrate_lenses(
    board: Board,
    cameras: Mapping[str, FrameReader],
    kind: LensKind,
    max_views: int,
    reporter: Reporter,
    earlier: Rig | None = None,
) -> list[Lens]:
    """Calibrates each camera separately, and notes which have no lens and why. Lenses of an earlier
    calibration are compared. InputError where no camera has a lens.
    """
    lenses: list[Lens] = []
    failures: list[str] = []
    for name, pictures in cameras.items():
        count = pictures.frame_count
        reporter.stage(f"pictures of {name}", -(-count // stride(count)))
        try:
            board = as_printed(board, {name: pictures}, reporter)
            views = find_views(board, pictures, max_views, reporter)
            reporter.stage(f"lens of {name}")
            lens = Lens(name, calibrate_intrinsics(board, views, kind, name), views)
            lenses.append(replace(lens, before_px=_before_px(board, lens, earlier)))
        except InputError as error:
            message = str(error)
            failures.append(message if name in message else f"camera {name}: {message}")
    if not lenses:
        raise InputError("; ".join(failures))
    for line in failures:
        reporter.note(f"{line} (this camera has no lens yet, the others have)")
    return lenses


def _before_px(board: Board, lens: Lens, earlier: Rig | None) -> float | None:
    """Error of an earlier calibration of a lens; None where there is none of this size."""
    if earlier is None or lens.camera not in earlier:
        return None
    camera = earlier[lens.camera]
    if camera.size != lens.intrinsics.camera.size:
        return None
    error_px = lens_error_px(board, camera, list(lens.used().values()))
    return error_px if math.isfinite(error_px) else None


def lens_rig(lenses: list[Lens]) -> Rig:
    """Cameras with these lenses, all at the origin."""
    return Rig(tuple(lens.intrinsics.camera for lens in lenses))


def lens_notes(lenses: list[Lens]) -> dict[str, object]:
    """Accuracy of each lens, for the calibration file."""
    return {
        lens.camera: {
            "rms_px": round(lens.intrinsics.rms_px, 4),
            "pictures": len(lens.used()),
            "focal_standard_error_px": lens.intrinsics.focal_error_px.round(3).tolist(),
        }
        for lens in lenses
    }


def lens_report(lenses: list[Lens]) -> dict[str, object]:
    """The lenses and their accuracy in full, for a JSON file."""
    report = {}
    for lens in lenses:
        intrinsics, camera = lens.intrinsics, lens.intrinsics.camera
        report[lens.camera] = {
            "size": camera.size,
            "matrix": camera.matrix,
            "distortion": camera.distortion,
            "fisheye": camera.fisheye,
            "rms_px": intrinsics.rms_px,
            "before_rms_px": lens.before_px,
            "focal_standard_error_px": intrinsics.focal_error_px,
            "corners_per_cell": intrinsics.coverage,
            "advice": intrinsics.advice,
            "pictures": [asdict(line) for line in intrinsics.pictures],
        }
    return report
