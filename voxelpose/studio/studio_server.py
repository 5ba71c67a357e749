"""The studio's server behind the gate: its page, the set-up of a project, the viewer of a result,
files in and out, and the job as it goes.
"""

import asyncio

import msgspec

from calib.errors import InputError
from voxelpose.report.page import REPORT
from voxelpose.setup_page.page_requests import LARGEST_BODY
from voxelpose.studio.calibration_step import RIG_PICTURE, SHEET
from voxelpose.studio.studio_jobs import EXPORTED
from voxelpose.studio.studio_session import FileSent, StudioSession
from voxelpose.studio.uploads import LARGEST_UPLOAD, receive
from voxelpose.view.serving.gate import (
    PAGE_HEADERS,
    UNFRAMED,
    Address,
    GatedServer,
    GateRequest,
    Reply,
)
from voxelpose.view.serving.page_answers import (
    PageAnswers,
    file_to_keep,
    not_understood,
    page_reply,
)

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
        self._answers = PageAnswers(
            "voxelpose.studio",
            {
                "api/state": session.state,
                "api/project": session.project,
                "api/form": session.form,
                "api/calibration": session.calibration.state,
                "api/live": session.live.state,
                "api/cameras": session.recording.state,
                "events": session.job.events,
                "preview": self._preview,
                "still": session.picture,
                "rig": lambda project: (session.folder.project(project) / RIG_PICTURE).read_bytes(),
                "sheet": session.sheet,
                "sheet/board": self._board,
                "report": self._report,
                "download": self._export,
            },
            {
                "api/new": session.folder.new_project,
                "api/rename": session.rename,
                "api/duplicate": session.changes.duplicate,
                "api/delete": session.delete,
                "api/put_back": session.changes.put_back,
                "api/empty": session.changes.empty,
                "api/plan": session.plan,
                "api/remove": session.remove,
                "api/calibration": session.take_calibration,
                "api/fit": session.start_fit,
                "api/fits": session.start_fits,
                "api/demo": session.start_demo,
                "api/board": session.calibration.sheet,
                "api/calibrate": session.calibration.start,
                "api/record": session.recording.start,
                "api/live": session.live.start,
                "api/receivers": session.live.send_to,
                "api/ask": session.ask,
                "api/export": session.start_export,
                "api/stop": session.job.stop,
                "api/repeat": session.repeat,
                "api/queue": session.job.put_before,
            },
        )
        super().__init__(address, self._answer, session.close, LARGEST_BODY, LARGEST_UPLOAD)

    async def _answer(self, request: GateRequest) -> Reply:
        """Passes a request on to the page that it is for."""
        match request.path:
            case ("upload",) if request.is_upload:
                return await self._upload(request)
            case _ if request.is_upload:
                raise InputError("no file is taken here")
            case ("view", *parts) if "-" in parts:
                return await self._view(request, parts.index("-"))
            case ("live", "-", *_):
                return await self._session.live.relay(request.below(2))
            case ("check", name, *rest):
                page = await asyncio.to_thread(self._session.setup, name, not rest)
                return await page.answers.answer(request.below(2))
        return await self._answers.answer(request)

    async def _upload(self, request: GateRequest) -> Reply:
        try:
            query = dict(request.query)
            asked = msgspec.convert(query | {"bytes": request.body_bytes}, FileSent)
        except msgspec.ValidationError as error:
            raise not_understood(error) from None
        target, present = await asyncio.to_thread(self._session.target, asked)
        await receive(request.reader, asked.bytes, target, present)
        return page_reply({"written": target.name})

    async def _view(self, request: GateRequest, parts: int) -> Reply:
        """Passes a request on to the viewer of a result, whose name has so many parts; it is opened
        for its page alone: what an older page asks for does not close a newer one's.
        """
        name = "/".join(request.path[1 : 1 + parts])
        if len(request.path) == parts + 2:
            await asyncio.to_thread(self._session.open_viewer, name)
        return await self._session.viewers.browser(name).answer(request.below(parts + 2))

    def _preview(self, camera: str) -> bytes:
        picture = self._session.job.picture(camera)
        if picture is None:
            raise InputError("there is no picture yet")
        return picture

    def _board(self, project: str) -> Reply:
        path = self._session.folder.project(project) / SHEET
        return file_to_keep(path, SHEET, "no board is made yet: make it first")

    def _export(self, result: str) -> Reply:
        folder = self._session.folder.result(result)
        nothing = "nothing is exported yet: export first"
        return file_to_keep(folder / EXPORTED, f"{folder.name}.zip", nothing)

    def _report(self, result: str) -> Reply:
        content = (self._session.folder.result(result) / REPORT).read_bytes()
        headers = PAGE_HEADERS | {"Content-Security-Policy": _REPORT_POLICY}
        return Reply("200 OK", content, "text/html; charset=utf-8", headers)
