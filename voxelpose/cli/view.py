"""voxelpose view."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from msgspec import Meta
from tyro.conf import Positional, arg

from calib.errors import InputError
from voxelpose.cli import arguments
from voxelpose.cli.terminal import Progress

if TYPE_CHECKING:
    from voxelpose.view.viewer.result_scenes import ResultScenes


@dataclass(frozen=True)
class View(arguments.PageArguments):
    """Shows cameras, voxels, body and skeleton over time in the browser.

    The page is served by this machine, and only to this machine unless --host is given; Ctrl-C ends
    it. The visual hull is carved from the recording of the result. Of several people all are shown,
    or one by its own folder. For a recording without a result, cameras and hull are shown. Several
    results of one recording stand side by side, with cameras and hull of the first.

      voxelpose view walk_fit
      voxelpose view walk_fit walk_track
      voxelpose view walk_fit --frame 40 --png hull.png
      voxelpose view walk_fit --video hull.webm
    """

    folders: Annotated[
        Positional[tuple[Path, ...]], arg(metavar="OUT", help_behavior_hint="(required)")
    ]
    """Folder of a result, or a recording; or of several results."""
    frame: Annotated[int | None, arguments.optional("N")] = None
    """Number of the frame. Default: the middle one."""
    open3d: bool = False
    """Open a window with hull and skeleton of one frame instead of the browser."""
    png: arguments.OptionalFile = None
    """PNG of one frame to be written instead; no screen is needed."""
    video: arguments.OptionalFile = None
    """WebM of all frames to be written instead; no screen is needed."""
    recording: Annotated[Path | None, arguments.optional("RECORDING")] = None
    """The recording, if it was moved after the fit."""
    voxel: Annotated[Annotated[float, Meta(ge=4e-3, le=0.2)] | None, arguments.optional("M")] = None
    """Edge of a voxel in metres. Default: that of the fit."""
    unit: arguments.Unit = None
    overwrite: arguments.OverwriteFile = False

    def run(self) -> None:
        """Shows or writes the scenes."""
        arguments.refuse_existing([self.png], self.overwrite, "--png")
        arguments.refuse_existing([self.video], self.overwrite, "--video")
        if not (self.open3d or self.png or self.video):
            self.address()  # refused before the work, not after
        if self.open3d:
            from voxelpose.view.open3d_import import import_open3d

            import_open3d(screen=True)  # before the work, not after
        from voxelpose.view.viewer.result_scenes import ResultScenes

        if not self.folders:
            raise InputError("name the folder of a result, or a recording: voxelpose view walk_fit")
        first, *more = self.folders
        if more and (self.open3d or self.png or self.video):
            raise InputError(
                "only the browser shows several results side by side: give one folder, or leave out"
                " --png, --video and --open3d"
            )
        scenes = ResultScenes(first, self.recording, self.voxel, self.unit)
        try:
            self._show(scenes)
        finally:
            scenes.close()

    def _show(self, scenes: ResultScenes) -> None:
        pictures = self.open3d or self.png is not None or self.video is not None
        if scenes.recording is None and (pictures or self.recording is not None):
            raise InputError(scenes.missing)
        for words in filter(None, (scenes.missing, scenes.changed)):
            print(f"note: {words}", flush=True)
        frame = self._frame(scenes, posed=pictures)
        if self.png is not None:
            from voxelpose.view.images.hull_picture import write_picture

            litres = write_picture(scenes, frame, self.png)
            print(
                f"{self.png}: frame {frame}, hull of {litres:.1f}"
                f" litres{' and skeleton' if scenes.motions else ''}"
            )
        if self.video is not None:
            from voxelpose.view.images.hull_picture import write_film

            with Progress() as progress:
                count = write_film(scenes, self.video, progress)
            print(f"{self.video}: {count} frames")
        if self.open3d:
            from voxelpose.view.images.hull_picture import hull_of, show_hull, skeleton_of

            scene = scenes.scene(frame)
            hull, title = hull_of(scene), f"{self.folders[0]} frame {frame}"
            show_hull(hull.grid, hull.occupancy, skeleton_of(scene), title)
        if not pictures:
            from voxelpose.view.viewer.browser import Browser
            from voxelpose.view.viewer.result_scenes import OtherResult

            others = [OtherResult.open(folder, scenes.fps) for folder in self.folders[1:]]
            if others and not scenes.motions:
                raise InputError(f"{self.folders[0]} is no result: only results stand side by side")
            title = ", ".join(map(str, self.folders))
            self.serve(title, Browser(scenes, self.address(), frame, others))

    def _frame(self, scenes: ResultScenes, posed: bool) -> int:
        """Returns the number of the frame to show; the middle one where none is given."""
        frames = [*scenes.time_s] if posed and scenes.motions else scenes.frames.tolist()
        if self.frame is None:
            return frames[len(frames) // 2]
        if self.frame not in frames:
            fault = "has no pose" if self.frame in scenes.frames else "is not there"
            raise InputError(
                f"frame {self.frame} {fault} in {self.folders[0]}: choose one from {frames[0]} to"
                f" {frames[-1]}"
            )
        return self.frame
