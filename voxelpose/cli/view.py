"""voxelpose view."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from tyro.conf import Positional, arg

from calib.errors import InputError


@dataclass(frozen=True)
class View:
    """The arguments of `voxelpose view`."""

    help: ClassVar[str] = """Shows the carved hull of a frame and the skeleton fitted to it.

The hull is carved again from the recording that the result was made from.
Given a recording instead of a result, it shows the hull alone.

  voxelpose view walk_fit
  voxelpose view walk_fit --frame 40 --png hull.png
"""

    folder: Annotated[Positional[Path], arg(metavar="OUT")]
    """Folder of a fit, or a recording."""
    frame: Annotated[int | None, arg(metavar="N", help_behavior_hint="")] = None
    """Number of the frame. Left out: the middle one."""
    png: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None
    """Write a picture instead of opening a window: no screen is needed."""
    recording: Annotated[Path | None, arg(metavar="RECORDING", help_behavior_hint="")] = None
    """The recording, if it has moved since the fit."""
    voxel: Annotated[float | None, arg(metavar="M", help_behavior_hint="")] = None
    """Edge of a voxel in metres. Left out: chosen by the program."""
    unit: Annotated[Literal["m", "cm", "mm"] | None, arg(metavar="m|cm|mm", help_behavior_hint="")] = None
    """Unit of the calibration's lengths, where the file does not say it."""
    overwrite: bool = False
    """Replace FILE if it exists."""

    def run(self) -> int:
        """Shows."""
        from voxelpose.carving.recording import CarveSettings, carve_recording
        from voxelpose.results import Result, is_result
        from voxelpose.view.hull import hull_picture, show_hull

        if self.png is not None and self.png.exists() and not self.overwrite:
            raise InputError(f"{self.png} exists: give --png another name, or add --overwrite")
        if self.png is None:
            from voxelpose.open3d_import import import_open3d

            import_open3d(screen=True)  # before the work, not after
        if is_result(self.folder):
            result = Result.open(self.folder)
            told: Any = result.settings
            recording, cameras = self.recording or (result.folder / told["recording"]).resolve(), result.rig.names
            if not recording.is_dir():
                raise InputError(f"the recording {recording} of this result is not there any more: say where with --recording")
            frame, skeleton = _skeleton(result, self.frame)
        else:
            recording, cameras, frame, skeleton = self.folder, None, self.frame or 0, None
        hull = carve_recording(recording, None, CarveSettings(frame, self.voxel, cameras=cameras, unit=self.unit))
        if self.png is None:
            show_hull(hull.grid, hull.occupancy, skeleton, f"{self.folder} frame {frame}")
            return 0
        import cv2

        good, data = cv2.imencode(".png", hull_picture(hull.grid, hull.occupancy, skeleton))
        try:
            self.png.write_bytes(data.tobytes() if good else b"")
        except OSError as error:
            self.png.unlink(missing_ok=True)
            raise InputError(f"{self.png} cannot be written: {error.strerror}") from error
        print(f"{self.png}: frame {frame}, hull of {hull.volume_l:.1f} litres{' and skeleton' if skeleton else ''}")
        return 0


def _skeleton(result: Any, frame: int | None):
    """Returns the frame to show and its skeleton; the middle one where none is named."""
    import numpy as np

    from voxelpose.view.figure import skeleton_bones, skeleton_joints
    from voxelpose.view.hull import Skeleton

    motion = result.motion
    if frame is None:
        frame = int(motion.frames[len(motion) // 2])
    if frame not in motion.frames:
        raise InputError(f"frame {frame} has no pose in {result.folder}: choose one from {motion.frames[0]} to {motion.frames[-1]}")
    pose = motion.select(np.flatnonzero(motion.frames == frame))
    rotation, origin = pose.parts()
    bones = np.array([bone[:2] for bone in skeleton_bones()])
    return frame, Skeleton(skeleton_joints(motion.model, rotation[0], origin[0]), bones)
