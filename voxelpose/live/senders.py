"""Receivers of a session: each is sent the newest frame, as VMC in UDP datagrams or as JSON over
a WebSocket, and tried again where nobody answers.
"""

import asyncio
import math
import socket
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Coroutine, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from statistics import median
from typing import Any, Literal
from urllib.parse import urlsplit

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidStatus

from calib.errors import InputError
from voxelpose.live.camera_source import retry_waits_s
from voxelpose.live.live_frame import LiveFrame
from voxelpose.live.messages import json_message, vmc_datagrams
from voxelpose.view.serving.gate import LAST_PORT

VMC_PORT = 39539
"""Port at which receivers of the VMC protocol usually listen."""

_FORMS = "vmc://HOST:PORT or ws://HOST:PORT/PATH"
_RECENT = 60  # frames whose times are kept
_OPEN_S = 3
_SILENT_S = 5


@dataclass(frozen=True)
class ReceiverAddress:
    """Address of a receiver: VMC in UDP datagrams, or JSON over a WebSocket."""

    text: str
    protocol: Literal["vmc", "ws"]
    host: str
    port: int

    @property
    def shown(self) -> str:
        """The address without its query, which may hold a token."""
        start, query, _ = self.text.partition("?")
        return f"{start}?…" if query else start

    def resolved(self) -> tuple[socket.AddressFamily, str]:
        """Family and number of the host. InputError where the host's name is not known here."""
        kind = socket.SOCK_DGRAM if self.protocol == "vmc" else socket.SOCK_STREAM
        try:
            addresses = socket.getaddrinfo(self.host, self.port, type=kind)
        except (OSError, UnicodeError):
            raise InputError(
                f"--send {self.shown}: this machine knows no host {self.host!r}: check the name, or"
                " give its number, such as 192.168.0.20"
            ) from None
        family, _, _, _, address = addresses[0]
        return family, str(address[0])


def parse_receiver(text: str, people: int = 1) -> ReceiverAddress:
    """Receiver that a `--send` names: `vmc://HOST` or `vmc://HOST:PORT`, by default port 39539, or
    `ws://HOST:PORT`, with a path and a query where the receiver wants them. InputError where it is
    neither, or where there are no ports for so many people.
    """
    try:
        parts = urlsplit(text.strip())
        port = parts.port
    except ValueError as error:
        raise InputError(f"--send {text}: {error}: write {_FORMS}") from None
    if parts.scheme not in ("vmc", "ws"):
        wrong = f"{parts.scheme}:// is not understood" if parts.scheme else "no protocol is named"
        raise InputError(f"--send {text}: {wrong}: write {_FORMS}")
    if not parts.hostname:
        raise InputError(f"--send {text}: the host is missing: write {_FORMS}")
    if parts.username is not None or parts.fragment:
        raise InputError(f"--send {text}: a user name or a # has no meaning here: write {_FORMS}")
    if port is None and parts.scheme == "vmc":
        port = VMC_PORT
    if not port:
        raise InputError(f"--send {text}: the port is missing: write {_FORMS}")
    if parts.scheme == "vmc" and (parts.path.strip("/") or parts.query):
        raise InputError(f"--send {text}: VMC has no paths: write vmc://{parts.netloc}")
    if parts.scheme == "vmc" and port + people - 1 > LAST_PORT:
        raise InputError(
            f"--send {text}: {people} people need {people} ports: give {LAST_PORT + 1 - people} at"
            " most"
        )
    return ReceiverAddress(
        text.strip(), "vmc" if parts.scheme == "vmc" else "ws", parts.hostname, port
    )


@dataclass(frozen=True)
class ReceiverState:
    """State of one receiver."""

    address: str  # as the user wrote it, without its query
    message: str  # "sending", "waiting for a frame", or what is wrong and when it is tried again
    working: bool  # whether frames arrive, as far as the protocol tells
    sent: int = 0
    dropped: int = 0  # number of frames that a newer one replaced before they could be sent
    # From `Senders.send` to the network, median of recent frames; nan before the first.
    send_s: float = math.nan


