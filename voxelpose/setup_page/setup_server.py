"""The setup page's server, behind the same gate as all pages."""

from __future__ import annotations

import contextlib
import socket
import threading

import uvicorn

from calib.errors import InputError
from voxelpose.setup_page.page_requests import LARGEST_BODY
from voxelpose.setup_page.setup_app import setup_app
from voxelpose.setup_page.setup_session import SetupSession
from voxelpose.view.serving.gate import Address, Gate


class SetupServer:
    """Serves the page until it is closed.

    Attributes:
        url: address for the browser, the token included.
        port: of the gate.
    """

    def __init__(self, session: SetupSession, address: Address) -> None:
        """Starts, in threads of its own.

        Args:
            session: what is shown; closed with the server.
            address: of the gate.

        Raises:
            InputError: the address cannot be used.
        """
        self._session = session
        self._socket = socket.create_server(("127.0.0.1", 0))
        try:
            self._gate = Gate(address, self._socket.getsockname()[1], LARGEST_BODY)
        except BaseException:
            self._socket.close()
            raise
        config = uvicorn.Config(
            setup_app(session, self._gate.peers),
            access_log=False,
            h11_max_incomplete_event_size=32_768,
            http="h11",
            lifespan="off",
            log_config=None,
            log_level="critical",
            proxy_headers=False,
            server_header=False,
            timeout_graceful_shutdown=1,
            ws="none",
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(
            target=self._server.run, args=([self._socket],), name="setup page", daemon=True
        )
        self._thread.start()
        self.url, self.port = self._gate.url, self._gate.port

    def wait(self) -> None:
        """Waits until somebody interrupts.

        Raises:
            InputError: the server has ended by itself.
        """
        while self._thread.is_alive():
            self._thread.join(0.5)
        raise InputError("the page's server has ended: start the command again")

    def close(self) -> None:
        """Ends all connections and threads."""
        self._gate.close()
        self._server.should_exit = True
        self._thread.join(5.0)
        with contextlib.suppress(OSError):
            self._socket.close()
        self._session.close()
