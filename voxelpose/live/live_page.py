"""The live page: a browser shows the people in the room, and its buttons ask the session."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Literal

from calib.camera import Camera
from calib.errors import InputError
from voxelpose.export.html_player import player_page
from voxelpose.live.live_frame import LiveFrame
from voxelpose.live.live_scene import LiveScene
from voxelpose.live.senders import ReceiverState
from voxelpose.view.images.canvas import encoded
from voxelpose.view.serving.gate import Address, GatedServer
from voxelpose.view.serving.page_answers import (
    Moment,
    PageAnswers,
    check_camera_names,
    event_stream,
)

if TYPE_CHECKING:
    from voxelpose.live.session import LiveSession

_HEAD = """<link rel="stylesheet" href="base.css">
<link rel="stylesheet" href="player.css">
<link rel="stylesheet" href="live.css">
<script type="module" src="live.js"></script>"""
_LARGEST_BODY = 1000  # bytes
_MOST_PER_S = 15
_STATE_EVERY_MS = 400


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
        self._session, self._receivers = session, receivers
        self._scene, self._names = LiveScene(rig, people), [camera.name for camera in rig]
        self._frame: LiveFrame | None = None
        answers = PageAnswers(
            "voxelpose.live",
            {
                "": lambda: player_page(title, _HEAD),
                "events": lambda: event_stream(self._events(), 1000 // _MOST_PER_S),
                "api/scene": lambda: self._scene.stage(title),
                "api/body": self._body,
                "picture/{camera}": self._picture,
            },
            {"api/ask": self._ask},
        )
        super().__init__(address, answers.answer, lambda: None, _LARGEST_BODY)

    def show(self, frame: LiveFrame) -> None:
        """Hands over a frame, which replaces the one before; returns at once."""
        self._frame = frame

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

    def _body(self, person: Moment = 0) -> dict[str, Any]:
        if person >= len(self._scene.bodies):
            raise InputError(f"there is no person {person}")
        return self._scene.bodies[person].content()

    def _picture(self, camera: str, outlines: str = "") -> bytes:
        check_camera_names([camera], self._names)
        frame = self._frame
        picture = None if frame is None else self._scene.picture(frame, camera, bool(outlines))
        if picture is None:
            raise InputError(f"{camera} has no picture yet")
        return encoded(picture, ".jpg", 70)

    def _ask(self, word: Literal["background", "start", "stop", "record", "end recording"]) -> None:
        controls_of(self._session)[word]()
