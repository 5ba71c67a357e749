"""The pose network's file: where a user installed it, and that it is the right one.

Nothing is downloaded here; `voxelpose network install` does that when it is asked to.
"""

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from platformdirs import user_data_path

from calib.errors import InputError
from silhouette_core.setting_types import NetworkUse

FOLDER_VARIABLE = "VOXELPOSE_NETWORK"


@dataclass(frozen=True)
class NetworkFile:
    """A file of a wheel."""

    name: str  #: under which it is installed.
    member: str  #: of the wheel.
    size: int  #: bytes.
    sha256: str  #: of its content.

    def matches(self, content: bytes) -> bool:
        """Whether this is its content."""
        return len(content) == self.size and hashlib.sha256(content).hexdigest() == self.sha256


POSE_NETWORK = NetworkFile(
    "pose_landmark_full.tflite",
    "mediapipe/modules/pose_landmark/pose_landmark_full.tflite",
    6_440_512,
    "e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f",
)


def network_folder() -> Path:
    """Folder of the installed network: the user's data folder, or $VOXELPOSE_NETWORK."""
    named = os.environ.get(FOLDER_VARIABLE)
    return Path(named) if named else user_data_path("voxelpose", appauthor=False) / "network"


def installed_network(use: NetworkUse = "auto") -> Path | None:
    """The network's file; None where none is installed, or none shall be used. Raises InputError
    where there is no such use, or what is installed is not the network.
    """
    if use not in get_args(NetworkUse):
        raise InputError(f"network = {str(use)[:40]!r} must be auto or off")
    path = network_folder() / POSE_NETWORK.name
    if use == "off" or not path.exists():
        return None
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    if not POSE_NETWORK.matches(content):
        raise InputError(
            f"{path} is not the network that was installed: run `voxelpose network install` again,"
            " or give --network off"
        )
    return path
