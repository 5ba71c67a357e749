"""The gate before every page: it listens, and checks each request before it answers anything.

A connection carries one request: for a page's file, or with JSON or a file that a page sends where
it may. Those that may pass go to who answers them.
"""

from __future__ import annotations

import asyncio
import hmac
import ipaddress
import json
import secrets
import socket
import threading
import traceback
from asyncio import StreamReader, StreamWriter
from collections.abc import AsyncGenerator, Awaitable, Callable, Mapping
from concurrent.futures import Future
from contextlib import aclosing, suppress
from dataclasses import dataclass, field, replace
from urllib.parse import parse_qsl, quote, unquote, urlencode, urlsplit

from calib.errors import InputError, visible
from voxelpose.view.serving.page_words import field_at_fault, page_words

UNFRAMED = "frame-ancestors 'none'"
"""Policy of what is answered: it is not shown within another page, whose visitors would press its
buttons; the program's own pages are shown within each other."""
PAGE_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self';"
        " img-src 'self' data: blob:; media-src blob:; base-uri 'none'; form-action 'none';"
        " frame-src 'self'; frame-ancestors 'self'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
}
_SINGLE = ("host", "origin", "upgrade", "content-length", "transfer-encoding")
_FILE = "application/octet-stream"
_HEAD_BYTES = 16384
_HEAD_S = 10
_MOST_LINKS = 100
_MOST_PORTS = 20
_LEAST_TOKEN = 8
LAST_PORT = 2**16 - 1


@dataclass(frozen=True)
class Reply:
    """Answer to a request."""

    status: str  # of HTTP, such as "401 Unauthorized"
    content: (
        str | bytes | AsyncGenerator[bytes, None]
    )  # a line of text, bytes, or pieces as they come
    kind: str = "text/plain; charset=utf-8"
    headers: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def error(cls, status: str, line: str, field: str = "") -> Reply:
        """A page's answer that says in a line why there is no other, and the field at fault."""
        line = visible(" ".join(line.split()))
        known = {"error": page_words(line), "field": field or field_at_fault(line)}
        content = json.dumps(known).encode()
        return cls(status, content, "application/json", PAGE_HEADERS)

    async def send(self, writer: StreamWriter) -> None:
        """Sends the reply, after which the connection is closed."""
        content = self.content
        if isinstance(content, str):
            content = f"{content}\n".encode()
        headers = {
            "Content-Type": self.kind,
            "Cache-Control": "no-store",
            "Referrer-Policy": "no-referrer",
            "Content-Security-Policy": UNFRAMED,
            "Connection": "close",
            **self.headers,
        }
        if isinstance(content, bytes):
            headers["Content-Length"] = str(len(content))
        lines = [f"HTTP/1.1 {self.status}", *(f"{name}: {headers[name]}" for name in headers)]
        writer.write("\r\n".join([*lines, "", ""]).encode())
        if isinstance(content, bytes):
            writer.write(content)
            await writer.drain()
            return
        async with aclosing(content) as pieces:
            async for piece in pieces:
                writer.write(piece)
                await writer.drain()


