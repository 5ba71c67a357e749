"""The studio's server behind the gate: its page, the set-up of a project, the viewer of a result,
files in and out, and the job as it goes.
"""

import asyncio
import traceback
from asyncio import StreamReader, StreamWriter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import msgspec

from calib.errors import InputError
from voxelpose.report.page import REPORT
from voxelpose.setup_page.page_requests import LARGEST_BODY
from voxelpose.studio.calibration_step import RIG_PICTURE, SHEET, BoardAsked, CalibrationAsked
from voxelpose.studio.live_step import LiveAsked, ReceiversAsked
from voxelpose.studio.record_step import AskedOfJob, RecordAsked
from voxelpose.studio.studio_jobs import EXPORTED
from voxelpose.studio.studio_session import (
    CalibrationTaken,
    ExportAsked,
    FileAsked,
    FitAsked,
    Named,
    StudioSession,
)
from voxelpose.studio.uploads import LARGEST_UPLOAD, receive
from voxelpose.view.serving.gate import UNFRAMED, Address, Gate, GatedServer, GateRequest, Reply
from voxelpose.view.serving.page_answers import (
    PAGE_HEADERS,
    Content,
    PageAnswers,
    error_reply,
    json_content,
    parse_request,
    response_head,
    send_events,
)

_LOOK_MS = 200  # between looks at the job
_PIECE = 2**18
_REPORT_POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline';"
    f" sandbox allow-scripts; {UNFRAMED}"
)


