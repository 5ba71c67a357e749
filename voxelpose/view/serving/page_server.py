"""viser's server behind the page's gate, and what pages need of viser beyond its public names.

viser has no access control, and its public setters of a bone compare and check every value, which
for a whole figure costs ten times the sending.
"""

import asyncio
import io
from asyncio import StreamReader, StreamWriter
from collections.abc import Container
from contextlib import redirect_stdout
from email.parser import BytesParser
from html import escape

import numpy as np
import viser
from numpy.typing import NDArray
from viser import infra

from calib.errors import InputError
from voxelpose.view.serving.gate import Address, Gate, GateRequest, Reply, pass_on, until_one_ends


def guard_connections(server: viser.ViserServer, peers: Container[tuple[str, int]]) -> None:
    """Closes connections of all but `peers` (host, port), asked at each, to a server at an address
    of this machine, before anything is sent, and opens no public tunnel.

    Otherwise every program of this machine, and every site in its browsers, could read what the
    server shows by trying its port. InputError where this version of viser is built otherwise.
    """
    try:
        from viser._messages import ShareUrlRequest

        inner = server._websock_server
        links, callbacks = inner._live_connections, inner._client_connect_cb
        # A page may ask viser for an address that anybody in the world can open.
        inner.unregister_handler(ShareUrlRequest)
    except (ImportError, AttributeError, AssertionError):
        raise InputError(
            f"the live page does not know viser {viser.__version__}: install another, with pip"
            " install 'viser==1.1.*'"
        ) from None

    async def guard(client: infra.WebsockClientConnection) -> None:
        # Callbacks are awaited before the first message; nothing can follow a closed connection.
        link = links[client.client_id]
        if tuple(link.remote_address[:2]) not in peers:
            await link.close(1008, "Open the page through its gate.")

    callbacks.insert(0, guard)
    inner.disconnect_all_clients()  # who came before the guard


def move_bones(
    handle: viser.MeshSkinnedHandle, bones: NDArray[np.intp], places: NDArray[np.float64]
) -> None:
    """Moves bones (n,) of a mesh that has not been removed to places (n, 7) float64, unit
    quaternion w, x, y, z and position (m) of each.
    """
    from viser._messages import SetBoneOrientationMessage, SetBonePositionMessage

    for bone, place in zip(bones.tolist(), places.tolist(), strict=True):
        state = handle.bones[bone]._impl
        send = state.mesh_impl.api._queue_scene_message
        state.wxyz[:], state.position[:] = place[:4], place[4:]
        send(SetBoneOrientationMessage(state.name, bone, tuple(place[:4])))
        send(SetBonePositionMessage(state.name, bone, tuple(place[4:])))


class PageServer:
    """Serves viser's scene and panel to those whom the gate lets pass, at a `url` that includes the
    token.

    viser has no access control. It listens at a free port of 127.0.0.1, sends nothing to a
    connection that does not come from the gate, and opens no public tunnel for anybody.
    """

    def __init__(self, address: Address, title: str) -> None:
        """Starts both. InputError as of `Gate` and `guard_connections`."""
        with redirect_stdout(io.StringIO()):  # viser would print a banner
            self.viser = viser.ViserServer("127.0.0.1", 0, label="voxelpose", verbose=False)
        self._peers: set[tuple[str, int]] = set()
        self._title = f"<title>{escape(title)}</title>".encode()
        try:
            guard_connections(self.viser, self._peers)
            self.gate = Gate(address, self.answer)
            self.url, self.port = self.gate.url, self.gate.port
        except BaseException:
            self._stop_viser()
            raise
        gui = self.viser.gui
        gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()

    @property
    def watched(self) -> bool:
        """Whether any browser shows the page."""
        return bool(self.viser.get_clients())

    def close(self) -> None:
        """Ends all connections and threads."""
        self.gate.close()
        self._stop_viser()

    def _stop_viser(self) -> None:
        with redirect_stdout(io.StringIO()):
            self.viser.stop()

    async def answer(
        self, request: GateRequest, reader: StreamReader, writer: StreamWriter
    ) -> None:
        """Answers a request that may pass."""
        if request.upgrade:
            await self._relay(request, reader, writer)
        else:
            reply = Reply("400 Bad Request", "This page takes GET only.")
            if request.method == "GET":
                reply = await self._file(request)
            writer.write(reply.encoded())
            await writer.drain()

    async def _file(self, request: GateRequest) -> Reply:
        """A file of viser's, with the page's title."""
        port = self.viser.get_port()
        inner_reader, inner_writer = await asyncio.open_connection("127.0.0.1", port)
        try:
            inner_writer.write(f"GET {request.target} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
            answer = await inner_reader.read(-1)
        finally:
            inner_writer.close()
        head, _, body = answer.partition(b"\r\n\r\n")
        status, _, lines = head.partition(b"\r\n")
        kind = BytesParser().parsebytes(lines).get("Content-Type", "text/plain")
        if kind.startswith("text/html"):
            body = body.replace(b"<title>Viser</title>", self._title, 1)
        return Reply(status.decode("latin-1").partition(" ")[2], body, kind)

    async def _relay(
        self, request: GateRequest, reader: StreamReader, writer: StreamWriter
    ) -> None:
        """Passes a WebSocket on, and whatever follows either way."""
        port = self.viser.get_port()
        inner_reader, inner_writer = await asyncio.open_connection("127.0.0.1", port)
        address = inner_writer.get_extra_info("sockname")[:2]
        self._peers.add(address)
        try:
            inner_writer.write(request.head)
            await until_one_ends(pass_on(inner_reader, writer), pass_on(reader, inner_writer))
        finally:
            inner_writer.close()
            self._peers.discard(address)
