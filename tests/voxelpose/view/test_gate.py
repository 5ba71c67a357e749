"""The page's gate over raw sockets: nothing passes without the token, not even a byte."""

import base64
import re
import socket
import threading
from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest

from calib.errors import InputError
from voxelpose.view.serving.gate import Address, GatedServer, GateRequest, Reply, _reachable

TOKEN = "open & sesame"
QUERY = "/?token=open%20%26%20sesame"


def served(address: Address) -> GatedServer:
    """A server of one page."""

    async def answer(request: GateRequest) -> Reply:
        return Reply("200 OK", "<html>the room")

    return GatedServer(address, answer, lambda: None)


@pytest.fixture(scope="module")
def guarded() -> Iterator[GatedServer]:
    """A server with a token, on an address that this machine alone can reach."""
    before = set(threading.enumerate())
    server = served(Address("127.0.0.1", 0, TOKEN))
    yield server
    server.close()
    assert set(threading.enumerate()) <= before


@pytest.fixture(scope="module")
def local() -> Iterator[GatedServer]:
    """A server without a token."""
    server = served(Address("127.0.0.1", 0))
    yield server
    server.close()


def ask(server: GatedServer, target: str, *headers: str, method: str = "GET") -> str:
    """Sends one request; returns all that comes back until the connection ends."""
    port = server.port
    if not any(header.lower().startswith("host:") for header in headers):
        headers = (f"Host: 127.0.0.1:{port}", *headers)
    request = "\r\n".join([f"{method} {target} HTTP/1.1", *headers, "", ""])
    return talk(port, request.encode())


def talk(port: int, data: bytes) -> str:
    with socket.create_connection(("127.0.0.1", port), timeout=5) as link:
        link.sendall(data)
        answer = b""
        while piece := link.recv(65536):
            answer += piece
    return answer.decode("latin-1")


def upgrade(*more: str) -> tuple[str, ...]:
    key = f"Sec-WebSocket-Key: {base64.b64encode(b'0123456789abcdef').decode()}"
    return "Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13", key, *more


def cookie_of(server: GatedServer) -> str:
    answer = ask(server, QUERY)
    assert answer.startswith("HTTP/1.1 303 See Other\r\n") and "Location: /\r\n" in answer
    found = re.search(r"Set-Cookie: (.*?=.*?); Path=/; HttpOnly; SameSite=Lax\r\n", answer)
    assert found is not None and "sesame" not in found[1]
    return found[1]


def assert_refused(answer: str, status: str) -> None:
    assert answer.startswith(f"HTTP/1.1 {status}")
    head, _, body = answer.partition("\r\n\r\n")
    assert body.count("\n") == 1 and body.endswith("\n") and "<" not in body
    assert "Set-Cookie" not in head and "Sec-WebSocket" not in head


@pytest.mark.parametrize(
    "target",
    [
        "/",
        "/?token=",
        "/?token=open",
        "/?token=open%20%26%20sesame%00",
        "/?Token=open%20%26%20sesame",
        "/?token=wrong&token=open%20%26%20sesame",
        "/assets/index.js",
        "/%3ftoken=open%20%26%20sesame",
    ],
)
def test_without_the_token_nothing_is_sent(guarded, target):
    assert_refused(ask(guarded, target), "401")


def test_a_wrong_cookie_is_refused(guarded):
    name, _, value = cookie_of(guarded).partition("=")
    for crumb in (f"{name}={value[:-1]}", f"{name}=", f"other={value}", f"{name}={TOKEN}"):
        assert_refused(ask(guarded, "/", f"Cookie: {crumb}"), "401")


def test_the_token_opens_the_page_and_nobody_a_websocket(guarded, local):
    cookie = f"Cookie: first=1; {cookie_of(guarded)}; last=2"
    page = ask(guarded, "/", cookie)
    assert page.startswith("HTTP/1.1 200") and "<html" in page
    for answer in (
        ask(guarded, "/", cookie, *upgrade()),
        ask(guarded, QUERY, *upgrade()),
        ask(local, "/", *upgrade()),
    ):
        assert_refused(answer, "400")


