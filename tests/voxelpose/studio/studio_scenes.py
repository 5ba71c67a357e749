"""The studio of a folder, behind its gate."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.voxelpose.setup_page.setup_scenes import ask
from voxelpose.studio.projects import StudioFolder
from voxelpose.studio.studio_server import StudioServer
from voxelpose.studio.studio_session import StudioSession
from voxelpose.view.serving.gate import Address


@contextmanager
def opened_studio(root: Path, token: str | None = None, port: int = 0) -> Iterator[StudioServer]:
    """The studio; leaves no thread of its own behind."""
    before = set(threading.enumerate())
    session = StudioSession(StudioFolder(root))
    server = StudioServer(session, Address("127.0.0.1", port, token))
    try:
        yield server
    finally:
        server.close()
        names = "gate", "job of", "viewer"
        end = time.monotonic() + 20
        while any(t.name.startswith(names) for t in set(threading.enumerate()) - before):
            assert time.monotonic() < end, threading.enumerate()
            time.sleep(0.02)


def send(server: StudioServer, path: str, content: bytes, **headers: str):
    """Status and content of the answer to a file that is sent to a path in the project walk."""
    asked = f"/upload?project=walk&path={path}"
    return ask(server, asked, content, Content_Type="application/octet-stream", **headers)


def plan(server: StudioServer, *paths: str, size: int = 9, project: str = "walk", **asked: str):
    """Status and content of the answer to where files of these paths belong."""
    files = [[path, size, 0] for path in paths]
    return ask(server, "/api/plan", {"files": files, "project": project, **asked})


def ended(server: StudioServer, seconds: float = 60.0) -> dict:
    """State of the job when it has ended."""
    end = time.monotonic() + seconds
    while (state := server._session.job.status())["state"] == "running":
        assert time.monotonic() < end, state
        time.sleep(0.05)
    return state


def until(server: StudioServer, true: Callable[[dict], bool], seconds: float = 90.0) -> dict:
    """State of the running job when it is so."""
    end = time.monotonic() + seconds
    while not true(state := server._session.job.status()):
        assert state["state"] == "running" and time.monotonic() < end, state
        time.sleep(0.05)
    return state
