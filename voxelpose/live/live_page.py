"""The live page: a browser shows the person in the room, and its buttons ask the session."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from calib.camera import Camera
from voxelpose.live.live_frame import LiveFrame
from voxelpose.live.live_scene import LiveScene
from voxelpose.live.page_panel import PagePanel
from voxelpose.live.senders import ReceiverState
from voxelpose.view.serving.gate import Address
from voxelpose.view.serving.page_server import PageServer

if TYPE_CHECKING:
    from voxelpose.live.session import LiveSession

_MOST_PER_S = 15


class Page:
    """Serves the page, and draws the newest frame in a thread of its own while somebody looks."""

    def __init__(
        self,
        session: LiveSession,
        rig: Sequence[Camera],
        address: Address,
        receivers: Callable[[], Sequence[ReceiverState]],
    ) -> None:
        """Starts the server.

        Args:
            session: whose controls are called from threads of the page.
            rig: the cameras, at least one.

        Raises:
            InputError: see `Gate`.
        """
        self._served = PageServer(address)
        try:
            self._panel = PagePanel(self._served.viser.gui, session, receivers)
            self._scene = LiveScene(self._served.viser, rig)
        except BaseException:
            self._served.close()
            raise
        self._changed = threading.Condition()
        self._frame: LiveFrame | None = None
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="live page", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Address for the browser, the token included."""
        return self._served.url

    def show(self, frame: LiveFrame) -> None:
        """Hands over a frame, which replaces one that is not drawn yet; returns at once."""
        with self._changed:
            self._frame = frame
            self._changed.notify()

    def close(self) -> None:
        """Stops server and threads."""
        with self._changed:
            if self._closing:
                return
            self._closing = True
            self._changed.notify()
        self._thread.join()
        self._served.close()

    def _run(self) -> None:
        drawn: tuple[LiveFrame | None, frozenset[str]] | None = None
        texts_s, texts_due_s = 0.4, 0.0
        while True:
            with self._changed:
                if self._frame is None or (drawn is not None and self._frame is drawn[0]):
                    self._changed.wait(texts_s / 2)
                if self._closing:
                    return
                frame = self._frame
            begun_s = time.monotonic()
            if self._served.watched:
                chosen = frame, self._panel.shown
                with self._served.viser.atomic():
                    if frame is not None and chosen != drawn:
                        self._scene.draw(frame, chosen[1])
                    if begun_s >= texts_due_s:
                        self._panel.update(frame)
                        texts_due_s = begun_s + texts_s
                drawn = chosen
            else:
                drawn = None
            self._wait(begun_s + 1 / _MOST_PER_S)

    def _wait(self, until_s: float) -> None:
        """Sleeps, but ends at once when the page is closed."""
        with self._changed:
            while not self._closing and (rest := until_s - time.monotonic()) > 0:
                self._changed.wait(rest)