@dataclass(frozen=True)
class GateRequest:
    """A request, of which the head is read."""

    method: str
    target: str  # path and query
    headers: dict[str, str]  # value by name in small letters; cookies are joined
    reader: StreamReader  # of what follows the head

    @classmethod
    def parse(cls, head: bytes, reader: StreamReader) -> GateRequest:
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
        return cls(method, target, headers, reader)

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

    def check_body(self, largest_body: int) -> Reply | None:
        """Answer to a method or a body that the page does not take; None: it may pass. Only a page
        of the same origin can send JSON or files of this kind: browsers ask before another's may,
        and are told no.
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


Handler = Callable[[GateRequest], Awaitable[Reply]]
"""Answers a request that may pass. InputError or OSError: with a line that the page shows."""


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
        if not 0 <= self.port <= LAST_PORT:  # the system may take it for another
            raise InputError(
                f"--port {self.port}: ports are numbers from 1 to {LAST_PORT}: choose another"
            )

    def url(self, port: int) -> str:
        """Address that whoever is served at a port can open, the token included."""
        host = _reachable(self.host)
        query = "" if self.token is None else f"/?token={quote(self.token, safe='')}"
        return f"http://{f'[{host}]' if ':' in host else host}:{port}{query}"


class GatedServer:
    """Serves pages to requests that may pass, from a thread of its own, until it is closed.

    Attributes:
        port: on which it listens; 0 where it is a part of other pages.
        url: address that whoever is served can open, the token included.
    """

    def __init__(
        self,
        address: Address | None,
        answer: Handler,
        end: Callable[[], None],
        largest_body: int = 0,
        largest_upload: int = 0,
    ) -> None:
        """Listens, if it has an address. InputError where that cannot be used.

        Args:
            address: where; None: the pages are a part of others, which call `answer` themselves.
            answer: called in the server's thread.
            end: ends what the pages work on, after all connections.
            largest_body: bytes of JSON that a page may send with one request.
            largest_upload: bytes of a file likewise.
        """
        self.answer, self._end, self._ended = answer, end, threading.Event()
        self._largest_body, self._largest_upload = largest_body, largest_upload
        self._passed = 0
        self._tasks: set[asyncio.Task[None]] = set()
        self._thread: threading.Thread | None = None
        self.url, self.port = "", 0
        if address is None:
            return
        self._token = address.token  # the user's; None: whoever can reach the gate may pass
        self._secret = secrets.token_urlsafe(32)  # of this session alone: no cookie tells the token
        self._loop, self._stopped = asyncio.new_event_loop(), asyncio.Event()
        ready: Future[int] = Future()
        self._thread = threading.Thread(
            target=self._run, args=(address, ready), name="gate of the page", daemon=True
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
        self.url = address.url(self.port)

    def run(self) -> None:
        """Waits until somebody interrupts, or the server is closed."""
        while not self._ended.wait(0.5):
            pass

    def close(self) -> None:
        """Ends all connections and threads."""
        self._ended.set()
        if self._thread is not None:
            with suppress(RuntimeError):  # closed already
                self._loop.call_soon_threadsafe(self._stopped.set)
            self._thread.join()
        self._end()

    def _run(self, address: Address, ready: Future[int]) -> None:
        try:
            self._loop.run_until_complete(self._serve(address, ready))
        finally:
            self._loop.close()

    async def _serve(self, address: Address, ready: Future[int]) -> None:
        try:
            server = await self._listen(address.host, address.port)
        except (OSError, OverflowError) as error:
            ready.set_exception(error)
            return
        port = int(server.sockets[0].getsockname()[1])
        # Browsers send cookies to all ports of a host: the name tells sessions apart.
        self._cookie = f"voxelpose_{port}"
        ready.set_result(port)
        await self._stopped.wait()
        server.close()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _listen(self, host: str, port: int) -> asyncio.Server:
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
            await self._serve_request(reader, writer)
        except (EOFError, OSError, asyncio.CancelledError):
            pass  # the other side is gone, or the session ends
        finally:
            self._tasks.discard(task)
            writer.close()

    async def _serve_request(self, reader: StreamReader, writer: StreamWriter) -> None:
        try:
            async with asyncio.timeout(_HEAD_S):
                head = await reader.readuntil(b"\r\n\r\n")
            request = GateRequest.parse(head, reader)
            reply = self._refusal(request)
        except (ValueError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, TimeoutError):
            reply = Reply("400 Bad Request", "This is not understood.")
        else:
            if reply is None and self._passed >= _MOST_LINKS:
                reply = Reply("503 Service Unavailable", "Too many pages are open: close some.")
            if reply is None:
                self._passed += 1
                try:
                    await (await self._answered(request)).send(writer)
                finally:
                    self._passed -= 1
                return
        if reply.status.startswith("401"):
            await asyncio.sleep(0.2)  # slows down who tries many
        await reply.send(writer)

    async def _answered(self, request: GateRequest) -> Reply:
        """The answer; what the user can correct as a line, a bug as 500."""
        try:
            return await self.answer(request)
        except (EOFError, TimeoutError):
            raise  # who asked is gone
        except (InputError, OSError) as error:
            return Reply.error("400 Bad Request", str(error), getattr(error, "field", ""))
        except Exception:
            traceback.print_exc()
            words = "a bug: the terminal shows its traceback; the page goes on"
            return Reply.error("500 Internal Server Error", words)

    def _refusal(self, request: GateRequest) -> Reply | None:
        """Answer of the gate to a request; None: it may pass.

        Another site's page is turned away by its Origin, and a name that somebody has pointed at
        this machine (DNS rebinding) by its Host.
        """
        host = request.headers.get("host", "")
        if not host:
            return Reply("400 Bad Request", "This is not understood.")
        most = self._largest_upload if request.is_upload else self._largest_body
        if (fault := request.check_body(most)) is not None:
            return fault
        origin = request.headers.get("origin")
        if origin is not None and origin.lower().partition("://")[2] != host.lower():
            return Reply("403 Forbidden", "Another site's page may not open this one.")
        if self._token is not None:
            return self._check_token(request, self._token)
        if not is_loopback(_host_name(host)):
            return Reply("403 Forbidden", "Open the page at http://localhost, not by this name.")
        return None

    def _check_token(self, request: GateRequest, token: str) -> Reply | None:
        given = [value for name, value in request.query if name == "token"]
        if given:
            if not all([_is_equal(value, token) for value in given]):
                return Reply("401 Unauthorized", "The token is wrong: see the session's terminal.")
            rest = urlencode([(name, value) for name, value in request.query if name != "token"])
            # Never "//": a browser would take what follows for another host.
            path = "/" + urlsplit(request.target).path.lstrip("/") + ("?" + rest if rest else "")
            cookie = f"{self._cookie}={self._secret}; Path=/; HttpOnly; SameSite=Lax"
            headers = {"Location": path, "Set-Cookie": cookie}
            return Reply("303 See Other", "The token is right.", headers=headers)
        for crumb in request.headers.get("cookie", "").split(";"):
            name, _, value = crumb.strip().partition("=")
            if name == self._cookie and _is_equal(value, self._secret):
                return None
        return Reply(
            "401 Unauthorized", "This page needs its token: open http://HOST:PORT/?token=TOKEN."
        )
