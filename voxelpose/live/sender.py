"""One receiver: it is sent the newest frame, and tried again where nobody answers."""

import asyncio
import math
import time
from abc import ABC, abstractmethod
from collections import deque
from dataclasses import dataclass
from statistics import median

from voxelpose.live.live_frame import LiveFrame
from voxelpose.live.receiver_address import ReceiverAddress
from voxelpose.tuning import LIVE

_RECENT = 60  # frames whose times are kept


@dataclass(frozen=True)
class ReceiverState:
    """State of one receiver.

    Attributes:
        address: as the user wrote it.
        message: "sending", "waiting for a frame", or what is wrong and when it is tried again.
        working: whether frames arrive, as far as the protocol tells.
        sent: number of frames sent.
        dropped: number of frames that a newer one replaced before they could be sent.
        send_s: from `Senders.send` to the network, median of recent frames; nan before the first.
    """

    address: str
    message: str
    working: bool
    sent: int = 0
    dropped: int = 0
    send_s: float = math.nan


class Sender(ABC):
    """Sends frames to one receiver, in the event loop of `Senders`.

    Attributes:
        address: of the receiver.
    """

    def __init__(self, address: ReceiverAddress) -> None:
        """Looks the host up.

        Raises:
            InputError: the host's name is not known here.
        """
        self.address = address
        self.family, self.host = address.resolved()
        self._waiting: tuple[LiveFrame, float] | None = None
        self._arrived = asyncio.Event()
        self._message, self._working = "waiting for a frame", False
        self._sent = self._dropped = 0
        self._send_s: deque[float] = deque(maxlen=_RECENT)

    def offer(self, frame: LiveFrame, offered_s: float) -> None:
        """Takes a frame and the time of `Senders.send`; it replaces one that still waits."""
        self._dropped += self._waiting is not None
        self._waiting = frame, offered_s
        self._arrived.set()

    @property
    def state(self) -> ReceiverState:
        """How it goes; any thread may ask."""
        send_s = median(self._send_s) if self._send_s else math.nan
        counts = self._sent, self._dropped
        return ReceiverState(self.address.text, self._message, self._working, *counts, send_s)

    async def keep_trying(self) -> None:
        """Connects and sends, and tries again where that fails, until it is cancelled."""
        wait_s = LIVE.first_wait_s
        try:
            while True:
                before, problem = self._sent, ""
                try:
                    await self.connection()
                except OSError as error:
                    problem = error.strerror or str(error)
                except Exception as error:  # one receiver must not end the session
                    problem = f"{type(error).__name__}: {error}"
                wait_s = LIVE.first_wait_s if self._sent > before else wait_s
                self.note_state(f"{problem}, trying again in {wait_s:g} s", False)
                await asyncio.sleep(wait_s)
                wait_s = min(2 * wait_s, LIVE.longest_wait_s)
        finally:
            self.note_state("closed", False)

    @abstractmethod
    async def connection(self) -> None:
        """Connects and sends frames, until it fails.

        Raises:
            OSError: the receiver is absent, refused, or closed; the message says which.
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
        self._sent += 1
        self._send_s.append(time.perf_counter() - offered_s)
        self.note_state("sending", True)

    def note_state(self, message: str, working: bool) -> None:
        """Notes how it goes."""
        self._message, self._working = message, working
