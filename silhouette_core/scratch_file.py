"""Scratch files: without a name, so that they end with the process however that ends."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

from calib.atomic import is_disk_full
from calib.errors import InputError


class ScratchFile:
    """Bytes outside memory, in the folder of temporary files; any thread may use it.

    Read and written, not mapped, since a full disk would end the process then.
    """

    def __init__(self) -> None:
        """Creates the file.

        Raises:
            InputError: the folder of temporary files cannot be written to.
        """
        with _said():
            self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115
        self._lock, self._end = Lock(), 0

    def append(self, content: bytes) -> int:
        """Writes at the end; returns where it begins.

        Raises:
            InputError: the disk is full.
        """
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
