"""Live in the studio: the session, its receivers, and the way to its page."""

import asyncio
import secrets
import time
from asyncio import StreamReader, StreamWriter
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
from voxelpose.view.serving.gate import GateRequest, pass_on
from voxelpose.view.serving.page_answers import Name
from voxelpose.view.serving.page_job import PageJob

LIVE = "live session"
"""Kind of the job."""
_Receivers = Annotated[
    list[Annotated[str, Meta(min_length=1, max_length=500)]], Meta(max_length=20)
]


class LiveAsked(Struct, forbid_unknown_fields=True):
    """A session with its cameras, none for the project's own videos, and its receivers."""

    project: Name
    sources: Annotated[list[SourceNamed], Meta(max_length=64)] = []
    receivers: _Receivers = []
    loop: bool = True
    settings: Typed = {}


class ReceiversAsked(Struct, forbid_unknown_fields=True):
    """Other receivers for the session that is running."""

    receivers: _Receivers


class LiveStep:
    """What the step shows of a project, and has done."""

    def __init__(self, folder: StudioFolder, job: PageJob, recording: RecordStep) -> None:
        self._folder, self._job, self._recording = folder, job, recording
        self._token = self._cookie = ""
        self._cookie_of = 0

    def state(self, name: str) -> dict[str, Any]:
        """What the step Record knows of the cameras, the form, and the receivers of the last time.
        InputError where there is no such project.
        """
        project = self._folder.project(name)
        receivers, _ = folder_settings("live", project).get("send", ((), ""))
        form = form_of("live", project)
        return self._recording.state(name) | {"form": form, "receivers": list(receivers)}

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
        self._token = secrets.token_urlsafe(32)
        title = f"{asked.project} – live"
        self._job.start(LIVE, asked.project, follow, command, title, self._token, step="live")
        change_section(project / SETTINGS_FILE, "live", asked.settings)
        change_section(project / SETTINGS_FILE, "live", {"send": list(asked.receivers)})
        if sources:
            self._recording.keep(project, sources, asked.loop)

    def send_to(self, asked: ReceiversAsked) -> None:
        """Sends to other receivers. InputError where an address is wrong."""
        self._check_receivers(asked.receivers)
        self._job.ask(f"{SEND_TO} {' '.join(asked.receivers)}")

    async def relay(self, request: GateRequest, reader: StreamReader, writer: StreamWriter) -> None:
        """Passes a request on to the session's page, and what it answers back; its path is as below
        that page. InputError where no session is running.
        """
        port = self._job.status(LIVE).get("port")
        if self._job.status(LIVE)["state"] != "running" or port is None:
            raise InputError("no live session is running: start one in the step Live")
        if self._cookie_of != port:
            self._cookie, self._cookie_of = await _cookie(port, self._token), port
        headers = request.headers | {"host": f"127.0.0.1:{port}", "cookie": self._cookie}
        headers.pop("origin", None)  # this gate has checked it
        lines = [f"{request.method} {request.target} HTTP/1.1"]
        lines += [f"{name}: {value}" for name, value in headers.items()]
        inner_reader, inner_writer = await asyncio.open_connection("127.0.0.1", port)
        try:
            inner_writer.write("\r\n".join([*lines, "", ""]).encode("latin-1"))
            inner_writer.write(await reader.readexactly(request.body_bytes))
            await pass_on(inner_reader, writer)
        finally:
            inner_writer.close()

    def _check_receivers(self, addresses: list[str]) -> None:
        for address in addresses:
            if len(address.split()) != 1:
                raise InputError(f"{address[:60]!r} has spaces: correct the receiver's address")
            parse_receiver(address)


async def _cookie(port: int, token: str) -> str:
    """The cookie with which the session's page lets requests pass."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        writer.write(f"GET /?token={token} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1")
    finally:
        writer.close()
    for line in head.split("\r\n"):
        name, _, value = line.partition(":")
        if name.lower() == "set-cookie":
            return value.partition(";")[0].strip()
    raise InputError("the live page does not answer: load this page again")
