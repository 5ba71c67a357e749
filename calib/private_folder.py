"""A temporary folder that belongs to one user and that nobody else can write to."""

import os
import stat
import tempfile
from contextlib import suppress
from pathlib import Path

from calib.errors import InputError


def private_folder() -> Path:
    """The user's own folder among the temporary files, the same for all processes; it is for caches
    where neither the installation nor the home folder can be written.

    What lies there is run: where the name is taken by somebody else, or others may write to the
    folder, this process gets a new one.

    Raises:
        InputError: There is no folder of temporary files that can be written.
    """
    user = getattr(os, "getuid", lambda: "user")()
    try:
        with suppress(FileExistsError):  # no folder
            folder = Path(tempfile.gettempdir()) / f"voxelpose-{user}"
            folder.mkdir(mode=0o700, exist_ok=True)
            status = folder.lstat()
            is_private = status.st_uid == user and not stat.S_IMODE(status.st_mode) & 0o077
            is_usable = stat.S_ISDIR(status.st_mode) and (is_private or os.name == "nt")
            if is_usable and os.access(folder, os.W_OK):
                return folder
        return Path(tempfile.mkdtemp(prefix="voxelpose-"))
    except OSError as error:
        raise InputError(
            f"no folder of temporary files can be written ({error.strerror or error}): set TMPDIR"
        ) from error
