"""viser's server behind the page's gate."""

import asyncio
import io
from asyncio import StreamReader, StreamWriter
from contextlib import redirect_stdout

import viser

from voxelpose.view.serving.gate import Address, Gate
from voxelpose.view.serving.gate_request import GateRequest
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
        self._peers: set[tuple[str, int]] = set()
        try:
            guard_connections(self.viser, self._peers)
            self.gate = Gate(address, self._relay)
        except BaseException:
            self._stop_viser()
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

    async def _relay(
        self, request: GateRequest, reader: StreamReader, writer: StreamWriter
    ) -> None:
        """Passes a request on, then the answer, and for a WebSocket whatever follows either way."""
        port = self.viser.get_port()
        inner_reader, inner_writer = await asyncio.open_connection("127.0.0.1", port)
        own = inner_writer.get_extra_info("sockname")[:2]
        self._peers.add(own)
        try:
            inner_writer.write(request.head)
            ways = [asyncio.create_task(_copy(inner_reader, writer))]
            if request.upgrade:
                ways.append(asyncio.create_task(_copy(reader, inner_writer)))
            try:
                await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for way in ways:
                    way.cancel()
                await asyncio.gather(*ways, return_exceptions=True)
        finally:
            inner_writer.close()
            self._peers.discard(own)


async def _copy(reader: StreamReader, writer: StreamWriter) -> None:
    while data := await reader.read(65536):
        writer.write(data)
        await writer.drain()
