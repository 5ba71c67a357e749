"""viser's server behind the page's gate."""

from __future__ import annotations

import io
from contextlib import redirect_stdout

import viser

from voxelpose.view.serving.gate import Address, Gate
from voxelpose.view.serving.viser_internals import guard_connections


class PageServer:
    """Serves viser's scene and panel to those whom the gate lets pass.

    viser has no access control. It listens at a free port of 127.0.0.1, sends nothing to a
    connection that does not come from the gate, and opens no public tunnel for anybody.

    Attributes:
        viser: the server of scene and panel.
        gate: before it.
    """

    def __init__(self, address: Address) -> None:
        """Starts both.

        Args:
            address: of the gate.

        Raises:
            InputError: see `Gate` and `guard_connections`.
        """
        with redirect_stdout(io.StringIO()):  # viser would print a banner
            self.viser = viser.ViserServer("127.0.0.1", 0, label="voxelpose", verbose=False)
        try:
            self.gate = Gate(address, self.viser.get_port())
        except BaseException:
            self._stop_viser()
            raise
        try:
            guard_connections(self.viser, self.gate.peers)
        except BaseException:
            self.close()
            raise
        gui = self.viser.gui
        gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()

    @property
    def url(self) -> str:
        """Address for the browser, the token included."""
        return self.gate.url

    @property
    def watched(self) -> bool:
        """Whether any browser shows the page."""
        return bool(self.viser.get_clients())

    def close(self) -> None:
        """Ends all connections and threads."""
        self.gate.close()
        self._stop_viser()

    def _stop_viser(self) -> None:
        with redirect_stdout(io.StringIO()):
            self.viser.stop()
