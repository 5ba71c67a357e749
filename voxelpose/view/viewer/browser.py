"""The viewer in the browser: a page that plays what it was sent once, and asks for hulls and
pictures frame by frame.
"""

import threading
from collections.abc import Callable, Sequence
from shlex import quote
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from calib.camera import Rig
from calib.errors import InputError
from voxelpose.corrections import Correction, read_corrections
from voxelpose.export.html_player import player_page
from voxelpose.export.player_scene import Stage, player_scene
from voxelpose.results import correct
from voxelpose.view.serving.gate import Address, GatedServer, GateRequest, Reply
from voxelpose.view.serving.page_answers import Moment, Name, PageAnswers, Pixel, check_camera_names
from voxelpose.view.viewer.frame_answer import frame_answer, outlined_picture
from voxelpose.view.viewer.result_scenes import OtherResult, ResultScenes
from voxelpose.view.viewer.scene import OUTLYING_CM, Pictures
from voxelpose.view.viewer.silhouette_page import SilhouettePage

_HEAD = """<link rel="stylesheet" href="base.css">
<link rel="stylesheet" href="player.css">
<script type="module" src="viewer.js"></script>"""
_LARGEST_BODY = 10_000  # bytes that the page of silhouettes may be sent
_SILHOUETTES = "silhouettes"  # folder of that page


class Browser(GatedServer):
    """Serves scenes to browsers."""

    def __init__(
        self,
        scenes: ResultScenes,
        address: Address | None,
        frame: int,
        others: Sequence[OtherResult] = (),
        begin: Callable[[dict[str, str]], None] | None = None,
    ) -> None:
        """Starts the server, which shows a frame at first, and other results beside. The scenes are
        closed with it. Without an address it is a part of other pages, which pass requests on to
        `answer`, and `begin` a correction that takes long, by options of `voxelpose correct`.
        InputError where the address cannot be used.
        """
        self._others, self._frame, self._begin = others, frame, begin
        self._working = threading.Lock()
        self._show(scenes)
        self._answers = PageAnswers(
            "voxelpose.view.viewer",
            {
                "": lambda: player_page(f"{scenes.name} – voxelpose view", _HEAD),
                "api/scene": self._state,
                "api/frame": self._frame_answer,
                "picture/{camera}": self._picture,
            },
            {"api/corrections": self._correct, "api/fit_again": self._fit_again},
        )
        super().__init__(address, self._answer, self._close_scenes, _LARGEST_BODY)

    def _show(self, scenes: ResultScenes) -> None:
        self.scenes = scenes
        self._silhouettes = None if scenes.recording is None else SilhouettePage(scenes)

    def _close_scenes(self) -> None:
        with self._working:
            self.scenes.close()

    async def _answer(self, request: GateRequest) -> Reply:
        if self._silhouettes is not None and request.target.startswith(f"/{_SILHOUETTES}/"):
            return await self._silhouettes.answers.answer(request.below(1))
        return await self._answers.answer(request)

    def _state(self) -> dict[str, Any]:
        with self._working:
            if self._is_outdated():
                self._renew()
        scenes = self.scenes
        rig = Rig(tuple(view.pinhole for view in scenes.lenses.values()))
        frames = int(scenes.frames[0]), int(scenes.frames[-1]) + 1
        results = [(scenes.name, scenes.motions)]
        results += [(one.name, one.motions) for one in self._others]
        several = tuple((name, len(people)) for name, people in results) if self._others else ()
        motions = [motion for _, people in results for motion in people]
        names = sum((one.names for one in self._others), scenes.names)
        stage = Stage(scenes.name, rig, frames, names, several)
        scene = player_scene(motions, scenes.fps, stage)
        return scene | {
            "shown": min(max(self._frame, frames[0]), frames[1] - 1),
            "corrections": [
                {"words": str(one), "made": msgspec.to_builtins(one)} for one in scenes.corrections
            ],
            "people": scenes.people,
            "joints": scenes.joint_names,
            "folder": scenes.title,
            "recording": "" if scenes.recording is None else scenes.recording.folder.name,
            "far_mm": 10 * OUTLYING_CM,
            "carved": scenes.recording is not None and len(scenes.rig) > 1,
            "hypotheses": scenes.has_hypotheses,
            "filmed": scenes.recording is not None,
            "silhouettes": "" if self._silhouettes is None else _SILHOUETTES,
        }

    def _correct(self, corrections: list[Correction]) -> None:
        """Replaces the corrections of the first result, and shows it as it then is."""
        with self._working:
            if self._is_outdated():
                raise InputError("it was corrected meanwhile: load this page again")
            correct(self.scenes.home, corrections)
            self._renew()

    def _is_outdated(self) -> bool:
        return self.scenes.corrections != read_corrections(self.scenes.home)

    def _renew(self) -> None:
        self.scenes.close()
        self._show(self.scenes.reopened())

    def _fit_again(
        self,
        frames: tuple[Moment, Moment],
        camera: str = "",
        joint: str = "",
        pixels: Annotated[list[tuple[Name, Pixel, Pixel]], Meta(max_length=100)] | None = None,
    ) -> dict[str, str]:
        """Has frames, the first and one past the last, fitted again without a camera, or with a
        joint where pixels of pictures show it in the first; returns the `command` that does so,
        where nothing here does.
        """
        asked = {"fit_again": "{}:{}".format(*frames), "without": camera}
        if joint:
            check_camera_names([name for name, *_ in pixels or ()], self.scenes.rig.names)
            place_m = self.scenes.joint_place(joint, frames[0], pixels or ())
            asked = {
                "set_joints": " ".join([joint, str(frames[0]), *map("{:.3f}".format, place_m)])
            }
        if self._begin is not None:
            self._begin(asked)
            return {}
        options = (f"--{name.replace('_', '-')} {quote(words)}" for name, words in asked.items())
        return {"command": f"voxelpose correct {quote(str(self.scenes.home))} {' '.join(options)}"}

    def _frame_answer(
        self, frame: Moment, pictures: Pictures | Literal["none"] = "none"
    ) -> dict[str, Any]:
        self._check_frame(frame)
        with self._working:
            scene = self.scenes.scene(frame)
            return frame_answer(scene, None if pictures == "none" else pictures)

    def _picture(self, camera: str, frame: Moment, pictures: Pictures = "picture") -> bytes:
        """What a camera shows, large, with the outlines of the bodies."""
        names = list(self.scenes.rig.names)
        check_camera_names([camera], names)
        self._check_frame(frame)
        with self._working:
            scene = self.scenes.scene(frame)
            models = [motion.model for motion in self.scenes.motions]
            camera_frame = scene.camera_frames[names.index(camera)]
            picture = outlined_picture(scene, models, camera_frame, pictures)
        if picture is None:
            raise InputError(self.scenes.missing or "this camera has no picture")
        return picture

    def _check_frame(self, frame: int) -> None:
        first, last = self.scenes.frames[0], self.scenes.frames[-1]
        if not first <= frame <= last:
            raise InputError(f"there is no frame {frame}: it goes from {first} to {last}")
