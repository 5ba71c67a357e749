"""Files that are written whole or not at all: written beside their target, then renamed."""

import errno
import os
import re
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from calib.errors import InputError

_PARTIAL = r"\.{stem}\.partial-(\d+)-[0-9a-f]{{8}}{suffix}"

# What this process was about to rename: inode of the new file or folder, and its name.
_renames: dict[int, Path] = {}


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yields a file beside `path` that takes its name, in place of an earlier file, when the
    block ends without an error.

    The file is on the disk before it takes the name, so that a full disk or a power cut leaves the
    earlier file. What killed processes left of the same file is removed.

    Raises:
        InputError: the system refuses to write the file.
    """
    pattern = _PARTIAL.format(stem=re.escape(path.stem), suffix=re.escape(path.suffix))
    _removed(path.parent, pattern)
    partial = path.with_name(f".{path.stem}.{partial_mark()}{path.suffix}")
    try:
        yield partial
        flush(partial)
        if not partial.stat().st_size:
            raise OSError(errno.EIO, "nothing was written")
        rename(partial, path)
    except OSError as error:
        raise unwritable(path, error) from error
    finally:
        partial.unlink(missing_ok=True)


def write_whole(path: Path, content: str | bytes) -> None:
    """Writes a file whole or not at all; text as UTF-8.

    Raises:
        InputError: the system refuses to write the file.
    """
    with replacing(path) as partial:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)


def rename(partial: Path, path: Path) -> None:
    """Renames what is complete, and remembers it for `written_paths`.

    Raises:
        OSError: the system refuses; a folder of this name that is not empty is one reason.
    """
    announce(partial, path)
    partial.replace(path)


def announce(partial: Path, path: Path) -> None:
    """Remembers that what is now `partial` is about to be renamed to `path`."""
    _renames[partial.stat().st_ino] = path


def written_paths() -> list[Path]:
    """The files and folders that this process has completed, as far as they are still there."""
    there = []
    for inode, path in _renames.items():
        with suppress(OSError):
            if path.stat().st_ino == inode:
                there.append(path)
    return there


def partial_mark() -> str:
    """Part of a name that tells which process is still writing."""
    return f"partial-{os.getpid()}-{uuid.uuid4().hex[:8]}"


def remove_all_partials(folder: Path) -> list[Path]:
    """Removes what processes that are gone have left of any file in a folder, not in folders of it;
    returns what was removed.
    """
    return _removed(folder, _PARTIAL.format(stem=".+", suffix=r"(\..+)?"))


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


def _removed(folder: Path, pattern: str) -> list[Path]:
    import psutil

    removed = []
    with suppress(OSError):
        for entry in os.scandir(folder):
            match = re.fullmatch(pattern, entry.name)
            if match is not None and not psutil.pid_exists(int(match[1])):
                with suppress(OSError):
                    Path(entry.path).unlink()
                    removed.append(Path(entry.path))
    return removed


def flush(path: Path) -> None:
    """Waits until a file is on its disk, which is when some file systems notice that it is full.

    Raises:
        OSError: it is.
    """
    # Reading is enough where files are not locked; a linked file may be another's.
    with path.open("rb+" if os.name == "nt" else "rb") as file:
        os.fsync(file.fileno())
