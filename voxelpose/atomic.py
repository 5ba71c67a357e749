"""Files that are written whole or not at all: written beside their target, then renamed."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from calib.errors import InputError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yields a file beside `path` that takes its name when the block ends without an error.

    Args:
        path: the file; an earlier one of this name is replaced.

    Raises:
        InputError: the system refuses to write the file.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        yield partial
        partial.replace(path)
    except OSError as error:
        raise unwritable(path, error) from error
    finally:
        partial.unlink(missing_ok=True)


def is_disk_full(error: OSError) -> bool:
    """Whether an error means that the disk, or the user's quota, is full."""
    return error.errno in (errno.ENOSPC, errno.EDQUOT)


def unwritable(path: Path, error: OSError) -> InputError:
    """Returns the error that reports in one line why a file or folder was not written."""
    if is_disk_full(error):
        return InputError(
            f"the disk is full: {path} was not written; free some space or give --out another disk"
        )
    return InputError(f"{path} cannot be written: {error.strerror or error}")
