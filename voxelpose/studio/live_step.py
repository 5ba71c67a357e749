"""Live in the studio: the session, its receivers, and the way to its page."""

import asyncio
import secrets
import time
from collections.abc import AsyncGenerator
from typing import Annotated, Any

from msgspec import Meta, Struct

from calib.errors import InputError
from voxelpose.cli.options import folder_settings
from voxelpose.live.senders import parse_receiver
from voxelpose.recording.folder import calibration_path
from voxelpose.recording.subject import SETTINGS_FILE
from voxelpose.setup_page.drawn_places import change_section
from voxelpose.setup_page.page_requests import Typed
from voxelpose.studio.command_forms import filled_in, form_of
from voxelpose.studio.live_job import SEND_TO, follow
from voxelpose.studio.projects import StudioFolder
from voxelpose.studio.record_step import RecordStep, SourceNamed
from voxelpose.view.serving.gate import GateRequest, Reply
from voxelpose.view.serving.page_answers import Name
from voxelpose.view.serving.page_job import PageJob

LIVE = "live session"
"""Kind of the job."""
_PIECE = 2**16
_Receivers = Annotated[
    list[Annotated[str, Meta(min_length=1, max_length=500)]], Meta(max_length=20)
]


class LiveAsked(Struct, forbid_unknown_fields=True, tag=True):
    """A session with its cameras, none for the project's own videos, and its receivers."""

    project: Name
    sources: Annotated[list[SourceNamed], Meta(max_length=64)] = []
    receivers: _Receivers = []
    loop: bool = True
    settings: Typed = {}


class LiveStep:
    """What the step shows of a project, and has done."""

    def __init__(self, folder: StudioFolder, job: PageJob, recording: RecordStep) -> None:
        self._folder, self._job, self._recording = folder, job, recording
        self._token = self._cookie = ""
        self._cookie_of = 0

    def state(self, project: str) -> dict[str, Any]:
        """What the step Record knows of the cameras, the form, and the receivers of the last time.
        InputError where there is no such project.
        """
        folder = self._folder.project(project)
        receivers, _ = folder_settings("live", folder).get("send", ((), ""))
        form = form_of("live", folder)
        return self._recording.state(project) | {"form": form, "receivers": list(receivers)}

    def start(self, asked: LiveAsked) -> None:
        """Begins a session, and keeps its settings in the project. InputError where another job is
        running, an address is wrong, or a setting makes no sense.
        """
        project = self._folder.project(asked.project)
        sources = self._recording.sources(asked.sources)
        self._check_receivers(asked.receivers)
        calibrated = calibration_path(project) is not None
        stamp = time.strftime("%Y-%m-%d_%H-%M-%S")
        fixed = {
            "folder": project if calibrated or not sources else None,
            "source": tuple(f"{source.name}={source.address}" for source in sources),
            "send": tuple(asked.receivers),
            "loop": asked.loop,
            "record": self._folder.root / f"{asked.project[:50]}_{stamp}",
            "page": False,
        }
        command = filled_in("live", self._folder, project, fixed, asked.settings)
        command.check()
        self._token, title = secrets.token_urlsafe(32), f"{asked.project} – live"
        self._job.start(
            LIVE, asked.project, follow, command, title, self._token, step="live", asked=asked
        )
        change_section(project / SETTINGS_FILE, "live", asked.settings)
        change_section(project / SETTINGS_FILE, "live", {"send": list(asked.receivers)})
        if sources:
            self._recording.keep(project, sources, asked.loop)

    def send_to(self, receivers: _Receivers) -> None:
        """Sends to other receivers. InputError where an address is wrong."""
        self._check_receivers(receivers)
        self._job.ask(f"{SEND_TO} {' '.join(receivers)}")

    async def relay(self, request: GateRequest) -> Reply:
        """What the session's page answers to a request, whose path is as below that page.
        InputError where no session is running.
        """
        port = self._job.status(LIVE).get("port")
        if self._job.status(LIVE)["state"] != "running" or port is None:
            raise InputError("no live session is running: start one in the step Live")
        if self._cookie_of != port:
            first = f"GET /?token={self._token} HTTP/1.1"
            reply = await _asked(port, [first, f"Host: 127.0.0.1:{port}"], b"")
            self._cookie = reply.headers["Set-Cookie"].partition(";")[0]
            self._cookie_of = port
        # This gate has checked the origin.
        headers = request.headers | {"host": f"127.0.0.1:{port}", "cookie": self._cookie}
        lines = [f"{name}: {value}" for name, value in headers.items() if name != "origin"]
        body = await request.reader.readexactly(request.body_bytes)
        return await _asked(port, [f"{request.method} {request.target} HTTP/1.1", *lines], body)

    def _check_receivers(self, addresses: list[str]) -> None:
        for address in addresses:
            if len(address.split()) != 1:
                raise InputError(f"{address[:60]!r} has spaces: correct the receiver's address")
            parse_receiver(address)


async def _asked(port: int, lines: list[str], body: bytes) -> Reply:
    """What a page at a port of this machine answers to the lines of a head and what follows it."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)

    async def pieces() -> AsyncGenerator[bytes, None]:
        try:
            while piece := await reader.read(_PIECE):
                yield piece
        finally:
            writer.close()

    writer.write("\r\n".join([*lines, "", ""]).encode("latin-1") + body)
    first, *rest = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").splitlines()
    headers = dict(line.split(": ", 1) for line in rest if line)
    return Reply(first.partition(" ")[2], pieces(), headers.pop("Content-Type"), headers)
