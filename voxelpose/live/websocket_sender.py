"""JSON lines to one receiver, over a WebSocket that is opened from here."""

import asyncio
import time

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidStatus

from voxelpose.live.json_message import json_message
from voxelpose.live.sender import Sender

_OPEN_S = 3
_SILENT_S = 5


class WebSocketSender(Sender):
    """Sends JSON lines to one receiver.

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
                await self._converse(link)
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

    async def _converse(self, link: ClientConnection) -> None:
        """Sends and reads until either fails.

        Raises:
            ConnectionClosed: the receiver closed.
            TimeoutError: it does not read.
        """
        tasks = asyncio.create_task(self._feed(link)), asyncio.create_task(self._read(link))
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
        for task in done:
            task.result()

    async def _feed(self, link: ClientConnection) -> None:
        while True:
            frame, offered_s = await self.newest()
            await link.send(json_message(frame, time.time()))
            self.note_sent(offered_s)
            async with asyncio.timeout(_SILENT_S):
                await (await link.ping())

    async def _read(self, link: ClientConnection) -> None:
        while True:
            await link.recv()
