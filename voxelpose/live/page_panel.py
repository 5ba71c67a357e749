"""The page's panel: buttons, texts, and the choice of what is shown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import viser

from voxelpose.live.live_frame import LiveFrame
from voxelpose.live.live_scene import LAYERS
from voxelpose.live.page_texts import links_html, status_html, timings_html
from voxelpose.live.sender import ReceiverState

if TYPE_CHECKING:
    from voxelpose.live.session import LiveSession

_RECORD, _END = "Record", "End recording"


class PagePanel:
    """Buttons that ask the session, and texts about it.

    Attributes:
        shown: names of the layers that the user has chosen to see.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        session: LiveSession,
        receivers: Callable[[], Sequence[ReceiverState]],
    ) -> None:
        """Makes the panel.

        Args:
            session: asked from threads of the page.
            receivers: returns their states.
        """
        self.shown = frozenset(LAYERS)
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
            self.shown = self.shown | {name} if box.value else self.shown - {name}

        box.on_update(choose)
