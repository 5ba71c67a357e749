"""Temporary files: a folder that belongs to one user and that nobody else can write to, and scratch
files without a name, so that they end with the process however that ends.
"""

import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock

from calib.errors import InputError
from calib.storage.atomic import is_disk_full


def private_folder() -> Path:
    """The user's own folder among the temporary files, the same for all processes; it is for caches
    where neither the installation nor the home folder can be written. InputError where there is no
    folder of temporary files that can be written.

    What lies there is run: where the name is taken by somebody else, or others may write to the
    folder, this process gets a new one.
    """
    user = getattr(os, "getuid", lambda: "user")()
    with _said():
        with suppress(FileExistsError):  # no folder
            folder = Path(tempfile.gettempdir()) / f"voxelpose-{user}"
            folder.mkdir(mode=0o700, exist_ok=True)
            status = folder.lstat()
            is_private = status.st_uid == user and not stat.S_IMODE(status.st_mode) & 0o077
            is_usable = stat.S_ISDIR(status.st_mode) and (is_private or os.name == "nt")
            if is_usable and os.access(folder, os.W_OK):
                return folder
        return Path(tempfile.mkdtemp(prefix="voxelpose-"))


class ScratchFile:
    """Bytes outside memory, in the folder of temporary files; any thread may use it.

    Read and written, not mapped, since a full disk would end the process then.
    """

    def __init__(self) -> None:
        """Creates the file. InputError where the folder of temporary files cannot be written to."""
        with _said():
            self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115
        self._lock, self._end = Lock(), 0

    def append(self, content: bytes) -> int:
        """Writes at the end; returns where it begins. InputError where the disk is full."""
        with self._lock:
            start = self._end
            self._end += len(content)
            with _said():
                self._file.seek(start)
                left = memoryview(content)
                while left:
                    left = left[self._file.write(left) :]
        return start

    def read_at(self, start: int, size: int) -> bytes:
        """Reads `size` bytes from a byte on, fewer at the end."""
        with self._lock, _said():
            self._file.seek(start)
            content = b""
            while len(content) < size and (more := self._file.read(size - len(content))):
                content += more
        return content

    def close(self) -> None:
        """Removes the file."""
        self._file.close()


@contextmanager
def _said() -> Iterator[None]:
    """Says which folder the system refused to write to."""
    try:
        yield
    except OSError as error:
        reason = "is full" if is_disk_full(error) else f"cannot be used: {error.strerror or error}"
        try:
            folder = tempfile.gettempdir()
        except OSError:  # there is none
            folder = ""
        raise InputError(
            f"the folder of temporary files {folder} {reason}; free some space there, or set TMPDIR"
            " to another folder"
        ) from error
