"""The viewer in the browser: a page that plays what it was sent once, and asks for hulls and
pictures frame by frame.
"""

import threading
from asyncio import StreamReader, StreamWriter
from collections.abc import Mapping, Sequence
from typing import Any, get_args

from calib.camera import Rig
from calib.errors import InputError
from voxelpose.export.html_player import player_page
from voxelpose.export.player_scene import Stage, player_scene
from voxelpose.view.serving.gate import Address, Gate, GatedServer, GateRequest
from voxelpose.view.serving.page_answers import (
    Content,
    PageAnswers,
    check_camera_names,
    json_content,
    whole_number,
)
from voxelpose.view.viewer.frame_answer import area_answer, frame_answer, outlined_picture
from voxelpose.view.viewer.legend import OUTLYING_CM
from voxelpose.view.viewer.result_scenes import OtherResult, ResultScenes
from voxelpose.view.viewer.scene import Pictures
from voxelpose.view.viewer.silhouette_page import FOLDER, SilhouettePage

_HEAD = """<link rel="stylesheet" href="player.css">
<script type="module" src="viewer.js"></script>"""
_LARGEST_BODY = 10_000  # bytes that the page of silhouettes may be sent


class Browser(GatedServer):
    """Serves scenes to browsers."""

    def __init__(
        self,
        scenes: ResultScenes,
        address: Address | None,
        frame: int,
        others: Sequence[OtherResult] = (),
    ) -> None:
        """Starts the server, which shows a frame at first, and other results beside. The scenes are
        closed with it. Without an address it is a part of other pages, which pass requests on to
        `answer`. InputError where the address cannot be used.
        """
        self._others = others
        self.scenes, self._frame = scenes, frame
        self._working = threading.Lock()
        self._silhouettes = None if scenes.recording is None else SilhouettePage(scenes)
        self._answers = PageAnswers("voxelpose.view.viewer", self._get, lambda *_: None)
        body = 0 if self._silhouettes is None else _LARGEST_BODY
        gate = None if address is None else Gate(address, self.answer, body)
        super().__init__(gate, self._close_scenes)

    def _close_scenes(self) -> None:
        with self._working:
            self.scenes.close()

    async def answer(
        self, request: GateRequest, reader: StreamReader, writer: StreamWriter
    ) -> None:
        """Answers a request that may pass; its path is as below this page."""
        beside = None if self._silhouettes is None else self._silhouettes.answers
        if beside is not None and beside.answers(request):
            await beside.serve(request, reader, writer)
        else:
            await self._answers.serve(request, reader, writer)

    def _get(self, path: Sequence[str], query: Mapping[str, str]) -> Content | None:
        match path:
            case ():
                return self._page()
            case ("api", "scene"):
                return json_content(self._state())
            case ("api", "frame"):
                with self._working:
                    scene = self.scenes.scene(self._requested_frame(query))
                    return json_content(frame_answer(scene, _pictures(query)))
            case ("api", "area"):
                return json_content(self._area(query))
            case ("picture", camera):
                return self._picture(camera, query)
        return None

    def _page(self) -> Content:
        page = player_page(f"{self.scenes.name} – voxelpose view", _HEAD)
        return page.encode(), "text/html; charset=utf-8"

    def _state(self) -> dict[str, Any]:
        scenes = self.scenes
        rig = Rig(tuple(view.pinhole for view in scenes.lenses.values()))
        frames = int(scenes.frames[0]), int(scenes.frames[-1]) + 1
        results = [(scenes.name, scenes.motions)]
        results += [(one.name, one.motions) for one in self._others]
        several = tuple((name, len(people)) for name, people in results) if self._others else ()
        motions = [motion for _, people in results for motion in people]
        scene = player_scene(motions, scenes.fps, Stage(scenes.name, rig, frames, several))
        return scene | {
            "shown": self._frame,
            "folder": scenes.title,
            "limbs": list(scenes.limb_names),
            "far_mm": 10 * OUTLYING_CM,
            "carved": scenes.recording is not None and len(scenes.rig) > 1,
            "hypotheses": scenes.has_hypotheses,
            "filmed": scenes.recording is not None,
            "silhouettes": "" if self._silhouettes is None else FOLDER,
        }

    def _area(self, query: Mapping[str, str]) -> Any:
        frame, part = self._requested_frame(query), query.get("part", "")
        if part not in self.scenes.limb_names:
            raise InputError(f"there is no movable area of a part {part[:40]!r}")
        with self._working:
            return area_answer(part, self.scenes.areas(frame), self.scenes.scene(frame).hull)

    def _picture(self, camera: str, query: Mapping[str, str]) -> Content:
        """What a camera shows, large, with the outlines of the bodies."""
        names = list(self.scenes.rig.names)
        check_camera_names([camera], names)
        with self._working:
            scene = self.scenes.scene(self._requested_frame(query))
            models = [motion.model for motion in self.scenes.motions]
            camera_frame, kind = scene.camera_frames[names.index(camera)], _pictures(query)
            picture = outlined_picture(scene, models, camera_frame, kind or "picture")
        if picture is None:
            raise InputError(self.scenes.missing or "this camera has no picture")
        return picture, "image/jpeg"

    def _requested_frame(self, query: Mapping[str, str]) -> int:
        frame, frames = whole_number(query, "frame"), self.scenes.frames
        if frame is None or not frames[0] <= frame <= frames[-1]:
            raise InputError(f"there is no frame {frame}: it goes from {frames[0]} to {frames[-1]}")
        return frame


def _pictures(query: Mapping[str, str]) -> Pictures | None:
    asked = query.get("pictures", "")
    return next((kind for kind in get_args(Pictures) if kind == asked), None)