class StudioServer(GatedServer):
    """Serves the studio until it is closed."""

    def __init__(self, session: StudioSession, address: Address) -> None:
        """Starts, in a thread of its own; the session is closed with it. InputError where the
        address cannot be used.
        """
        self._session = session
        self._answers = PageAnswers("voxelpose.studio", self._get, self._post)
        gate = Gate(address, self._answer, LARGEST_BODY, LARGEST_UPLOAD)
        super().__init__(gate, session.close)

    async def _answer(
        self, request: GateRequest, reader: StreamReader, writer: StreamWriter
    ) -> None:
        try:
            reply = await self._passed_on(request, reader, writer)
        except (InputError, OSError) as error:
            reply = error_reply("400 Bad Request", " ".join(str(error).split()))
        except (asyncio.IncompleteReadError, TimeoutError):
            return  # who asked is gone
        except Exception:
            traceback.print_exc()
            words = "a bug: the terminal shows its traceback; the page goes on"
            reply = error_reply("500 Internal Server Error", words)
        if reply is not None:
            writer.write(reply.encoded())
            await writer.drain()

    async def _passed_on(
        self, request: GateRequest, reader: StreamReader, writer: StreamWriter
    ) -> Reply | None:
        """Passes a request on to who answers it; the answer, where nobody has written one."""
        session, query = self._session, dict(request.query)
        match request.path:
            case ("upload",) if request.is_upload:
                return await self._upload(request, query, reader)
            case _ if request.is_upload:
                return error_reply("400 Bad Request", "no file is taken here")
            case ("view", *parts) if "-" in parts:
                depth = parts.index("-") + 2
                await self._view("/".join(parts[: depth - 2]), request, depth, reader, writer)
            case ("live", "-", *_):
                await session.live.relay(request.below(2), reader, writer)
            case ("check", name, *rest):
                page = await asyncio.to_thread(session.setup, name, not rest)
                await page.answers.serve(request.below(2), reader, writer)
            case ("events",):
                await send_events(writer, self._statuses(), _LOOK_MS)
            case ("download",):
                folder = await asyncio.to_thread(session.folder.result, query.get("result", ""))
                nothing = "nothing is exported yet: export first"
                await _send(writer, folder / EXPORTED, f"{folder.name}.zip", nothing)
            case ("sheet", "board"):
                folder = await asyncio.to_thread(session.folder.project, query.get("project", ""))
                nothing = "no board is made yet: make it first"
                await _send(writer, folder / SHEET, SHEET, nothing)
            case ("report",):
                folder = await asyncio.to_thread(session.folder.result, query.get("result", ""))
                content = await asyncio.to_thread((folder / REPORT).read_bytes)
                headers = PAGE_HEADERS | {"Content-Security-Policy": _REPORT_POLICY}
                return Reply("200 OK", content, "text/html; charset=utf-8", headers)
            case _:
                await self._answers.serve(request, reader, writer)
        return None

    async def _upload(
        self, request: GateRequest, query: Mapping[str, str], reader: StreamReader
    ) -> Reply:
        given = {key: query.get(key, "") for key in ("project", "name", "place", "camera")}
        try:
            asked = msgspec.convert(given | {"bytes": request.body_bytes}, FileAsked)
        except msgspec.ValidationError as error:
            raise InputError(f"the page sent what is not understood: {str(error)[:200]}") from None
        target = await asyncio.to_thread(self._session.target, asked)
        await receive(self._session.folder, reader, asked.bytes, target, asked.name)
        return Reply("200 OK", *json_content({"written": target.name}), PAGE_HEADERS)

    async def _view(
        self,
        name: str,
        request: GateRequest,
        depth: int,
        reader: StreamReader,
        writer: StreamWriter,
    ) -> None:
        """Passes a request on to the viewer of a result, which is opened for its page alone: what
        an older page asks for does not close a newer one's.
        """
        viewer = self._session.viewer
        if len(request.path) == depth:
            await asyncio.to_thread(self._session.open_viewer, name)
        if viewer.browser is None or viewer.name != name:
            raise InputError("another result is open in the viewer: load this page again")
        await viewer.browser.answer(request.below(depth), reader, writer)

    def _statuses(self) -> Iterator[dict[str, Any] | None]:
        """The job's state whenever it has changed, else None."""
        job, sent_version = self._session.job, -1
        while True:
            version = job.version
            yield job.status() if version != sent_version else None
            sent_version = version

    def _get(self, path: Sequence[str], query: Mapping[str, str]) -> Content | None:
        session, project = self._session, query.get("project", "")
        match path:
            case ("api", "state"):
                return json_content(session.state())
            case ("api", "project"):
                return json_content(session.project(project))
            case ("api", "form"):
                return json_content(session.form(project, query.get("command", "")))
            case ("api", "calibration"):
                return json_content(session.calibration.state(project))
            case ("api", "live"):
                return json_content(session.live.state(project))
            case ("api", "cameras"):
                return json_content(session.recording.state(project))
            case ("preview",):
                picture = session.job.picture(query.get("camera", ""))
                if picture is None:
                    raise InputError("there is no picture yet")
                return picture, "image/jpeg"
            case ("still",):
                place, camera = query.get("place", ""), query.get("camera", "")
                return session.calibration.still(project, place, camera), "image/jpeg"
            case ("rig",):
                picture = session.folder.project(project) / RIG_PICTURE
                return picture.read_bytes(), "image/png"
            case ("sheet",):
                return session.sheet(query.get("result", "")), "image/jpeg"
        return None

    def _post(self, path: Sequence[str], body: bytes) -> Content | None:
        session = self._session
        match path:
            case ("api", "new"):
                session.folder.new_project(parse_request(body, Named).name)
            case ("api", "accepts"):
                session.target(parse_request(body, FileAsked))
            case ("api", "remove"):
                session.remove(parse_request(body, FileAsked))
            case ("api", "calibration"):
                session.take_calibration(parse_request(body, CalibrationTaken))
            case ("api", "fit"):
                session.start_fit(parse_request(body, FitAsked))
            case ("api", "board"):
                asked = parse_request(body, BoardAsked)
                return json_content(session.calibration.sheet(asked))
            case ("api", "calibrate"):
                session.calibration.start(parse_request(body, CalibrationAsked))
            case ("api", "record"):
                session.recording.start(parse_request(body, RecordAsked))
            case ("api", "live"):
                session.live.start(parse_request(body, LiveAsked))
            case ("api", "receivers"):
                session.live.send_to(parse_request(body, ReceiversAsked))
            case ("api", "ask"):
                session.job.ask(parse_request(body, AskedOfJob).word)
            case ("api", "export"):
                session.start_export(parse_request(body, ExportAsked))
            case ("api", "stop"):
                session.job.stop()
            case _:
                return None
        return json_content({})


async def _send(writer: StreamWriter, path: Path, name: str, nothing: str) -> None:
    """Sends a file to be kept. InputError with a line where there is `nothing`."""
    try:
        file = path.open("rb")
    except OSError:
        raise InputError(nothing) from None
    with file:
        headers = {
            "Content-Type": "application/octet-stream",
            "Content-Length": str(path.stat().st_size),
            "Content-Disposition": f"attachment; filename*=UTF-8''{quote(name)}",
            "Cache-Control": "no-store",
            "Connection": "close",
        }
        writer.write(response_head(PAGE_HEADERS | headers))
        while piece := await asyncio.to_thread(file.read, _PIECE):
            writer.write(piece)
            await writer.drain()
