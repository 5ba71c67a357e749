"""Files and folders that are written whole or not at all: written beside their target, then
renamed; a folder by one process at a time.
"""

import ctypes
import errno
import os
import re
import shutil
import sys
import uuid
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from types import TracebackType

from filelock import FileLock, SoftFileLock, Timeout

from calib.errors import InputError

_PARTIAL = r"\.{stem}\.partial-(\d+)-[0-9a-f]{{8}}{suffix}"
_LEFTOVER = r"{name}\.(?P<kind>partial|old)-\d+-[0-9a-f]{{8}}"
_UNFINISHED = re.compile(_LEFTOVER.format(name="(?P<name>.+)"))
_LOCK, _SOFT_LOCK = ".{name}.lock", ".{name}.softlock"
# Network file systems without a lock service; None is of filelock's own refusal.
_WITHOUT_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, None)
_HERE = -100  # AT_FDCWD: paths from the working folder
_EXCHANGE = 2  # RENAME_EXCHANGE of Linux, RENAME_SWAP of macOS

# What this process was about to rename: inode of the new file or folder, and its name.
_renames: dict[int, Path] = {}


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yields a file beside `path` that takes its name, in place of an earlier file, when the block
    ends without an error. InputError where the system refuses to write the file.

    The file is on the disk before it takes the name, so that a full disk or a power cut leaves the
    earlier file. What killed processes left of the same file is removed.
    """
    pattern = _PARTIAL.format(stem=re.escape(path.stem), suffix=re.escape(path.suffix))
    _removed(path.parent, pattern)
    partial = path.with_name(f".{path.stem}.{partial_mark()}{path.suffix}")
    try:
        with writing(path):
            yield partial
            flush(partial)
            if not partial.stat().st_size:
                raise OSError(errno.EIO, "nothing was written")
            rename(partial, path)
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """For a `with` block that writes a file or folder: InputError where the system refuses."""
    try:
        yield
    except OSError as error:
        raise unwritable(path, error) from error


def write_whole(path: Path, content: str | bytes) -> None:
    """Writes a file whole or not at all; text as UTF-8. InputError where the system refuses to
    write the file.
    """
    with replacing(path) as partial:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)


def rename(partial: Path, path: Path) -> None:
    """Renames what is complete, and remembers it for `written_paths`. OSError where the system
    refuses; a folder of this name that is not empty is one reason.
    """
    announce(partial, path)
    partial.replace(path)


def announce(partial: Path, path: Path) -> None:
    """Remembers that what is now `partial` is about to be renamed to `path`."""
    _renames[partial.stat().st_ino] = path


def written_paths() -> list[Path]:
    """The files and folders that this process has completed, as far as they are still there."""
    written = []
    for inode, path in _renames.items():
        with suppress(OSError):
            if path.stat().st_ino == inode:
                written.append(path)
    return written


def partial_mark() -> str:
    """Part of a name that tells which process is still writing."""
    return f"partial-{os.getpid()}-{uuid.uuid4().hex[:8]}"


def is_unfinished(name: str) -> bool:
    """Whether a folder of this name is still being written, or left of that by a killed process."""
    return _UNFINISHED.fullmatch(name) is not None


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
    """Removes what processes that are gone have left of files in a folder; returns it."""
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
    OSError where it is full.
    """
    # Reading is enough where files are not locked; a linked file may be another's.
    with path.open("rb+" if os.name == "nt" else "rb") as file:
        os.fsync(file.fileno())


@contextmanager
def claimed(path: Path) -> Iterator[None]:
    """Holds the right to write a file or folder, which one process at a time has. InputError where
    another process is writing it, or the lock cannot be made.

    A lock beside it, `.NAME.lock`, which ends with the process however that ends; where the file
    system has no locks, a file `.NAME.softlock`, which a killed process may leave.
    """
    lock = FileLock(path.with_name(_LOCK.format(name=path.name)), timeout=0)
    soft = SoftFileLock(path.with_name(_SOFT_LOCK.format(name=path.name)), timeout=0)
    remedy = "wait for its end, or choose another name"
    try:
        try:
            with warnings.catch_warnings(action="ignore"):  # filelock's own soft lock
                lock.acquire()
        except (OSError, NotImplementedError) as error:
            if isinstance(error, Timeout) or getattr(error, "errno", None) not in _WITHOUT_LOCKS:
                raise
            remedy += f"; if it was killed, remove {soft.lock_file}"
            soft.acquire()
    except Timeout:
        raise InputError(f"another process is writing {path}: {remedy}") from None
    except OSError as error:
        raise unwritable(path, error) from error
    try:
        yield
    finally:
        with suppress(OSError):  # before it is released: a lock without a name counts for nobody
            Path(lock.lock_file).unlink()
        lock.release()
        soft.release()
        with suppress(OSError):  # where a file in use cannot be removed
            if os.name == "nt":
                Path(lock.lock_file).unlink()


