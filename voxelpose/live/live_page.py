"""The live page: a browser shows the people in the room, and its buttons ask the session."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING

import viser

from calib.camera import Camera
from voxelpose.live.live_frame import LiveFrame, Phase, SessionState
from voxelpose.live.live_scene import LAYERS, LiveScene
from voxelpose.live.senders import ReceiverState
from voxelpose.view.serving.gate import Address
from voxelpose.view.serving.page_server import PageServer
from voxelpose.view.viewer.legend import css_colour, person_colour

if TYPE_CHECKING:
    from voxelpose.live.session import LiveSession


_GOOD, _BAD, _BUSY, _IDLE = "#2f9e5b", "#d5432a", "#e0a020", "#8a929c"
_PHASE_COLOURS: dict[Phase, str] = {
    "no background": _BAD,
    "countdown": _BUSY,
    "learning": _BUSY,
    "searching": _BUSY,
    "following": _GOOD,
    "stopped": _IDLE,
}
_BLOCK = '<div style="padding:0 0.9em 0.7em;font-size:0.85em;line-height:1.55">{}</div>'
_BAR = (
    '<div style="display:flex;align-items:center;gap:0.5em">'
    '<span style="flex:0 0 7.5em;overflow:hidden;text-overflow:ellipsis">{}</span>'
    '<span style="flex:1;height:0.5em;border-radius:0.25em;background:rgba(128,128,128,0.18)">'
    '<span style="display:block;width:{:.0f}%;height:100%;border-radius:0.25em;'
    'background:#5492d6"></span></span>'
    '<span style="flex:0 0 4.2em;text-align:right">{:.1f} ms</span></div>'
)
_RECORD, _END = "Record", "End recording"
_MOST_PER_S = 15


def status_html(state: SessionState, note: str) -> str:
    """What the session is doing, and what it says of the last frame."""
    colour = _PHASE_COLOURS.get(state.phase, _IDLE)
    recording = (
        f' <span style="color:{_BAD};font-weight:600">● recording</span>' if state.recording else ""
    )
    lines = [
        f'<span style="color:{colour};font-weight:700">{escape(state.phase)}</span>{recording}',
        escape(state.message),
        escape(state.pace),
    ]
    if note:
        lines.append(f"⚠ {escape(note)}")
    return _BLOCK.format("".join(f"<div>{line}</div>" for line in lines if line))


def timings_html(state: SessionState, frame: LiveFrame | None) -> str:
    """Speed, latency, dropped frames, and the time of each stage as a bar."""
    latency = f"{1000 * state.latency_s:.0f} ms" if math.isfinite(state.latency_s) else "–"
    people = (None,) if frame is None else frame.people
    sure = [f"{100 * body.confidence:.0f} %" if body else "–" for body in people]
    facts = {
        "frames per second": f"{state.fps:.1f} of {state.arriving_fps:.1f}",
        "latency": latency,
        "frames": f"{state.frames}, {state.dropped} dropped",
    }
    if len(people) == 1:
        facts["confidence"] = sure[0]
    for k, confidence in enumerate(sure if len(people) > 1 else ()):
        mark = f'<span style="color:{css_colour(person_colour(k))}">●</span>'
        facts[f"{mark} confidence of person {k + 1}"] = confidence
    rows = "".join(
        f'<div style="display:flex;justify-content:space-between"><span>{name}</span>'
        f"<b>{value}</b></div>"
        for name, value in facts.items()
    )
    return _BLOCK.format(rows + _bars(state.stage_s))


def links_html(cameras: Mapping[str, str], receivers: Sequence[ReceiverState]) -> str:
    """State of each camera and receiver."""
    rows = [_state_line(name, text, text == "ok") for name, text in cameras.items()]
    for state in receivers:
        counts = f"{state.sent} sent, {state.dropped} dropped"
        if math.isfinite(state.send_s):
            counts += f", {1000 * state.send_s:.1f} ms"
        rows.append(_state_line(state.address, f"{state.message} ({counts})", state.working))
    return _BLOCK.format("".join(rows) or "none")


def _bars(stage_s: Mapping[str, float]) -> str:
    longest = max([0.04, *stage_s.values()])  # bars are as long as 40 ms at least
    return "".join(
        _BAR.format(escape(name), 100 * seconds / longest, 1000 * seconds)
        for name, seconds in stage_s.items()
        if math.isfinite(seconds)
    )


def _state_line(name: str, text: str, good: bool) -> str:
    return (
        f'<div><span style="color:{_GOOD if good else _BAD}">●</span> <b>{escape(name)}</b>'
        f" {escape(text)}</div>"
    )


class PagePanel:
    """Buttons that ask the session, texts about it, and the `layers` chosen to be shown."""

    def __init__(
        self,
        gui: viser.GuiApi,
        session: LiveSession,
        receivers: Callable[[], Sequence[ReceiverState]],
    ) -> None:
        self.layers = frozenset(LAYERS)
        self._session, self._receivers = session, receivers
        self._status = gui.add_html("")
        for label, icon, hint, ask in (
            ("Background", viser.Icon.PHOTO, "Learns the empty room", session.learn_background),
            ("Start", viser.Icon.PLAYER_PLAY, "Looks for a person", session.start),
            ("Stop", viser.Icon.PLAYER_STOP, "The cameras go on", session.stop),
        ):
            gui.add_button(label, icon=icon, hint=hint).on_click(lambda _, ask=ask: ask())
        self._record = gui.add_button(_RECORD, icon=viser.Icon.PLAYER_RECORD, color="red")
        self._record.on_click(lambda _: self._toggle_recording())
        with gui.add_folder("Now"):
            self._timings = gui.add_html("")
        with gui.add_folder("Cameras and receivers"):
            self._links = gui.add_html("")
        with gui.add_folder("Show"):
            for name, label in LAYERS.items():
                self._add_layer(gui, name, label)

    def update(self, frame: LiveFrame | None) -> None:
        """Shows the session's state; what has not changed is not sent again."""
        state = self._session.state
        texts = (
            (self._status, status_html(state, frame.note if frame is not None else "")),
            (self._timings, timings_html(state, frame)),
            (self._links, links_html(state.cameras, self._receivers())),
        )
        for handle, text in texts:
            if handle.content != text:
                handle.content = text
        label = _END if state.recording else _RECORD
        if self._record.label != label:
            self._record.label = label

    def _toggle_recording(self) -> None:
        if self._session.state.recording:
            self._session.end_recording()
        else:
            self._session.record()

    def _add_layer(self, gui: viser.GuiApi, name: str, label: str) -> None:
        box = gui.add_checkbox(label, True)

        def choose(_: object) -> None:
            self.layers = self.layers | {name} if box.value else self.layers - {name}

        box.on_update(choose)


