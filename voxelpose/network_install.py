"""Installation of the pose network: a wheel is fetched by pip, and the network taken out of it."""

import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from calib.errors import InputError
from calib.storage.atomic import FolderWriter
from silhouette_core.network_files import POSE_NETWORK, NetworkFile, network_folder

WHEEL, VERSION = "mediapipe", "0.10.21"
LICENCE = NetworkFile(
    "LICENSE",
    f"{WHEEL}-{VERSION}.dist-info/LICENSE",
    12_331,
    "8707eef0533987efc5b155d64761eeb6e20793f50b9bd1a68dad1cf4719d0ed8",
)
FILES = POSE_NETWORK, LICENCE
ORIGIN = "ORIGIN.txt"
_FROM_PIP = "without pip, fetch the wheel elsewhere and give it with --from FILE.whl"
# Any platform's wheel has the same network; this one also exists where no wheel fits the machine.
_PLATFORM = "--platform", "manylinux_2_28_x86_64", "--python-version", "3.12"
_LARGEST_BYTES = 50_000_000


def install_network(wheel: Path | None = None) -> Path:
    """Installs the network for this user, in place of an earlier one.

    Args:
        wheel: the wheel's file; None: pip gets it, by the user's own settings.

    Returns:
        The folder: the network, its licence and a note of their origin.

    Raises:
        InputError: there is no pip, it gets no wheel, the wheel holds something else, the folder
            cannot be written, or another process is writing it.
    """
    folder = network_folder()
    with tempfile.TemporaryDirectory() as scratch:
        contents = _contents(_downloaded(Path(scratch)) if wheel is None else wheel)
    with FolderWriter(folder, overwrite=True, replaceable=_is_ours) as partial:
        for file, content in contents.items():
            (partial / file.name).write_bytes(content)
        (partial / ORIGIN).write_text(origin(), encoding="utf-8")
    return folder


def remove_network() -> Path | None:
    """Removes the installed network; its folder, or None where there was none.

    Raises:
        InputError: the folder is not of this program's making, or cannot be removed.
    """
    folder = network_folder()
    if not folder.exists():
        return None
    if not _is_ours(folder):
        raise InputError(
            f"{folder} was not made by `voxelpose network install`: remove it yourself"
        )
    try:
        shutil.rmtree(folder)
    except OSError as error:
        raise InputError(f"{folder} cannot be removed: {error.strerror or error}") from None
    return folder


def origin() -> str:
    """Where the files come from, and what they are."""
    lines = [
        f"From the wheel {WHEEL} {VERSION} of the Python Package Index, taken out unchanged.",
        "Copyright The MediaPipe Authors, Apache License 2.0: see LICENSE.",
        *(f"{file.name}: {file.member}, SHA-256 {file.sha256}" for file in FILES),
    ]
    return "\n".join(lines) + "\n"


def _is_ours(folder: Path) -> bool:
    return (folder / ORIGIN).is_file()


def _downloaded(folder: Path) -> Path:
    """The wheel, which pip puts into a folder."""
    options = "--no-deps", "--only-binary", ":all:", *_PLATFORM, "--dest", str(folder)
    command = [sys.executable, "-m", "pip", "download", f"{WHEEL}=={VERSION}", *options]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        raise InputError(f"pip cannot be started ({error.strerror}): {_FROM_PIP}") from None
    if done.returncode:
        if "No module named pip" in done.stderr:
            raise InputError(f"this environment has no pip: install it, or {_FROM_PIP}")
        reasons = [line for line in done.stderr.splitlines() if line.startswith("ERROR")]
        reason = (reasons or done.stderr.splitlines() or ["no reason given"])[-1]
        raise InputError(
            f"pip did not get {WHEEL} {VERSION} ({reason.removeprefix('ERROR: ')}): check the"
            f" network and pip's settings, or {_FROM_PIP}"
        )
    return next(folder.glob("*.whl"))


def _contents(wheel: Path) -> dict[NetworkFile, bytes]:
    """The files in a wheel, checked."""
    try:
        if wheel.stat().st_size > _LARGEST_BYTES:
            raise InputError(f"{wheel} is too large for {WHEEL} {VERSION}: give that wheel")
        with zipfile.ZipFile(wheel) as archive:
            sizes = {file.member: archive.getinfo(file.member).file_size for file in FILES}
            if any(sizes[file.member] != file.size for file in FILES):
                raise KeyError
            contents = {file: archive.read(file.member) for file in FILES}
    except OSError as error:
        raise InputError(f"{wheel} cannot be read: {error.strerror or error}") from None
    except (zipfile.BadZipFile, KeyError, NotImplementedError, EOFError, RuntimeError):
        raise InputError(
            f"{wheel} does not hold the network of {WHEEL} {VERSION}: give that version's wheel,"
            " whole"
        ) from None
    for file, content in contents.items():
        if not file.matches(content):
            raise InputError(
                f"{file.member} in {wheel} is not the one that is known (SHA-256): nothing was"
                " installed"
            )
    return contents
