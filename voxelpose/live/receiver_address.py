"""Addresses of receivers, as `--send` takes them."""

import socket
from dataclasses import dataclass
from typing import Literal
from urllib.parse import urlsplit

from calib.errors import InputError

VMC_PORT = 39539
"""Port at which receivers of the VMC protocol usually listen."""

_FORMS = "vmc://HOST:PORT or ws://HOST:PORT/PATH"


@dataclass(frozen=True)
class ReceiverAddress:
    """Address of a receiver.

    Attributes:
        text: as the user wrote it.
        protocol: "vmc", OSC messages in UDP datagrams, or "ws", JSON over a WebSocket.
        host: name or number.
        port: from 1 to 65535.
    """

    text: str
    protocol: Literal["vmc", "ws"]
    host: str
    port: int

    def resolved(self) -> tuple[socket.AddressFamily, str]:
        """Family and number of the host.

        Raises:
            InputError: the host's name is not known here.
        """
        kind = socket.SOCK_DGRAM if self.protocol == "vmc" else socket.SOCK_STREAM
        try:
            found = socket.getaddrinfo(self.host, self.port, type=kind)
        except (OSError, UnicodeError):
            raise InputError(
                f"--send {self.text}: this machine knows no host {self.host!r}: check the name, or"
                " give its number, such as 192.168.0.20"
            ) from None
        family, _, _, _, address = found[0]
        return family, str(address[0])


def parse_receiver(text: str) -> ReceiverAddress:
    """Receiver that a `--send` names.

    Args:
        text: `vmc://HOST` or `vmc://HOST:PORT`, by default port 39539, or `ws://HOST:PORT`, with a
            path and a query where the receiver wants them.

    Raises:
        InputError: it is neither of them.
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
    return ReceiverAddress(
        text.strip(), "vmc" if parts.scheme == "vmc" else "ws", parts.hostname, port
    )