def test_no_other_site_may_frame_what_is_served(guarded, local):
    cookie = f"Cookie: {cookie_of(guarded)}"
    for answer in (
        ask(local, "/"),
        ask(local, "/", method="PUT"),
        ask(guarded, "/", cookie),
        ask(guarded, QUERY),
        ask(guarded, "/"),
    ):
        head = answer.partition("\r\n\r\n")[0]
        assert head.count("Content-Security-Policy: frame-ancestors 'none'") == 1


def test_the_url_has_the_token(guarded):
    assert guarded.url == f"http://127.0.0.1:{guarded.port}{QUERY}"


def test_the_redirect_stays_on_this_host(guarded):
    answer = ask(guarded, "//elsewhere.org/a?token=open%20%26%20sesame&x=1")
    assert "elsewhere" not in re.search(r"Location: (.*)\r\n", answer)[1].split("/")[0]  # type: ignore[index]
    assert "Location: /" in answer and "Location: //" not in answer


def test_another_sites_page_is_refused_even_with_the_cookie(guarded, local):
    cookie = f"Cookie: {cookie_of(guarded)}"
    for origin in ("http://elsewhere.org", "null", "http://127.0.0.1:1", ""):
        header = f"Origin: {origin}"
        assert_refused(ask(guarded, "/", cookie, header), "403")
        assert_refused(ask(local, "/", header), "403")
    own = f"Origin: http://127.0.0.1:{local.port}"
    assert ask(local, "/", own).startswith("HTTP/1.1 200")


def test_without_a_token_only_names_of_this_machine_open_the_page(local):
    assert "<html" in ask(local, "/")
    for name in ("localhost:8080", "[::1]:80", "LOCALHOST"):
        assert ask(local, "/", f"Host: {name}").startswith("HTTP/1.1 200")
    for name in ("rebound.example:80", "192.168.0.9", "localhost.evil.example", "[::2]:1"):
        assert_refused(ask(local, "/", f"Host: {name}"), "403")
    assert local.url == f"http://127.0.0.1:{local.port}"


@pytest.mark.parametrize(
    "data",
    [
        b"GET / HTTP/1.0\r\nHost: localhost\r\n\r\n",
        b"GET / HTTP/1.1\r\n\r\n",
        b"nonsense\r\n\r\n",
        b"GET http://localhost/ HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nHost: evil\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost : localhost\r\n\r\n",
        b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n\r\nhello",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nX: " + 20000 * b"x" + b"\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\r\n\r\n",
    ],
)
def test_what_is_not_understood_is_refused(guarded, local, data):
    for server in (guarded, local):
        assert_refused(talk(server.port, data), "400")


def test_a_second_request_on_a_connection_is_not_relayed(local):
    request = f"GET / HTTP/1.1\r\nHost: localhost:{local.port}\r\n\r\n".encode()
    assert talk(local.port, 3 * request).count("HTTP/1.1 ") == 1


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "", "192.168.0.9", "studio"])
def test_other_machines_need_a_token(host):
    with pytest.raises(InputError, match="--token"):
        Address(host, 0)
    with pytest.raises(InputError, match="--token is short"):
        Address(host, 0, "1234")


def test_the_next_free_port_is_taken_and_an_impossible_address_is_one_line(guarded):
    server = served(Address("127.0.0.1", guarded.port, TOKEN))
    assert server.port > guarded.port
    server.close()
    server.close()
    with pytest.raises(InputError, match=r"--host 203\.0\.113\.1 --port 8080: .*choose another"):
        served(Address("203.0.113.1", 8080, TOKEN))
    with pytest.raises(InputError, match="choose another"):
        Address("127.0.0.1", 99999, TOKEN)


def test_the_address_for_all_is_one_that_others_can_open(monkeypatch):
    class Probe(socket.socket):
        def connect(self, far):
            assert self.type == socket.SOCK_DGRAM  # nothing is sent

        def getsockname(self):
            return "192.168.0.7", 40_000

    with monkeypatch.context() as patched:
        patched.setattr("voxelpose.view.serving.gate.socket.socket", Probe)
        assert _reachable("0.0.0.0") == "192.168.0.7"
    for host in ("localhost", "studio", "192.168.0.9"):
        assert _reachable(host) == host
    server = served(Address("0.0.0.0", 0, TOKEN))
    try:
        place = urlsplit(server.url)
        assert place.port == server.port and place.query in QUERY
        socket.create_connection((place.hostname, place.port), timeout=5).close()
    finally:
        server.close()
