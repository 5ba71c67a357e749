"""All receivers of a session."""

import asyncio
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

from voxelpose.live.datagram_sender import DatagramSender
from voxelpose.live.live_frame import LiveFrame
from voxelpose.live.receiver_address import parse_receiver
from voxelpose.live.sender import ReceiverState, Sender
from voxelpose.live.websocket_sender import WebSocketSender


class Senders:
    """Sends every frame to all receivers, from a thread of its own.

    A receiver that is absent, slow, refuses or closes delays neither the caller nor the others: of
    the frames that it could not take, it is sent the newest.
    """

    def __init__(self, addresses: Sequence[str]) -> None:
        """Starts the thread for addresses as `parse_receiver` takes them, or none.

        Raises:
            InputError: an address is wrong, or its host is not known.
        """
        kinds: dict[str, type[Sender]] = {"vmc": DatagramSender, "ws": WebSocketSender}
        parsed = [parse_receiver(text) for text in addresses]
        self._senders = [kinds[address.protocol](address) for address in parsed]
        self._loop = asyncio.new_event_loop()
        self._stopped = asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="send to receivers", daemon=True)
        self._thread.start()

    def send(self, frame: LiveFrame) -> None:
        """Hands a frame to all receivers; returns at once and never raises.

        Pictures are not sent, and not kept.
        """
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
