"""The gate before every page: it listens, and checks each request before it answers anything.

A connection carries one request: for a page's file, or with JSON or a file that a page sends where
it may. Those that may pass go to who answers them.
"""

from __future__ import annotations

import asyncio
import hmac
import ipaddress
import secrets
import socket
import threading
from asyncio import StreamReader, StreamWriter
from collections.abc import Awaitable, Callable, Coroutine, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any
from urllib.parse import parse_qsl, quote, unquote, urlencode, urlsplit

from calib.errors import InputError

UNFRAMED = "frame-ancestors 'none'"
"""Policy of every page: none is shown within another's, whose visitors would press its buttons."""
_SINGLE = ("host", "origin", "upgrade", "content-length", "transfer-encoding")
_FILE = "application/octet-stream"
_HEAD_BYTES = 16384
_HEAD_S = 10
_PIECE = 2**16
_MOST_LINKS = 100
_MOST_PORTS = 20
_LEAST_TOKEN = 8
_LAST_PORT = 65_535


@dataclass(frozen=True)
class GateKeys:
    """What opens the gate."""

    token: str | None  # the user's; None: whoever can reach the gate may pass
    cookie: str  # name of the cookie that is set for those who had the token
    secret: str  # its value, made anew for every session, so that no cookie tells the token


@dataclass(frozen=True)
class Reply:
    """Answer to a request."""

    status: str  # of HTTP, such as "401 Unauthorized"
    content: str | bytes  # a line of text, or the bytes of a file
    kind: str = "text/plain; charset=utf-8"
    headers: Mapping[str, str] = field(default_factory=dict)

    def encoded(self) -> bytes:
        """The reply as it is sent, after which the connection is closed."""
        content = self.content
        body = content if isinstance(content, bytes) else f"{content}\n".encode()
        headers = {
            "Content-Type": self.kind,
            "Content-Length": str(len(body)),
            "Cache-Control": "no-store",
            "Referrer-Policy": "no-referrer",
            "Content-Security-Policy": UNFRAMED,
            "Connection": "close",
            **self.headers,
        }
        lines = [
            f"HTTP/1.1 {self.status}",
            *(f"{name}: {value}" for name, value in headers.items()),
        ]
        return "\r\n".join([*lines, "", ""]).encode() + body


@dataclass(frozen=True)
class GateRequest:
    """Head of a request."""

    method: str
    target: str  # path and query
    headers: dict[str, str]  # value by name in small letters; cookies are joined

    @classmethod
    def parse(cls, head: bytes) -> GateRequest:
        """Request of a head that ends with an empty line. ValueError where it is not one of
        HTTP/1.1, or says something twice.
        """
        first, *lines = head.decode("latin-1").removesuffix("\r\n\r\n").split("\r\n")
        method, target, version = first.split(" ")
        if version != "HTTP/1.1" or not target.startswith("/"):
            raise ValueError(first)
        headers: dict[str, str] = {}
        for line in lines:
            name, colon, value = line.partition(":")
            name = name.lower()
            if not colon or not name or name != name.strip() or "\n" in line or "\r" in line:
                raise ValueError(line)
            if name in headers and name in _SINGLE:
                raise ValueError(line)
            before = headers.get(name)
            headers[name] = value.strip() if before is None else f"{before}; {value.strip()}"
        return cls(method, target, headers)

    @property
    def path(self) -> tuple[str, ...]:
        """Parts of the target's path; none: the page itself."""
        return tuple(unquote(part) for part in urlsplit(self.target).path.split("/") if part)

    @property
    def query(self) -> list[tuple[str, str]]:
        """Names and values of the target's query."""
        return parse_qsl(urlsplit(self.target).query, keep_blank_values=True)

    def below(self, parts: int) -> GateRequest:
        """The request as for a page that lies so many parts of the path deep."""
        path, mark, query = self.target.partition("?")
        rest = "/".join(path.split("/")[parts + 1 :])
        return replace(self, target=f"/{rest}{mark}{query}")

    def reply(self, keys: GateKeys, largest_body: int = 0, largest_upload: int = 0) -> Reply | None:
        """Answer of the gate to a request, which may send so many bytes to the page, as JSON or as
        a file; None: it may pass.

        Another site's page is turned away by its Origin, and a name that somebody has pointed at
        this machine (DNS rebinding) by its Host.
        """
        host = self.headers.get("host", "")
        if not host:
            return Reply("400 Bad Request", "This is not understood.")
        fault = self._check_body(largest_upload if self.is_upload else largest_body)
        if fault is not None:
            return fault
        origin = self.headers.get("origin")
        if origin is not None and origin.lower().partition("://")[2] != host.lower():
            return Reply("403 Forbidden", "Another site's page may not open this one.")
        if keys.token is None:
            if not is_loopback(_host_name(host)):
                return Reply(
                    "403 Forbidden", "Open the page at http://localhost, not by this name."
                )
            return None
        return self._check_token(keys, keys.token)

    @property
    def is_upload(self) -> bool:
        """Whether a file is sent, as it is."""
        return self._kind == _FILE

    @property
    def _kind(self) -> str:
        return self.headers.get("content-type", "").partition(";")[0].strip().lower()

    @property
    def body_bytes(self) -> int:
        """Length of what follows the head; of a request that may pass."""
        return int(self.headers.get("content-length", "0"))

    def _check_body(self, largest_body: int) -> Reply | None:
        """Answer to a method or a body that the page does not take. Only a page of the same origin
        can send JSON or files of this kind: browsers ask before another's may, and are told no.
        """
        length = self.headers.get("content-length", "0")
        if "upgrade" in self.headers:
            return Reply("400 Bad Request", "No WebSocket is here.")
        if self.method == "GET" and length == "0" and "transfer-encoding" not in self.headers:
            return None
        if not largest_body:
            return Reply("400 Bad Request", "This page takes GET only.")
        stated = length.isascii() and length.isdigit() and len(length) < 16
        if (
            self.method != "POST"
            or not stated
            or "transfer-encoding" in self.headers
            or self._kind not in ("application/json", _FILE)
        ):
            return Reply("400 Bad Request", "This page takes GET, and POST of JSON.")
        if int(length) > largest_body:
            return Reply("413 Content Too Large", "This is more than the page takes.")
        return None

    def _check_token(self, keys: GateKeys, token: str) -> Reply | None:
        given = [value for name, value in self.query if name == "token"]
        if given:
            if not all([_is_equal(value, token) for value in given]):
                return Reply("401 Unauthorized", "The token is wrong: see the session's terminal.")
            rest = urlencode([(name, value) for name, value in self.query if name != "token"])
            # Never "//": a browser would take what follows for another host.
            path = "/" + urlsplit(self.target).path.lstrip("/") + ("?" + rest if rest else "")
            cookie = f"{keys.cookie}={keys.secret}; Path=/; HttpOnly; SameSite=Lax"
            headers = {"Location": path, "Set-Cookie": cookie}
            return Reply("303 See Other", "The token is right.", headers=headers)
        for crumb in self.headers.get("cookie", "").split(";"):
            name, _, value = crumb.strip().partition("=")
            if name == keys.cookie and _is_equal(value, keys.secret):
                return None
        return Reply(
            "401 Unauthorized", "This page needs its token: open http://HOST:PORT/?token=TOKEN."
        )


