"""What a page of the program's own is answered: its files, pictures, and requests as JSON."""

import asyncio
import traceback
from asyncio import StreamReader, StreamWriter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from importlib.resources import files
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec import Meta

from calib.errors import InputError
from voxelpose.view.serving.gate import UNFRAMED, GateRequest, Reply

Content = tuple[bytes, str]
"""Bytes and their kind."""
Name = Annotated[str, Meta(min_length=1, max_length=200)]
Moment = Annotated[int, Meta(ge=0, le=10_000_000)]
Pixel = Annotated[float, Meta(ge=-30_000, le=30_000)]
Corner = tuple[Pixel, Pixel]
_BODY_S = 60
_BEAT_MS = 10_000  # between signs of life
# Packages in whose folders `page` lies what pages share: the player's pieces, then those of forms.
_SHARED = "voxelpose.export", "voxelpose.view.serving"
_KINDS = {"html": "text/html", "css": "text/css", "js": "text/javascript"}
PAGE_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self';"
        f" img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; {UNFRAMED}"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
}
Asked = TypeVar("Asked")


class PageAnswers:
    """Answers requests for a page that the gate lets pass."""

    def __init__(
        self,
        package: str,
        got: Callable[[Sequence[str], Mapping[str, str]], Content | None],
        posted: Callable[[Sequence[str], bytes], Content | None],
        folder: str = "",
    ) -> None:
        """Reads the page's files.

        Args:
            package: in whose folder `page` they lie.
            got: answers a path and its query, None where there is no such thing; any thread calls.
            posted: answers a path and JSON likewise.
            folder: of the server, in which the page is; "": it is all that is served.
        """
        folders = (files(each).joinpath("page") for each in (*_SHARED, package))
        self._files = {file.name: file.read_bytes() for each in folders for file in each.iterdir()}
        self._got, self._posted, self._folder = got, posted, folder

    def answers(self, request: GateRequest) -> bool:
        """Whether a request is for this page."""
        return not self._folder or request.target.startswith(f"/{self._folder}/")

    async def serve(self, request: GateRequest, reader: StreamReader, writer: StreamWriter) -> None:
        """Reads what follows a request's head, which is no file, and answers it."""
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
        path = request.path[1:] if self._folder else request.path
        try:
            if request.method == "POST":
                content = self._posted(path, body)
            else:
                content = self._got(path, dict(request.query)) or self.file("/".join(path))
        except (InputError, OSError) as error:
            return error_reply("400 Bad Request", str(error))
        except Exception:
            traceback.print_exc()
            words = "a bug: the terminal shows its traceback; the page goes on"
            return error_reply("500 Internal Server Error", words)
        if content is None:
            return error_reply("404 Not Found", "this is not there")
        return Reply("200 OK", *content, PAGE_HEADERS)

    def file(self, name: str) -> Content | None:
        """A file of the page, "" its first one; None where there is none of that name."""
        name = name or "index.html"
        kind = _KINDS.get(name.rpartition(".")[2])
        if kind is None or name not in self._files:
            return None
        return self._files[name], f"{kind}; charset=utf-8"


def json_content(content: Any) -> Content:
    """An answer as JSON."""
    return msgspec.json.encode(content), "application/json"


def whole_number(query: Mapping[str, str], name: str) -> int | None:
    """The number of a name in a query; None: there is none. InputError where it is no number."""
    text = query.get(name)
    if text is None:
        return None
    if not (text.isascii() and text.isdigit() and len(text) < 9):
        raise InputError(f"{name} is no number")
    return int(text)


def parse_request(body: bytes, kind: type[Asked]) -> Asked:
    """A request of a page, in JSON, as of a class of msgspec; InputError where it is none, or a
    value is out of bounds.
    """
    try:
        return msgspec.json.decode(body, type=kind)
    except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
        raise InputError(f"the page sent what is not understood: {str(error)[:200]}") from None


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


async def send_events(writer: StreamWriter, events: Iterator[Any], every_ms: int) -> None:
    """Sends what is told, looking every so often, as server-sent events; None: nothing is new. A
    sign of life now and then shows whether the other side is still there.
    """
    headers = PAGE_HEADERS | {
        "Content-Type": "text/event-stream",
        "Cache-Control": "no-store",
        "Connection": "close",
    }
    writer.write(response_head(headers))
    silent_ms = 0
    for event in events:
        if event is not None:
            writer.write(b"data: " + msgspec.json.encode(event) + b"\n\n")
        elif silent_ms >= _BEAT_MS:
            writer.write(b":\n\n")
        silent_ms = silent_ms + every_ms if event is None and silent_ms < _BEAT_MS else 0
        await writer.drain()
        await asyncio.sleep(every_ms / 1000)


def response_head(headers: Mapping[str, str]) -> bytes:
    """Head of an answer whose content follows."""
    lines = [f"{name}: {value}" for name, value in headers.items()]
    return "\r\n".join(["HTTP/1.1 200 OK", *lines, "", ""]).encode()


def error_reply(status: str, text: str) -> Reply:
    """An answer that says in a line why there is no other."""
    return Reply(status, *json_content({"error": text}), PAGE_HEADERS)
