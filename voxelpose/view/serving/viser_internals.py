"""What the live page needs of viser beyond its public names, in one place.

viser has no access control, and its public setters of a bone compare and check every value, which
for a whole figure costs ten times the sending.
"""

from collections.abc import Container

import numpy as np
import viser
from numpy.typing import NDArray
from viser import infra

from calib.errors import InputError


def guard_connections(server: viser.ViserServer, peers: Container[tuple[str, int]]) -> None:
    """Closes connections of strangers before anything is sent, and opens no public tunnel.

    Otherwise every program of this machine, and every site in its browsers, could read what the
    server shows by trying its port.

    Args:
        server: at an address of this machine.
        peers: addresses (host, port) of those who may connect; asked at each connection.

    Raises:
        InputError: this version of viser is built otherwise.
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
    """Moves bones of a mesh.

    Args:
        handle: of the mesh, which has not been removed.
        bones: (n,) their indices.
        places: (n, 7) float64, unit quaternion w, x, y, z and position (m) of each.
    """
    from viser._messages import SetBoneOrientationMessage, SetBonePositionMessage

    for bone, place in zip(bones.tolist(), places.tolist(), strict=True):
        state = handle.bones[bone]._impl
        send = state.mesh_impl.api._queue_scene_message
        state.wxyz[:], state.position[:] = place[:4], place[4:]
        send(SetBoneOrientationMessage(state.name, bone, tuple(place[:4])))
        send(SetBonePositionMessage(state.name, bone, tuple(place[4:])))