async def until_one_ends(*works: Coroutine[Any, Any, None]) -> None:
    """Runs until one of them ends, cancels the others, and raises what it raised."""
    tasks = [asyncio.create_task(work) for work in works]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    for task in done:
        task.result()


async def pass_on(reader: StreamReader, writer: StreamWriter) -> None:
    """Passes on what comes until its end."""
    while piece := await reader.read(_PIECE):
        writer.write(piece)
        await writer.drain()


def is_loopback(host: str) -> bool:
    """Whether an address or name is this machine's own, which no other machine can reach."""
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _reachable(host: str) -> str:
    """A host at which other machines, too, reach what is served at all addresses of this one."""
    if host not in ("0.0.0.0", "::", ""):
        return host
    family, far = (
        (socket.AF_INET6, "2001:db8::1") if host == "::" else (socket.AF_INET, "192.0.2.1")
    )
    with suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.connect((far, 9))  # sends nothing: the system tells the way out
        return str(probe.getsockname()[0])
    return "localhost"


def _is_equal(given: str, right: str) -> bool:
    return hmac.compare_digest(given.encode("utf-8", "replace"), right.encode())


def _host_name(host: str) -> str:
    """Host header without its port, nor the brackets of a number of IPv6."""
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.partition(":")[0]


Handler = Callable[[GateRequest, StreamReader, StreamWriter], Awaitable[None]]
"""Answers a request that may pass: reads what follows its head, and writes."""


@dataclass(frozen=True)
class Address:
    """Where a page is served, and to whom. InputError where other machines could see it without a
    token, the token is short, or there is no such port.
    """

    # Name or number; "localhost" for this machine only, "0.0.0.0" for all that reach it.
    host: str = "localhost"
    port: int = 8080  # the first free one from this number on is used, of twenty; 0: any
    # Who wants to see the page must know it; None: only this machine's own addresses.
    token: str | None = None

    def __post_init__(self) -> None:
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
    """Lets requests pass that may."""

    def __init__(
        self, address: Address, handle: Handler, largest_body: int = 0, largest_upload: int = 0
    ) -> None:
        """Listens, from a thread of its own, in which `handle` answers what may pass; a page may
        send so many bytes of JSON with one request, or of a file. InputError where the address
        cannot be used.
        """
        self._address, self._handle = address, handle
        self._largest_body, self._largest_upload = largest_body, largest_upload
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
        """Address that whoever is served can open, the token included."""
        host, token = _reachable(self._address.host), self._address.token
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
                return await asyncio.start_server(self._serve_link, host, port, limit=_HEAD_BYTES)
            except socket.gaierror:  # no such name: every port would say so, and slowly
                raise
            except OSError:
                if port in (0, last):
                    raise
                port += 1

    async def _serve_link(self, reader: StreamReader, writer: StreamWriter) -> None:
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
            reply = request.reply(self._keys, self._largest_body, self._largest_upload)
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


class GatedServer:
    """Serves pages behind a gate, if they have one of their own, until it is closed."""

    def __init__(self, gate: Gate | None, end: Callable[[], None]) -> None:
        """`end` ends what the pages work on, after the gate."""
        self._gate, self._end, self._ended = gate, end, threading.Event()
        self.url, self.port = ("", 0) if gate is None else (gate.url, gate.port)

    def run(self) -> None:
        """Waits until somebody interrupts, or the server is closed."""
        while not self._ended.wait(0.5):
            pass

    def close(self) -> None:
        """Ends all connections and threads."""
        self._ended.set()
        if self._gate is not None:
            self._gate.close()
        self._end()
