"""The setup page's server: its own files, pictures, and requests as JSON, behind the gate."""

import asyncio
import threading
import traceback
from asyncio import StreamReader, StreamWriter
from importlib.resources import files
from typing import Any

import msgspec

from calib.errors import InputError
from voxelpose.setup_page.page_requests import (
    LARGEST_BODY,
    GroundRequest,
    PointsRequest,
    SaveRequest,
    SilhouetteRequest,
    StageRequest,
    parse_request,
)
from voxelpose.setup_page.setup_session import SetupSession
from voxelpose.view.serving.gate import Address, Gate, GateRequest, Reply

_BODY_S = 60
_KINDS = {"html": "text/html", "css": "text/css", "js": "text/javascript"}
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self';"
        " img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
}


class SetupServer:
    """Serves the page until it is closed."""

    def __init__(self, session: SetupSession, address: Address) -> None:
        """Starts, in a thread of its own.

        Args:
            session: what is shown; closed with the server.

        Raises:
            InputError: the address cannot be used.
        """
        self._session = session
        self._ended = threading.Event()
        folder = files("voxelpose.setup_page").joinpath("page")
        self._files = {file.name: file.read_bytes() for file in folder.iterdir()}
        self._gate = Gate(address, self._serve, LARGEST_BODY)
        self.url, self.port = self._gate.url, self._gate.port

    def wait(self) -> None:
        """Waits until somebody interrupts, or the server is closed."""
        while not self._ended.wait(0.5):
            pass

    def close(self) -> None:
        """Ends all connections and threads."""
        self._ended.set()
        self._gate.close()
        self._session.close()

    async def _serve(
        self, request: GateRequest, reader: StreamReader, writer: StreamWriter
    ) -> None:
        try:
            async with asyncio.timeout(_BODY_S):
                body = await reader.readexactly(request.body_bytes)
        except (asyncio.IncompleteReadError, TimeoutError):
            return  # who asked is gone
        reply = await asyncio.to_thread(self._reply, request, body)
        writer.write(reply.encoded())
        await writer.drain()

    def _reply(self, request: GateRequest, body: bytes) -> Reply:
        """The answer; what the user can correct as a line, a bug as 500."""
        try:
            content = (
                self._posted(request, body) if request.method == "POST" else self._got(request)
            )
        except (InputError, OSError) as error:
            return _error("400 Bad Request", str(error))
        except Exception:
            traceback.print_exc()
            words = "a bug: the terminal shows its traceback; what you drew is still here"
            return _error("500 Internal Server Error", words)
        if content is None:
            return _error("404 Not Found", "this is not there")
        return Reply("200 OK", *content, _HEADERS)

    def _got(self, request: GateRequest) -> tuple[bytes, str] | None:
        """What is asked for, and its kind; None where there is no such thing."""
        session = self._session
        match request.path:
            case ("api", "state"):
                return _json(session.state())
            case ("api", "check"):
                return _json(session.check.status())
            case ("api", "check", "picture"):
                return session.check.picture(), "image/png"
            case ("picture", camera):
                moment = dict(request.query).get("moment")
                if moment is None:
                    return session.picture(camera, None), "image/jpeg"
                if not (moment.isascii() and moment.isdigit() and len(moment) < 9):
                    raise InputError("moment is no number")
                return session.picture(camera, int(moment)), "image/jpeg"
            case ("painted", kind, camera):
                return session.painted(camera, kind), "image/png"
        name = "/".join(request.path) or "index.html"
        kind = _KINDS.get(name.rpartition(".")[2])
        if kind is None or name not in self._files:
            return None
        return self._files[name], f"{kind}; charset=utf-8"

    def _posted(self, request: GateRequest, body: bytes) -> tuple[bytes, str] | None:
        """The answer to JSON that the page has sent; None where nobody takes it."""
        session = self._session
        match request.path:
            case ("api", "silhouettes"):
                return _json(session.silhouettes(parse_request(body, SilhouetteRequest)))
            case ("api", "stage"):
                return _json(session.stage(parse_request(body, StageRequest)))
            case ("api", "points"):
                return _json(session.errors(parse_request(body, PointsRequest)))
            case ("api", "ground"):
                return _json(session.ground(parse_request(body, GroundRequest)))
            case ("api", "save"):
                return _json(session.save(parse_request(body, SaveRequest)))
            case ("api", "check", "start"):
                return _json(session.start_check())
        return None


def _json(content: Any) -> tuple[bytes, str]:
    return msgspec.json.encode(content), "application/json"


def _error(status: str, text: str) -> Reply:
    return Reply(status, *_json({"error": text}), _HEADERS)
