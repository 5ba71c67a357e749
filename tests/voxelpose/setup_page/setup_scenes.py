"""A recording to be set up, and its page behind the gate."""

import http.client
import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.clips import waving
from tests.sources import ring, write_staged
from voxelpose.setup_page.opened_folder import OpenedFolder
from voxelpose.setup_page.setup_session import SetupServer, SetupSession
from voxelpose.view.serving.gate import Address

SIZE = 320, 240


def staged(folder: Path, cameras: int = 3) -> Path:
    """A recording of somebody who waves before an empty room."""
    return write_staged(folder, waving(8), ring(cameras, SIZE))


def opened(folder: Path, unit: str | None = None) -> SetupSession:
    """A session as the command opens it."""
    return SetupSession(OpenedFolder.open(folder, unit))


@contextmanager
def served(
    folder: Path, host: str = "127.0.0.1", token: str | None = None, unit: str | None = None
) -> Iterator[SetupServer]:
    """The page; leaves no thread of its own behind."""
    before = set(threading.enumerate())
    server = SetupServer(opened(folder, unit), Address(host, 0, token))
    try:
        yield server
    finally:
        server.close()
        end = time.monotonic() + 10
        while any(
            "setup" in t.name or "gate" in t.name for t in set(threading.enumerate()) - before
        ):
            assert time.monotonic() < end, threading.enumerate()
            time.sleep(0.02)


def ask(
    server: SetupServer, path: str, body: object = None, **headers: str
) -> tuple[int, dict | bytes]:
    """Status and content of an answer; a body is sent as JSON, bytes as they are."""
    link = http.client.HTTPConnection("127.0.0.1", server.port, timeout=30)
    headers = {name.replace("_", "-"): value for name, value in headers.items()}
    if body is None:
        link.request("GET", path, headers=headers)
    else:
        data = body if isinstance(body, bytes) else json.dumps(body).encode()
        link.request("POST", path, data, {"Content-Type": "application/json"} | headers)
    answer = link.getresponse()
    content = answer.read()
    link.close()
    is_json = "json" in (answer.getheader("content-type") or "")
    return answer.status, json.loads(content) if is_json else content
