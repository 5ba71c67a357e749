"""voxelpose.toml: settings of commands that a folder, those above it or a user have in common."""

import os
from pathlib import Path

from platformdirs import user_config_path

SETTINGS_FILE = "voxelpose.toml"


def settings_files(folder: Path) -> list[Path]:
    """Files that hold settings for a folder, such as a recording, the nearest first; links are
    followed.

    They are those in the folder, in every folder above it, and in the user's configuration folder.
    """
    start = Path(os.path.realpath(folder))
    folders = (start, *start.parents, user_config_path("voxelpose"))
    files = dict.fromkeys(folder / SETTINGS_FILE for folder in folders)
    # os.path takes a folder that must not be read for one without the file.
    return [file for file in files if os.path.isfile(file)]  # noqa: PTH113
