"""The live page: a browser shows the people in the room, and its buttons ask the session."""

from __future__ import annotations

import time
from asyncio import StreamReader, StreamWriter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from msgspec import Struct

from calib.camera import Camera
from calib.errors import InputError
from voxelpose.export.html_player import player_page
from voxelpose.live.live_frame import LiveFrame
from voxelpose.live.live_scene import LiveScene
from voxelpose.live.senders import ReceiverState
from voxelpose.view.images.canvas import encoded
from voxelpose.view.serving.gate import Address, Gate, GatedServer, GateRequest
from voxelpose.view.serving.page_answers import (
    Content,
    PageAnswers,
    check_camera_names,
    json_content,
    parse_request,
    send_events,
    whole_number,
)

if TYPE_CHECKING:
    from voxelpose.live.session import LiveSession

_HEAD = """<link rel="stylesheet" href="player.css">
<link rel="stylesheet" href="live.css">
<script type="module" src="live.js"></script>"""
_LARGEST_BODY = 1000  # bytes
_MOST_PER_S = 15
_STATE_EVERY_MS = 400


class ControlAsked(Struct, forbid_unknown_fields=True):
    """What a button asks of the session."""

    word: Literal["background", "start", "stop", "record", "end recording"]


def controls_of(session: LiveSession) -> dict[str, Callable[[], None]]:
    """What may be asked of a session, by the words for it."""
    return {
        "background": session.learn_background,
        "start": session.start,
        "stop": session.stop,
        "record": session.record,
        "end recording": session.end_recording,
    }


class Page(GatedServer):
    """Serves the page; what it shows is made while somebody looks."""

    def __init__(
        self,
        session: LiveSession,
        rig: Sequence[Camera],
        address: Address,
        receivers: Callable[[], Sequence[ReceiverState]],
        title: str = "voxelpose live",
        people: int = 1,
    ) -> None:
        """Starts the server, see `Gate` for what it raises. The rig has a camera or more; the
        page's threads call the session's controls.
        """
        self._session, self._receivers, self._title = session, receivers, title
        self._scene, self._names = LiveScene(rig, people), [camera.name for camera in rig]
        self._frame: LiveFrame | None = None
        self._answers = PageAnswers("voxelpose.live", self._get, self._post)
        super().__init__(Gate(address, self._answer, _LARGEST_BODY), lambda: None)

    def show(self, frame: LiveFrame) -> None:
        """Hands over a frame, which replaces the one before; returns at once."""
        self._frame = frame

    async def _answer(
        self, request: GateRequest, reader: StreamReader, writer: StreamWriter
    ) -> None:
        if request.path == ("events",):
            await send_events(writer, self._events(), 1000 // _MOST_PER_S)
        else:
            await self._answers.serve(request, reader, writer)

    def _events(self) -> Iterator[dict[str, Any] | None]:
        """What a page that looks is told, again and again; None: nothing new."""
        sent, due_s = None, 0.0
        while True:
            frame, event = self._frame, {}
            if frame is not None and frame is not sent:
                event, sent = self._scene.moment(frame), frame
            if time.monotonic() >= due_s:
                due_s = time.monotonic() + _STATE_EVERY_MS / 1000
                event["state"] = self._state(frame)
            yield event or None

    def _state(self, frame: LiveFrame | None) -> dict[str, Any]:
        state = self._session.state
        people = (None,) if frame is None else frame.people
        return {
            "session": state,
            "pace": state.pace,
            "note": "" if frame is None else frame.note,
            "confidence": [None if body is None else body.confidence for body in people],
            "receivers": list(self._receivers()),
        }

    def _get(self, path: Sequence[str], query: Mapping[str, str]) -> Content | None:
        match path:
            case ():
                return player_page(self._title, _HEAD).encode(), "text/html; charset=utf-8"
            case ("api", "scene"):
                return json_content(self._scene.stage(self._title))
            case ("api", "body"):
                person = whole_number(query, "person") or 0
                if person >= len(self._scene.bodies):
                    raise InputError(f"there is no person {person}")
                return json_content(self._scene.bodies[person].content())
            case ("picture", camera):
                return self._picture(camera, "outlines" in query)
        return None

    def _picture(self, camera: str, outlines: bool) -> Content:
        check_camera_names([camera], self._names)
        frame = self._frame
        picture = None if frame is None else self._scene.picture(frame, camera, outlines)
        if picture is None:
            raise InputError(f"{camera} has no picture yet")
        return encoded(picture, ".jpg", 70), "image/jpeg"

    def _post(self, path: Sequence[str], body: bytes) -> Content | None:
        if tuple(path) != ("api", "ask"):
            return None
        controls_of(self._session)[parse_request(body, ControlAsked).word]()
        return json_content({})
