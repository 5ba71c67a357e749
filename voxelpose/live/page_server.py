"""viser's server behind the page's gate."""

from __future__ import annotations

import io
from contextlib import redirect_stdout
from urllib.parse import quote

import viser
from viser import infra
from viser._messages import ShareUrlRequest

from voxelpose.live.gate import Gate, check_access
from voxelpose.view.viewer.browser import Address


class PageServer:
    """Serves viser's scene and panel to those whom the gate lets pass.

    viser has no access control. It listens at a free port of 127.0.0.1, sends nothing to a
    connection that does not come from the gate, and opens no public tunnel for anybody.

    Attributes:
        viser: the server of scene and panel.
        gate: before it.
    """

    def __init__(self, address: Address, token: str | None) -> None:
        """Starts both.

        Args:
            address: of the gate.
            token: see `Gate`.

        Raises:
            InputError: see `Gate`.
        """
        check_access(address.host, token)
        with redirect_stdout(io.StringIO()):  # viser would print a banner
            self.viser = viser.ViserServer("127.0.0.1", 0, label="voxelpose", verbose=False)
        try:
            self.gate = Gate(address.host, address.port, token, self.viser.get_port())
            self._turn_strangers_away()
        except BaseException:
            self._stop_viser()
            raise
        self._token = token

    @property
    def url(self) -> str:
        """Address for the browser, the token included."""
        host = "localhost" if self.gate.host in ("0.0.0.0", "::", "") else self.gate.host
        query = f"/?token={quote(self._token, safe='')}" if self._token is not None else ""
        name = f"[{host}]" if ":" in host else host
        return f"http://{name}:{self.gate.port}{query}"

    @property
    def watched(self) -> bool:
        """Whether any browser shows the page."""
        return bool(self.viser.get_clients())

    def close(self) -> None:
        """Ends all connections and threads."""
        self.gate.close()
        self._stop_viser()

    def _turn_strangers_away(self) -> None:
        """Lets viser close connections that do not come from the gate, before it sends anything.

        Otherwise every program of this machine, and every site in its browsers, could read the
        cameras' pictures by trying viser's port.
        """
        server = self.viser._websock_server
        links, peers = server._live_connections, self.gate.peers

        async def guard(client: infra.WebsockClientConnection) -> None:
            link = links[client.client_id]
            if tuple(link.remote_address[:2]) not in peers:
                await link.close(1008, "Open the page through its gate.")

        server._client_connect_cb.insert(0, guard)
        server.disconnect_all_clients()  # who came before the guard
        # A page may ask viser for an address that anybody in the world can open.
        server.unregister_handler(ShareUrlRequest)

    def _stop_viser(self) -> None:
        with redirect_stdout(io.StringIO()):
            self.viser.stop()
