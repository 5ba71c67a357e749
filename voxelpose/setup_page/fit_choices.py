"""Settings of `fit` in the voxelpose.toml of a recording; its comments and all else stay."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec
from msgspec import UNSET

from calib.errors import InputError
from calib.upright import direction_of
from voxelpose.setup_page.drawn_places import change_section
from voxelpose.setup_page.page_requests import FitChosen, check_camera_names


def check_choices(chosen: FitChosen, names: Iterable[str]) -> None:
    """Checks what depends on the recording, which has cameras of these names.

    Raises:
        InputError: there is no such camera, or up is no direction.
    """
    if chosen.cameras is not UNSET and chosen.cameras is not None:
        check_camera_names(chosen.cameras, names)
        if any("," in name for name in chosen.cameras):
            raise InputError("a camera whose name holds a comma cannot be chosen: rename its files")
    if chosen.up is not UNSET and chosen.up is not None:
        direction_of(chosen.up)


def save_choices(path: Path, chosen: FitChosen) -> bool:
    """Writes settings into [fit] of a voxelpose.toml; whether there was anything to write.

    Args:
        path: the file; made where there is none.
        chosen: the settings; None takes one out of the file, so that the usual value counts.

    Raises:
        InputError: the file is no TOML, or cannot be written.
    """
    values: dict[str, Any] = msgspec.to_builtins(chosen)  # without what is unset
    if isinstance(values.get("cameras"), list):
        values["cameras"] = ",".join(values["cameras"])
    return change_section(path, "fit", values)
