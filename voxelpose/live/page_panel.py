"""The page's panel: buttons, texts, and the choice of what is shown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import viser

from voxelpose.live.live_frame import Controls, LiveFrame
from voxelpose.live.live_scene import ShownLayers
from voxelpose.live.page_texts import links_html, status_html, timings_html
from voxelpose.live.sender import ReceiverState

_LAYERS = {
    "figure": "Person",
    "cameras": "Cameras",
    "pictures": "Pictures",
    "outlines": "Outlines",
    "hull": "Voxels",
    "hypotheses": "Other poses",
}
_RECORD, _END = "Record", "End recording"


class PagePanel:
    """Buttons that ask the session, and texts about it.

    Attributes:
        layers: the user's choice of what is shown.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        controls: Controls,
        receivers: Callable[[], Sequence[ReceiverState]],
    ) -> None:
        """Makes the panel.

        Args:
            gui: viser's.
            controls: of the session.
            receivers: returns their states.
        """
        self.layers = ShownLayers()
        self._controls, self._receivers = controls, receivers
        gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        self._status = gui.add_html("")
        self._button(
            gui, "Background", viser.Icon.PHOTO, "Learns the empty room", controls.learn_background
        )
        self._button(gui, "Start", viser.Icon.PLAYER_PLAY, "Looks for a person", controls.start)
        self._button(gui, "Stop", viser.Icon.PLAYER_STOP, "The cameras go on", controls.stop)
        self._record = gui.add_button(_RECORD, icon=viser.Icon.PLAYER_RECORD, color="red")
        self._record.on_click(lambda _: self._toggle_recording())
        with gui.add_folder("Now"):
            self._timings = gui.add_html("")
        with gui.add_folder("Cameras and receivers"):
            self._links = gui.add_html("")
        with gui.add_folder("Show"):
            for name, label in _LAYERS.items():
                self._add_layer(gui, name, label)

    def update(self, frame: LiveFrame | None) -> None:
        """Shows the session's state; what has not changed is not sent again."""
        state = self._controls.state
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

    def _button(
        self,
        gui: viser.GuiApi,
        label: str,
        icon: viser.IconName,
        hint: str,
        ask: Callable[[], None],
    ) -> None:
        button = gui.add_button(label, icon=icon, hint=hint)
        button.on_click(lambda _: ask())

    def _toggle_recording(self) -> None:
        if self._controls.state.recording:
            self._controls.end_recording()
        else:
            self._controls.record()

    def _add_layer(self, gui: viser.GuiApi, name: str, label: str) -> None:
        box = gui.add_checkbox(label, getattr(self.layers, name))

        def choose(_: object) -> None:
            self.layers = replace(self.layers, **{name: box.value})

        box.on_update(choose)