class Sender(ABC):
    """Sends frames to one receiver, in the event loop of `Senders`; any thread may read `state`."""

    def __init__(self, address: ReceiverAddress) -> None:
        """Looks the host up. InputError where the host's name is not known here."""
        self.address = address
        self.family, self.host = address.resolved()
        self._waiting: tuple[LiveFrame, float] | None = None
        self._arrived = asyncio.Event()
        self.state = ReceiverState(address.shown, "waiting for a frame", False)
        self._send_s: deque[float] = deque(maxlen=_RECENT)

    def offer(self, frame: LiveFrame, offered_s: float) -> None:
        """Takes a frame and the time of `Senders.send`; it replaces one that still waits."""
        if self._waiting is not None:
            self.state = replace(self.state, dropped=self.state.dropped + 1)
        self._waiting = frame, offered_s
        self._arrived.set()

    async def keep_trying(self) -> None:
        """Connects and sends, and tries again where that fails, until it is cancelled."""
        waits_s = retry_waits_s()
        try:
            while True:
                before, problem = self.state.sent, ""
                try:
                    await self.connection()
                except OSError as error:
                    problem = error.strerror or str(error)
                except Exception as error:  # one receiver must not end the session
                    problem = f"{type(error).__name__}: {error}"
                waits_s = retry_waits_s() if self.state.sent > before else waits_s
                wait_s = next(waits_s)
                self.note_state(f"{problem}, trying again in {wait_s:g} s", False)
                await asyncio.sleep(wait_s)
        finally:
            self.note_state("closed", False)

    @abstractmethod
    async def connection(self) -> None:
        """Connects and sends frames, until it fails. OSError where the receiver is absent, refused,
        or closed; the message says which.
        """

    async def newest(self) -> tuple[LiveFrame, float]:
        """Waits for a frame; returns it with the time at which it was offered."""
        while self._waiting is None:
            self._arrived.clear()
            await self._arrived.wait()
        waiting, self._waiting = self._waiting, None
        return waiting

    def note_sent(self, offered_s: float) -> None:
        """Notes that a frame, offered at that time, has gone to the network."""
        self._send_s.append(time.perf_counter() - offered_s)
        self.state = replace(self.state, sent=self.state.sent + 1, send_s=median(self._send_s))
        self.note_state("sending", True)

    def note_state(self, message: str, working: bool) -> None:
        """Notes how it goes."""
        self.state = replace(self.state, message=message, working=working)


class DatagramSender(Sender):
    """Sends VMC messages to one receiver; those of each further person to the next port, since a
    receiver moves one avatar by what comes to a port.

    UDP tells of an absent receiver only where the other machine reports the closed port. Frames go
    out all the same, so that a receiver that is started later has them at once.
    """

    async def connection(self) -> None:
        """See `Sender.connection`."""
        with ExitStack() as outlet_stack:
            outlets = [outlet_stack.enter_context(self._outlet(0))]
            while True:
                frame, offered_s = await self.newest()
                for person in range(len(outlets), len(frame.people)):
                    outlets.append(outlet_stack.enter_context(self._outlet(person)))
                refused = [
                    _send_datagram(outlet, datagram)
                    for person, outlet in enumerate(outlets)
                    for datagram in vmc_datagrams(frame, person)
                ]
                if any(refused):
                    self.note_state("nobody listens there, sending all the same", False)
                else:
                    self.note_sent(offered_s)
                await asyncio.sleep(0)

    def _outlet(self, person: int) -> socket.socket:
        outlet = socket.socket(self.family, socket.SOCK_DGRAM)
        outlet.setblocking(False)
        outlet.connect((self.host, self.address.port + person))
        return outlet


def _send_datagram(outlet: socket.socket, datagram: bytes) -> bool:
    """Sends a datagram; returns whether an earlier one was reported as refused. OSError where the
    network cannot be reached.
    """
    with suppress(BlockingIOError):  # the network takes no more: this one is lost, as UDP may
        try:
            outlet.send(datagram)
        except ConnectionRefusedError:
            with suppress(ConnectionRefusedError):
                outlet.send(datagram)  # the report took this one's place
            return True
    return False


