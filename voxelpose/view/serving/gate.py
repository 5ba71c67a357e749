"""The gate before every page: it listens, and checks each request before it answers anything.

A connection carries one request: a page's file, JSON that a page sends where it may, or the upgrade
to a WebSocket and all that follows. Those that may pass go to who answers them.
"""

import asyncio
import secrets
import socket
import threading
from asyncio import StreamReader, StreamWriter
from collections.abc import Awaitable, Callable
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from urllib.parse import quote

from calib.errors import InputError
from voxelpose.view.serving.gate_request import GateKeys, GateRequest, Reply, is_loopback

_HEAD_BYTES = 16384
_HEAD_S = 10
_MOST_LINKS = 100
_MOST_PORTS = 20
_LEAST_TOKEN = 8
_LAST_PORT = 65_535

Handler = Callable[[GateRequest, StreamReader, StreamWriter], Awaitable[None]]
"""Answers a request that may pass: reads what follows its head, and writes."""


@dataclass(frozen=True)
class Address:
    """Where a page is served, and to whom.

    Attributes:
        host: name or number; "localhost" for this machine only, "0.0.0.0" for all that reach it.
        port: the first free one from this number on is used, of twenty; 0: any.
        token: who wants to see the page must know it; None: only this machine's own addresses.

    Raises:
        InputError: other machines could see the page without a token; the token is short; or there
            is no such port.
    """

    host: str = "localhost"
    port: int = 8080
    token: str | None = None

    def __post_init__(self) -> None:
        """Checks who could see the page."""
        if self.token is None and not is_loopback(self.host):
            raise InputError(
                f"--host {self.host} shows the cameras to other machines: protect the page with"
                " --token TOKEN, a word that only its viewers know"
            )
        if self.token is not None and len(self.token) < _LEAST_TOKEN:
            raise InputError(f"--token is short: take at least {_LEAST_TOKEN} characters")
        if not 0 <= self.port <= _LAST_PORT:  # the system may take it for another
            raise InputError(
                f"--port {self.port}: ports are numbers from 1 to {_LAST_PORT}: choose another"
            )


class Gate:
    """Lets requests pass that may.

    Attributes:
        port: where it listens.
    """

    def __init__(self, address: Address, handle: Handler, largest_body: int = 0) -> None:
        """Listens, from a thread of its own.

        Args:
            address: where, and who may pass.
            handle: answers what may pass, in that thread.
            largest_body: bytes of JSON that a page may send with one request; 0: none.

        Raises:
            InputError: the address cannot be used.
        """
        self._address, self._handle, self._largest_body = address, handle, largest_body
        self._passed = 0
        self._tasks: set[asyncio.Task[None]] = set()
        self._loop = asyncio.new_event_loop()
        self._stopped = asyncio.Event()
        ready: Future[int] = Future()
        self._thread = threading.Thread(
            target=self._run, args=(ready,), name="gate of the page", daemon=True
        )
        self._thread.start()
        try:
            self.port = ready.result()
        except (OSError, OverflowError) as error:
            self._thread.join()
            raise InputError(
                f"--host {address.host} --port {address.port}: the page cannot be served there"
                f" ({getattr(error, 'strerror', None) or error}): choose another"
            ) from None

    @property
    def url(self) -> str:
        """Address for the browser, the token included."""
        host, token = self._address.host, self._address.token
        host = "localhost" if host in ("0.0.0.0", "::", "") else host
        query = f"/?token={quote(token, safe='')}" if token is not None else ""
        name = f"[{host}]" if ":" in host else host
        return f"http://{name}:{self.port}{query}"

    def close(self) -> None:
        """Ends all connections and the thread."""
        with suppress(RuntimeError):  # closed already
            self._loop.call_soon_threadsafe(self._stopped.set)
        self._thread.join()

    def _run(self, ready: Future[int]) -> None:
        try:
            self._loop.run_until_complete(self._serve(ready))
        finally:
            self._loop.close()

    async def _serve(self, ready: Future[int]) -> None:
        try:
            server = await self._listen()
        except (OSError, OverflowError) as error:
            ready.set_exception(error)
            return
        port = int(server.sockets[0].getsockname()[1])
        # Browsers send cookies to all ports of a host: the name tells sessions apart.
        self._keys = GateKeys(self._address.token, f"voxelpose_{port}", secrets.token_urlsafe(32))
        ready.set_result(port)
        await self._stopped.wait()
        server.close()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _listen(self) -> asyncio.Server:
        host, port = self._address.host, self._address.port
        last = port + _MOST_PORTS - 1
        while True:
            try:
                return await asyncio.start_server(self._meet, host, port, limit=_HEAD_BYTES)
            except socket.gaierror:  # no such name: every port would say so, and slowly
                raise
            except OSError:
                if port in (0, last):
                    raise
                port += 1

    async def _meet(self, reader: StreamReader, writer: StreamWriter) -> None:
        task = asyncio.current_task()
        if task is None or len(self._tasks) >= 2 * _MOST_LINKS:
            writer.close()
            return
        self._tasks.add(task)
        try:
            await self._answer(reader, writer)
        except (OSError, asyncio.CancelledError):
            pass  # the other side is gone, or the session ends
        finally:
            self._tasks.discard(task)
            writer.close()

    async def _answer(self, reader: StreamReader, writer: StreamWriter) -> None:
        try:
            async with asyncio.timeout(_HEAD_S):
                head = await reader.readuntil(b"\r\n\r\n")
            request = GateRequest.parse(head)
            reply = request.reply(self._keys, self._largest_body)
        except (ValueError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, TimeoutError):
            reply = Reply("400 Bad Request", "This is not understood.")
        else:
            if reply is None and self._passed >= _MOST_LINKS:
                reply = Reply("503 Service Unavailable", "Too many pages are open: close some.")
            if reply is None:
                self._passed += 1
                try:
                    await self._handle(request, reader, writer)
                finally:
                    self._passed -= 1
                return
        if reply.status.startswith("401"):
            await asyncio.sleep(0.2)  # slows down who tries many
        writer.write(reply.encoded())
        await writer.drain()
