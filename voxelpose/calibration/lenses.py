"""From pictures of a board to the lenses of all cameras."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calib.board import Board, BoardView, Refusal
from calib.camera import Camera, Rig
from calib.errors import InputError
from calib.intrinsics import Intrinsics, LensKind, calibrate_intrinsics
from silhouette_core.progress import Reporter
from voxelpose.calibration.board_views import CameraPictures, find_views, stride


@dataclass(frozen=True, eq=False)
class Lens:
    """A camera's lens and the views it was made from."""

    camera: str
    intrinsics: Intrinsics
    views: Mapping[str, BoardView | Refusal]

    def used(self) -> dict[str, BoardView]:
        """Returns the views that counted."""
        kept = {line.picture for line in self.intrinsics.pictures if line.left_out is None}
        return {
            name: view
            for name, view in self.views.items()
            if name in kept and isinstance(view, BoardView)
        }


def calibrate_lenses(
    board: Board,
    cameras: Mapping[str, CameraPictures],
    kind: LensKind,
    wanted: int,
    reporter: Reporter,
) -> tuple[list[Lens], dict[str, str]]:
    """Calibrates every camera on its own.

    Args:
        board: The board.
        cameras: Pictures by camera.
        kind: Model of the lenses.
        wanted: Frames of a video to use, at most.
        reporter: Hears of every picture.

    Returns:
        The lenses, and by camera why there is none.
    """
    lenses, failures = [], {}
    for name, pictures in cameras.items():
        total = (
            len(pictures) if pictures.video is None else -(-len(pictures) // stride(len(pictures)))
        )
        reporter.stage(f"pictures of {name}", total)
        try:
            views = find_views(board, pictures, wanted, reporter)
            reporter.stage(f"lens of {name}")
            lenses.append(Lens(name, calibrate_intrinsics(board, views, kind, name), views))
        except InputError as error:
            said = str(error)
            failures[name] = said if name in said else f"camera {name}: {said}"
    return lenses, failures


def lens_rig(lenses: list[Lens]) -> Rig:
    """Returns the cameras with their lenses, all at the origin."""
    return Rig(
        tuple(
            Camera(
                one.camera,
                found.size,
                found.matrix,
                found.distortion,
                np.eye(3),
                np.zeros(3),
                found.fisheye,
            )
            for one in lenses
            for found in (one.intrinsics,)
        )
    )


def lens_notes(lenses: list[Lens]) -> dict[str, object]:
    """Returns what to keep beside the numbers: how good each lens is."""
    notes = {}
    for one in lenses:
        found = one.intrinsics
        notes[one.camera] = {
            "rms_px": round(found.rms_px, 4),
            "pictures": len(one.used()),
            "focal_standard_error_px": [round(float(error), 3) for error in found.focal_error_px],
        }
    return notes


def lens_report(lenses: list[Lens]) -> dict[str, object]:
    """Returns everything known of the lenses, for a JSON file."""
    report = {}
    for one in lenses:
        found = one.intrinsics
        report[one.camera] = {
            "size": found.size,
            "matrix": found.matrix,
            "distortion": found.distortion,
            "fisheye": found.fisheye,
            "rms_px": found.rms_px,
            "focal_standard_error_px": found.focal_error_px,
            "corners_per_cell": found.coverage,
            "advice": found.advice,
            "pictures": [
                {
                    "picture": line.picture,
                    "corners": line.corners,
                    "rms_px": line.rms_px,
                    "left_out": line.left_out,
                }
                for line in found.pictures
            ],
        }
    return report
