"""VMC messages to one receiver, in UDP datagrams."""

import asyncio
import socket
from contextlib import suppress

from voxelpose.live.sender import Sender
from voxelpose.live.vmc import vmc_datagrams


class DatagramSender(Sender):
    """Sends VMC messages to one receiver.

    UDP tells of an absent receiver only where the other machine reports the closed port. Frames go
    out all the same, so that a receiver that is started later has them at once.
    """

    async def connection(self) -> None:
        """See `Sender.connection`."""
        with socket.socket(self.family, socket.SOCK_DGRAM) as outlet:
            outlet.setblocking(False)
            outlet.connect((self.host, self.address.port))
            while True:
                frame, offered_s = await self.newest()
                refused = [_refused(outlet, datagram) for datagram in vmc_datagrams(frame)]
                if any(refused):
                    self.note_state("nobody listens there, sending all the same", False)
                else:
                    self.note_sent(offered_s)
                await asyncio.sleep(0)


def _refused(outlet: socket.socket, datagram: bytes) -> bool:
    """Sends a datagram; returns whether an earlier one was reported as refused.

    Raises:
        OSError: the network cannot be reached.
    """
    with suppress(BlockingIOError):  # the network takes no more: this one is lost, as UDP may
        try:
            outlet.send(datagram)
        except ConnectionRefusedError:
            with suppress(ConnectionRefusedError):
                outlet.send(datagram)  # the report took this one's place
            return True
    return False
