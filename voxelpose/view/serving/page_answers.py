"""What a page of the program's own is answered: its files, and what its functions return."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import AsyncGenerator, Callable, Iterable, Iterator, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_type_hints
from urllib.parse import quote

import msgspec
from msgspec import Meta

from calib.errors import InputError
from voxelpose.view.serving.gate import PAGE_HEADERS, GateRequest, Reply
from voxelpose.view.serving.page_words import in_page_words

Name = Annotated[str, Meta(min_length=1, max_length=200)]
Moment = Annotated[int, Meta(ge=0, le=10_000_000)]
Pixel = Annotated[float, Meta(ge=-30_000, le=30_000)]
Corner = tuple[Pixel, Pixel]
_BODY_S = 60
_BEAT_MS = 600  # between signs of life
_PIECE = 2**18
# Packages in whose folders `page` lies what pages share: the player's pieces, then those of forms.
_SHARED = "voxelpose.export", "voxelpose.view.serving"
_KINDS = {"html": "text/html", "css": "text/css", "js": "text/javascript"}
Asked = TypeVar("Asked")


class _Route:
    """A function that answers, and what its arguments may be."""

    def __init__(self, method: str, path: str, work: Callable[..., Any]) -> None:
        self._method, self._parts, self._work = method, path.split("/"), work
        hints = get_type_hints(work, include_extras=True)
        arguments: list[Any] = [
            (name, hints.get(name, str), *([] if each.default is each.empty else [each.default]))
            for name, each in inspect.signature(work).parameters.items()
        ]
        self._kind: Any = arguments[0][1] if len(arguments) == 1 else None
        self._whole = hasattr(self._kind, "__struct_fields__")  # what is sent is the argument
        if not self._whole:
            strict = method == "POST"
            self._kind = msgspec.defstruct("Query", arguments, forbid_unknown_fields=strict)

    def named(self, method: str, path: tuple[str, ...]) -> dict[str, str] | None:
        """Parts of a path by their names in braces; None: it is another route's."""
        if method != self._method or len(path) != len(self._parts):
            return None
        named = {}
        for part, given in zip(self._parts, path, strict=True):
            if part.startswith("{"):
                named[part[1:-1]] = given
            elif part != given:
                return None
        return named

    def answer(self, query: Mapping[str, str], body: bytes) -> Any:
        """What the function returns. InputError where it is asked for what nobody understands."""
        if self._method == "POST":
            asked = parse_request(body, self._kind)
        else:
            try:
                asked = msgspec.convert(query, self._kind, strict=False)
            except msgspec.ValidationError as error:
                raise not_understood(error) from None
        return self._work(asked) if self._whole else self._work(**msgspec.structs.asdict(asked))


class PageAnswers:
    """Answers requests for a page that the gate lets pass."""

    def __init__(
        self,
        package: str,
        got: Mapping[str, Callable[..., Any]],
        posted: Mapping[str, Callable[..., Any]] | None = None,
    ) -> None:
        """Reads the page's files.

        Args:
            package: in whose folder `page` they lie.
            got: functions by path, such as "picture/{camera}", whose arguments are the path's named
                parts and its query. They are called in any thread, and return a page as text, a
                picture as bytes, JPEG or PNG, a Reply, or what is sent as JSON.
            posted: likewise, with the JSON that is sent: its fields are the arguments, or it is the
                only one, an object of a class of msgspec. None returned is an empty object.
        """
        folders = (files(each).joinpath("page") for each in (*_SHARED, package))
        self._files = {file.name: file.read_bytes() for each in folders for file in each.iterdir()}
        routes = [("GET", got), ("POST", posted or {})]
        self._routes = [_Route(method, *one) for method, works in routes for one in works.items()]

    async def answer(self, request: GateRequest) -> Reply:
        """Reads what follows a request's head, which is no file, and answers it."""
        async with asyncio.timeout(_BODY_S):
            body = await request.reader.readexactly(request.body_bytes)
        path = request.path or ("",)
        for route in self._routes:
            named = route.named(request.method, path)
            if named is not None:
                query = dict(request.query) | named
                return page_reply(await asyncio.to_thread(route.answer, query, body))
        name = "/".join(path) or "index.html"
        kind = _KINDS.get(name.rpartition(".")[2])
        if request.method == "GET" and kind is not None and name in self._files:
            return Reply("200 OK", self._files[name], f"{kind}; charset=utf-8", PAGE_HEADERS)
        return Reply.error("404 Not Found", "this is not there")


def page_reply(content: Any) -> Reply:
    """A page's answer: a page as text, a picture as bytes, a Reply itself, all else as JSON."""
    match content:
        case Reply():
            return content
        case str():
            content, kind = content.encode(), "text/html; charset=utf-8"
        case bytes():
            kind = "image/png" if content.startswith(b"\x89PNG") else "image/jpeg"
        case _:
            kind = "application/json"
            content = msgspec.json.encode({} if content is None else in_page_words(content))
    return Reply("200 OK", content, kind, PAGE_HEADERS)


def not_understood(error: Exception) -> InputError:
    """The error of a page that sent what it should not."""
    return InputError(f"the page sent what is not understood: {str(error)[:200]}")


def parse_request(body: bytes, kind: type[Asked]) -> Asked:
    """A request of a page, in JSON, as of a class of msgspec; InputError where it is none, or a
    value is out of bounds.
    """
    try:
        return msgspec.json.decode(body, type=kind)
    except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
        raise not_understood(error) from None


def check_camera_names(named: Iterable[str], names: Iterable[str]) -> None:
    """Checks that there are such cameras. InputError where there is one that the recording does not
    have.
    """
    known = list(names)
    for name in named:
        if name not in known:
            raise InputError(
                f"there is no camera {name[:40]!r}: the recording has {', '.join(known)}"
            )


def event_stream(events: Iterator[Any], every_ms: int) -> Reply:
    """What is told, looked for every so often, as server-sent events; None: nothing is new. A sign
    of life, the event "beat", shows either side whether the other one is still there.
    """

    async def pieces() -> AsyncGenerator[bytes, None]:
        silent_ms = 0
        for event in events:
            if event is not None:
                yield b"data: " + msgspec.json.encode(in_page_words(event)) + b"\n\n"
            elif silent_ms >= _BEAT_MS:
                yield b"event: beat\ndata: 0\n\n"
            silent_ms = silent_ms + every_ms if event is None and silent_ms < _BEAT_MS else 0
            await asyncio.sleep(every_ms / 1000)

    return Reply("200 OK", pieces(), "text/event-stream", PAGE_HEADERS)


def file_to_keep(path: Path, name: str, nothing: str) -> Reply:
    """A file that is to be kept under a name. InputError with a line where there is `nothing`."""
    try:
        file = path.open("rb")
    except OSError:
        raise InputError(nothing) from None

    async def pieces() -> AsyncGenerator[bytes, None]:
        with file:
            while piece := await asyncio.to_thread(file.read, _PIECE):
                yield piece

    headers = PAGE_HEADERS | {
        "Content-Length": str(path.stat().st_size),
        "Content-Disposition": f"attachment; filename*=UTF-8''{quote(name)}",
    }
    return Reply("200 OK", pieces(), "application/octet-stream", headers)
