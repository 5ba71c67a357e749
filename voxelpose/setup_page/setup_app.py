"""Addresses of the setup page: its own files, pictures, and requests as JSON."""

from __future__ import annotations

import functools
import traceback
from collections.abc import Awaitable, Callable, Container
from importlib.resources import files
from typing import Any, TypeVar

import msgspec
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route
from starlette.types import ASGIApp, Receive, Scope, Send

from calib.errors import InputError
from voxelpose.setup_page.page_requests import (
    LARGEST_BODY,
    GroundRequest,
    PointsRequest,
    SaveRequest,
    SilhouetteRequest,
    parse_request,
)
from voxelpose.setup_page.setup_session import SetupSession

_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript"}
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self';"
        " img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    # The gate lets one request through on a connection.
    "Connection": "close",
}

Asked = TypeVar("Asked")
Endpoint = Callable[[Request], Awaitable[Response]]


def setup_app(session: SetupSession, peers: Container[tuple[str, int]]) -> ASGIApp:
    """The page as an ASGI application.

    Args:
        session: what is shown.
        peers: addresses (host, port) of the gate's connections: all others are refused.
    """
    page = Starlette(
        routes=[
            *_page_files(),
            Route("/api/state", _get(session.state)),
            Route("/api/silhouettes", _post(SilhouetteRequest, session.silhouettes), methods=_POST),
            Route("/api/points", _post(PointsRequest, session.errors), methods=_POST),
            Route("/api/ground", _post(GroundRequest, session.ground), methods=_POST),
            Route("/api/save", _post(SaveRequest, session.save), methods=_POST),
            Route("/api/check", _get(session.check_status)),
            Route("/api/check/start", _post(dict, lambda _: session.start_check()), methods=_POST),
            Route("/api/check/picture", _picture(lambda _: session.check_picture(), "image/png")),
            Route("/picture/{camera}", _picture(functools.partial(_frame, session), "image/jpeg")),
            Route(
                "/painted/{kind}/{camera}",
                _picture(functools.partial(_painted, session), "image/png"),
            ),
        ],
    )

    async def guarded(scope: Scope, receive: Receive, send: Send) -> None:
        client = scope.get("client") or ("", 0)
        if (client[0], client[1]) not in peers:
            answer = Response("Open the page through its gate.\n", 403, _HEADERS)
            await answer(scope, receive, send)
            return
        await page(scope, receive, send)

    return guarded


_POST = ["POST"]


def _frame(session: SetupSession, request: Request) -> bytes:
    moment = request.query_params.get("moment")
    if moment is not None and not (moment.isascii() and moment.isdigit() and len(moment) < 9):
        raise InputError("moment is no number")
    return session.picture(request.path_params["camera"], None if moment is None else int(moment))


def _painted(session: SetupSession, request: Request) -> bytes:
    return session.painted(request.path_params["camera"], request.path_params["kind"])


def _get(answer: Callable[[], Any]) -> Endpoint:
    async def endpoint(request: Request) -> Response:
        return await _answered(lambda: _json(answer()))

    return endpoint


def _post(kind: type[Asked], answer: Callable[[Asked], Any]) -> Endpoint:
    async def endpoint(request: Request) -> Response:
        body = b""
        async for piece in request.stream():
            body += piece
            if len(body) > LARGEST_BODY:
                return _error("this is more than the page takes", 413)
        return await _answered(lambda: _json(answer(parse_request(body, kind))))

    return endpoint


def _picture(make: Callable[[Request], bytes], kind: str) -> Endpoint:
    async def endpoint(request: Request) -> Response:
        return await _answered(lambda: Response(make(request), 200, _HEADERS, kind))

    return endpoint


async def _answered(work: Callable[[], Response]) -> Response:
    """The answer of work in another thread; what the user can correct as a line, a bug as 500."""
    try:
        return await run_in_threadpool(work)
    except (InputError, OSError) as error:
        return _error(str(error), 400)
    except Exception:
        traceback.print_exc()
        return _error("a bug: the terminal shows its traceback; what you drew is still here", 500)


def _json(content: Any) -> Response:
    return Response(msgspec.json.encode(content), 200, _HEADERS, "application/json")


def _error(text: str, status: int) -> Response:
    return Response(msgspec.json.encode({"error": text}), status, _HEADERS, "application/json")


def _page_files() -> list[Route]:
    """A route for each of the page's own files."""
    routes = []
    for file in files("voxelpose.setup_page").joinpath("page").iterdir():
        suffix = file.name[file.name.rfind(".") :]
        if suffix not in _TYPES:
            continue
        content, kind = file.read_bytes(), f"{_TYPES[suffix]}; charset=utf-8"

        async def endpoint(
            request: Request, content: bytes = content, kind: str = kind
        ) -> Response:
            return Response(content, 200, _HEADERS | {"Content-Type": kind})

        routes.append(Route("/" if file.name == "index.html" else f"/{file.name}", endpoint))
    return routes
