"""All receivers of a session."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from voxelpose.live.datagram_sender import DatagramSender
from voxelpose.live.live_frame import LiveFrame
from voxelpose.live.receiver_address import parse_receiver
from voxelpose.live.sender import ReceiverState, Sender
from voxelpose.live.websocket_sender import WebSocketSender


class Senders:
    """Sends every frame to all receivers, each from a thread of its own.

    A receiver that is absent, slow, refuses or closes delays neither the caller nor the others: of
    the frames that it could not take, it is sent the newest.
    """

    def __init__(self, addresses: Sequence[str]) -> None:
        """Starts a thread for each receiver.

        Args:
            addresses: as `parse_receiver` takes them; none are allowed, too.

        Raises:
            InputError: an address is wrong, or its host is not known.
        """
        parsed = [parse_receiver(text) for text in addresses]
        self._senders: list[Sender] = []
        try:
            for address in parsed:
                kind = DatagramSender if address.protocol == "vmc" else WebSocketSender
                self._senders.append(kind(address))
        except BaseException:
            self.close()
            raise

    def send(self, frame: LiveFrame) -> None:
        """Hands a frame to all receivers' threads; returns at once and never raises.

        Pictures are not sent, and not kept.
        """
        if self._senders:
            slim = replace(frame, pictures={}, silhouettes={})
            for sender in self._senders:
                sender.offer(slim)

    @property
    def states(self) -> tuple[ReceiverState, ...]:
        """How it goes with each receiver, in the order of the addresses."""
        return tuple(sender.state for sender in self._senders)

    def close(self) -> None:
        """Ends all connections and threads; frames that still wait are not sent."""
        for sender in self._senders:
            sender.stop()
        for sender in self._senders:
            sender.join()