class WebSocketSender(Sender):
    """Sends JSON lines to one receiver, of several people a line each.

    Each frame is followed by a ping, and the next one waits for its pong, which every WebSocket
    implementation gives by itself: so frames do not pile up in buffers before a slow receiver.
    What the receiver sends is ignored.
    """

    async def connection(self) -> None:
        """See `Sender.connection`."""
        try:
            async with connect(
                self.address.text,
                host=self.host,
                port=self.address.port,
                open_timeout=_OPEN_S,
                close_timeout=0.5,
                ping_interval=None,
                compression=None,
                proxy=None,
            ) as link:
                self.note_state("connected, waiting for a frame", True)
                await _until_one_ends(self._send_frames(link), self._read(link))
        except TimeoutError:
            raise ConnectionError("no answer") from None
        except ConnectionRefusedError:
            raise ConnectionError("nobody listens there") from None
        except ConnectionClosed as error:
            reason = error.rcvd.reason if error.rcvd is not None else ""
            raise ConnectionError(f"it closed the connection{reason and f' ({reason})'}") from None
        except InvalidStatus as error:
            raise ConnectionError(
                f"it refused the connection (HTTP {error.response.status_code})"
            ) from None
        except (InvalidHandshake, EOFError):
            raise ConnectionError("it does not speak WebSocket") from None

    async def _send_frames(self, link: ClientConnection) -> None:
        while True:
            frame, offered_s = await self.newest()
            for person in range(len(frame.people)):
                await link.send(json_message(frame, time.time(), person))
            self.note_sent(offered_s)
            async with asyncio.timeout(_SILENT_S):
                await (await link.ping())

    async def _read(self, link: ClientConnection) -> None:
        while True:
            await link.recv()


class Senders:
    """Sends every frame to all receivers, from a thread of its own.

    A receiver that is absent, slow, refuses or closes delays neither the caller nor the others: of
    the frames that it could not take, it is sent the newest.
    """

    def __init__(self, addresses: Sequence[str]) -> None:
        """Starts the thread for addresses as `parse_receiver` takes them, or none. InputError where
        an address is wrong, or its host is not known.
        """
        kinds: dict[str, type[Sender]] = {"vmc": DatagramSender, "ws": WebSocketSender}
        parsed = [parse_receiver(text) for text in addresses]
        self._senders = [kinds[address.protocol](address) for address in parsed]
        self._loop = asyncio.new_event_loop()
        self._stopped = asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="send to receivers", daemon=True)
        self._thread.start()

    def send(self, frame: LiveFrame) -> None:
        """Hands a frame, but no pictures, to all receivers; returns at once and never raises."""
        slim = replace(frame, pictures={}, silhouettes={})
        with suppress(RuntimeError):  # closed
            self._loop.call_soon_threadsafe(self._offer, slim, time.perf_counter())

    @property
    def states(self) -> tuple[ReceiverState, ...]:
        """How it goes with each receiver, in the order of the addresses."""
        return tuple(sender.state for sender in self._senders)

    def close(self) -> None:
        """Ends all connections and the thread; frames that still wait are not sent."""
        with suppress(RuntimeError):  # closed already
            self._loop.call_soon_threadsafe(self._stopped.set)
        self._thread.join()

    def _offer(self, frame: LiveFrame, offered_s: float) -> None:
        for sender in self._senders:
            sender.offer(frame, offered_s)

    def _run(self) -> None:
        try:
            self._loop.run_until_complete(self._keep_sending())
        finally:
            self._loop.close()

    async def _keep_sending(self) -> None:
        tasks = [asyncio.create_task(sender.keep_trying()) for sender in self._senders]
        await self._stopped.wait()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _until_one_ends(*works: Coroutine[Any, Any, None]) -> None:
    """Runs until one of them ends, cancels the others, and raises what it raised."""
    tasks = [asyncio.create_task(work) for work in works]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    for task in done:
        task.result()
