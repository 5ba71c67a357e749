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
from voxelpose.view.serving.gate import Gate, check_access

_HOST = "127.0.0.1"


class SetupServer:
    """Serves the page until it is closed.

    Attributes:
        url: address for the browser, the token included.
        port: of the gate.
    """

    def __init__(self, session: SetupSession, host: str, port: int, token: str | None) -> None:
        """Starts, in threads of its own.

        Args:
            session: what is shown; closed with the server.
            host: where the gate listens.
            port: the first free one from this number on is used; 0: any.
            token: see `Gate`.

        Raises:
            InputError: other machines could see the page without a token, or the address cannot be
                used.
        """
        check_access(host, token)
        self._session = session
        self._socket = socket.create_server((_HOST, 0))
        try:
            inner_port = self._socket.getsockname()[1]
            self._gate = Gate(host, port, token, inner_port, LARGEST_BODY)
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
