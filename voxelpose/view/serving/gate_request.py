"""Requests at the page's gate: who may pass, and what others are told."""

from __future__ import annotations

import hmac
import ipaddress
from collections.abc import Mapping
from dataclasses import dataclass, field
from urllib.parse import parse_qsl, unquote, urlencode, urlsplit

_SINGLE = ("host", "origin", "upgrade", "content-length", "transfer-encoding")


@dataclass(frozen=True)
class GateKeys:
    """What opens the gate.

    Attributes:
        token: the user's; None: whoever can reach the gate may pass.
        cookie: name of the cookie that is set for those who had the token.
        secret: its value, made anew for every session, so that no cookie tells the token.
    """

    token: str | None
    cookie: str
    secret: str


@dataclass(frozen=True)
class Reply:
    """Answer to a request.

    Attributes:
        status: of HTTP, such as "401 Unauthorized".
        content: a line of text, or the bytes of a file.
        kind: of the content.
        headers: further ones.
    """

    status: str
    content: str | bytes
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
    """Head of a request.

    Attributes:
        head: as it came.
        target: path and query.
        headers: value by name in small letters; cookies are joined.
    """

    head: bytes
    method: str
    target: str
    headers: dict[str, str]

    @classmethod
    def parse(cls, head: bytes) -> GateRequest:
        """Request of a head that ends with an empty line.

        Raises:
            ValueError: it is not one of HTTP/1.1, or says something twice.
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
        return cls(head, method, target, headers)

    @property
    def path(self) -> tuple[str, ...]:
        """Parts of the target's path; none: the page itself."""
        return tuple(unquote(part) for part in urlsplit(self.target).path.split("/") if part)

    @property
    def query(self) -> list[tuple[str, str]]:
        """Names and values of the target's query."""
        return parse_qsl(urlsplit(self.target).query, keep_blank_values=True)

    @property
    def upgrade(self) -> bool:
        """Whether a WebSocket is asked for."""
        return "upgrade" in self.headers

    def reply(self, keys: GateKeys, largest_body: int = 0) -> Reply | None:
        """Answer of the gate; None: the request may pass.

        Another site's page is turned away by its Origin, and a name that somebody has pointed at
        this machine (DNS rebinding) by its Host.

        Args:
            keys: what opens the gate.
            largest_body: bytes that may be sent to the page; 0: it takes none.
        """
        host = self.headers.get("host", "")
        if not host:
            return Reply("400 Bad Request", "This is not understood.")
        fault = self._check_body(largest_body)
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
    def body_bytes(self) -> int:
        """Length of what follows the head; of a request that may pass."""
        return int(self.headers.get("content-length", "0"))

    def _check_body(self, largest_body: int) -> Reply | None:
        """Answer to a method or a body that the page does not take.

        Only a page of the same origin can send JSON: browsers ask before another's may, and are
        told no.
        """
        length = self.headers.get("content-length", "0")
        if self.method == "GET" and length == "0" and "transfer-encoding" not in self.headers:
            return None
        if not largest_body:
            return Reply("400 Bad Request", "This page takes GET only.")
        kind = self.headers.get("content-type", "").partition(";")[0].strip().lower()
        stated = length.isascii() and length.isdigit() and len(length) < 16
        if (
            self.method != "POST"
            or self.upgrade
            or not stated
            or "transfer-encoding" in self.headers
            or kind != "application/json"
        ):
            return Reply("400 Bad Request", "This page takes GET, and POST of JSON.")
        if int(length) > largest_body:
            return Reply("413 Content Too Large", "This is more than the page takes.")
        return None

    def _check_token(self, keys: GateKeys, token: str) -> Reply | None:
        given = [value for name, value in self.query if name == "token"]
        if given:
            if not all([_same(value, token) for value in given]):
                return Reply("401 Unauthorized", "The token is wrong: see the session's terminal.")
            if self.upgrade:
                return None
            rest = urlencode([(name, value) for name, value in self.query if name != "token"])
            # Never "//": a browser would take what follows for another host.
            path = "/" + urlsplit(self.target).path.lstrip("/") + ("?" + rest if rest else "")
            cookie = f"{keys.cookie}={keys.secret}; Path=/; HttpOnly; SameSite=Lax"
            headers = {"Location": path, "Set-Cookie": cookie}
            return Reply("303 See Other", "The token is right.", headers=headers)
        for crumb in self.headers.get("cookie", "").split(";"):
            name, _, value = crumb.strip().partition("=")
            if name == keys.cookie and _same(value, keys.secret):
                return None
        return Reply(
            "401 Unauthorized", "This page needs its token: open http://HOST:PORT/?token=TOKEN."
        )


def is_loopback(host: str) -> bool:
    """Whether an address or name is this machine's own, which no other machine can reach."""
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _same(given: str, right: str) -> bool:
    return hmac.compare_digest(given.encode("utf-8", "replace"), right.encode())


def _host_name(host: str) -> str:
    """Host header without its port, nor the brackets of a number of IPv6."""
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.partition(":")[0]