class FolderWriter:
    """Context manager of a folder that is written whole or not at all.

    with FolderWriter(out) as folder:
        (folder / "joints.csv").write_text(...)

    Inside the block, `folder` is a new folder beside `out`. It is renamed to `out` when the block
    ends, and removed when the block raises, KeyboardInterrupt included. From the start to the end
    `out` belongs to this process; if something else has appeared under that name by the end, it
    stays and the new folder takes the first free name, `out-2` and so on. An earlier folder that is
    replaced is there until the new one is, and what killed processes left of `out` is removed.
    """

    def __init__(
        self,
        out: Path | str,
        overwrite: bool = False,
        replaceable: Callable[[Path], bool] = lambda folder: True,
    ) -> None:
        """Checks where the folder is to be written, before any work is done. InputError where `out`
        exists and must not be replaced.

        Args:
            overwrite: whether an earlier folder is replaced, once the new one is complete.
            replaceable: whether a folder is of the kind that may be replaced.
        """
        self.out, self._overwrite, self._replaceable = Path(out), overwrite, replaceable
        self._check(self.out)

    def _check(self, out: Path) -> None:
        """Raises InputError if something stands in the way."""
        with writing(out):
            if out.is_symlink() or (out.exists() and not out.is_dir()):
                raise InputError(f"{out} exists and is not a folder: choose another name")
            if not out.exists() or not any(out.iterdir()):
                return
        if not self._overwrite:
            raise InputError(f"{out} exists: choose another name, or add --overwrite to replace it")
        if not self._replaceable(out):
            raise InputError(
                f"{out} exists and was not made by this command, so it is not overwritten:"
                " choose another name"
            )

    def __enter__(self) -> Path:
        target = self.out.resolve()
        self._made = [parent for parent in target.parents if not parent.exists()]
        self._claim = ExitStack()
        try:
            with writing(self.out):
                target.parent.mkdir(parents=True, exist_ok=True)
                self._claim.enter_context(claimed(target))
                recover(target)
                self._check(self.out)
                self._partial = target.with_name(f"{target.name}.{partial_mark()}")
                self._partial.mkdir()
        except BaseException:
            self._give_up()
            raise
        return self._partial

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if error is None:
                self._put_in_place()
                self._made = []
        except OSError as failed:
            error = failed
        finally:
            try:  # after an exchange this is the earlier folder
                shutil.rmtree(self._partial, ignore_errors=True)
            finally:
                self._give_up()
        if isinstance(error, OSError) and is_disk_full(error):
            raise unwritable(self.out, error) from error
        if kind is None and error is not None:
            raise error

    def _give_up(self) -> None:
        """Ends the claim, and removes the parents that were made for nothing."""
        self._claim.close()
        for parent in self._made:
            try:
                parent.rmdir()
            except OSError:
                break

    def _put_in_place(self) -> None:
        target = self.out.resolve()
        for path in self._partial.rglob("*"):
            if path.is_file() and not path.is_symlink():
                flush(path)
        try:
            self._check(self.out)
            with suppress(OSError):
                target.rmdir()  # an empty one
            if not target.exists():
                rename(self._partial, target)
                return
            announce(self._partial, target)
            replace_folder(self._partial, target)
        except (InputError, OSError) as error:
            if isinstance(error, OSError) and error.errno not in (
                errno.ENOTEMPTY,
                errno.EEXIST,
                errno.ENOTDIR,
            ):
                raise
            beside = self._put_beside(target)
            raise InputError(
                f"something else was written to {self.out} meanwhile and stays there: this result"
                f" is in {beside}"
            ) from error

    def _put_beside(self, target: Path) -> Path:
        for number in range(2, 1000):
            beside = target.with_name(f"{target.name}-{number}")
            if not beside.exists():
                with suppress(OSError):
                    rename(self._partial, beside)
                    return self.out.with_name(beside.name)
        raise OSError(errno.EEXIST, "every name is taken", str(target))


def replace_folder(new: Path, target: Path) -> None:
    """Puts a folder in another's place; there is no moment without one of them, where the system
    allows it. The earlier one then lies at `new`, or is removed. OSError where the system refuses.
    """
    if _exchanged(new, target):
        return
    old = Path(str(new).replace(".partial-", ".old-"))
    target.rename(old)
    try:
        new.rename(target)
    except BaseException:
        if not target.exists():
            old.rename(target)
        raise
    shutil.rmtree(old, ignore_errors=True)


def recover(target: Path) -> list[Path]:
    """Removes what killed processes left of a folder beside it, and puts the earlier folder back
    where one was killed between the two renames of `replace_folder`. The caller has claimed the
    folder.
    """
    removed = []
    pattern = _LEFTOVER.format(name=re.escape(target.name))
    for entry in sorted(target.parent.iterdir()):
        match = re.fullmatch(pattern, entry.name)
        if match is not None and match["kind"] == "old" and not target.exists():
            entry.rename(target)
        elif match is not None:
            shutil.rmtree(entry, ignore_errors=True)
            removed.append(entry)
    return removed


def remove_leftovers(folder: Path) -> list[Path]:
    """Removes what killed processes left of any file or folder in a folder, and returns it.
    InputError where the folder cannot be read.

    Folders that are being written, and those below, are left alone.
    """
    removed = _removed(folder, _PARTIAL.format(stem=".+", suffix=r"(\..+)?"))
    try:
        entries = sorted(folder.iterdir())
    except OSError as error:
        raise InputError(f"{folder} cannot be read: {error.strerror or error}") from error
    matches = [_UNFINISHED.fullmatch(entry.name) for entry in entries]
    for name in sorted({match["name"] for match in matches if match}):
        with suppress(InputError), claimed(folder / name):  # else somebody is writing it
            removed += recover(folder / name)
    return removed


def _exchanged(first: Path, second: Path) -> bool:
    """Exchanges two names in one step; False where the system cannot."""
    old, new = os.fsencode(first), os.fsencode(second)
    try:
        library = ctypes.CDLL(None)
        if sys.platform == "linux":
            return library.renameat2(_HERE, old, _HERE, new, _EXCHANGE) == 0
        if sys.platform == "darwin":
            return library.renamex_np(old, new, _EXCHANGE) == 0
    except (OSError, AttributeError, TypeError):
        pass
    return False