class Page:
    """Serves the page, and draws the newest frame in a thread of its own while somebody looks."""

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
        self._served = PageServer(address, title)
        self.url, self.port = self._served.url, self._served.port
        try:
            self._panel = PagePanel(self._served.viser.gui, session, receivers)
            self._scene = LiveScene(self._served.viser, rig, people)
        except BaseException:
            self._served.close()
            raise
        self._frame: LiveFrame | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live page", daemon=True)
        self._thread.start()

    def show(self, frame: LiveFrame) -> None:
        """Hands over a frame, which replaces one that is not drawn yet; returns at once."""
        self._frame = frame

    def close(self) -> None:
        """Stops server and threads."""
        if self._closing.is_set():
            return
        self._closing.set()
        self._thread.join()
        self._served.close()

    def _run(self) -> None:
        drawn: tuple[LiveFrame | None, frozenset[str]] | None = None
        texts_s, texts_due_s = 0.4, 0.0
        begun_s = time.monotonic()
        while not self._closing.wait(max(0.0, begun_s + 1 / _MOST_PER_S - time.monotonic())):
            begun_s = time.monotonic()
            frame = self._frame
            if self._served.watched:
                chosen = frame, self._panel.layers
                with self._served.viser.atomic():
                    if frame is not None and chosen != drawn:
                        self._scene.draw(frame, chosen[1])
                    if begun_s >= texts_due_s:
                        self._panel.update(frame)
                        texts_due_s = begun_s + texts_s
                drawn = chosen
            else:
                drawn = None
