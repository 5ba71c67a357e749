"""voxelpose network install, list and remove."""

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from tyro.conf import arg


@dataclass(frozen=True)
class Install:
    """Installs the pose network, for rooms with poor silhouettes.

    pip gets a wheel of 36 MB by your own settings; one file of 6 MB is taken out of it, checked and
    kept for your user: MediaPipe's pose landmark network, Apache License 2.0. From then on fit,
    track, batch and the studio use it as evidence beside the silhouettes, unless --network off.

      voxelpose network install
      voxelpose network install --from mediapipe-0.10.21-cp312-cp312-manylinux_2_28_x86_64.whl
    """

    wheel: Annotated[Path | None, arg(name="from", metavar="FILE", help_behavior_hint="")] = None
    """Wheel to take the network from, where there is no connection."""

    def run(self) -> None:
        """Installs the network."""
        from voxelpose.network_install import FILES, VERSION, WHEEL, install_network

        folder = install_network(self.wheel)
        print(f"installed from {WHEEL} {VERSION}, Apache License 2.0, into {folder}:")
        for file in FILES:
            print(f"  {file.name}  {file.size / 1e6:.1f} MB  SHA-256 {file.sha256}")
        if find_spec("ai_edge_litert") is None:
            print("it runs in a third of the time with LiteRT: pip install ai-edge-litert")


@dataclass(frozen=True)
class ListInstalled:
    """Tells whether the pose network is installed, and where.

    voxelpose network list
    """

    def run(self) -> None:
        """Prints what is installed."""
        from silhouette_core.network_files import POSE_NETWORK, installed_network

        path = installed_network()
        if path is None:
            print("no network is installed: `voxelpose network install` gets it")
        else:
            print(f"{path}  {POSE_NETWORK.size / 1e6:.1f} MB  SHA-256 {POSE_NETWORK.sha256}")


@dataclass(frozen=True)
class Remove:
    """Removes the pose network.

    voxelpose network remove
    """

    def run(self) -> None:
        """Removes the network."""
        from voxelpose.network_install import remove_network

        folder = remove_network()
        print("no network is installed" if folder is None else f"removed: {folder}")


SUBCOMMANDS = {"install": Install, "list": ListInstalled, "remove": Remove}
