"""Import of open3d on machines without its system libraries."""

import ctypes
import os
import sys
from types import ModuleType

from calib.errors import InputError

_LINUX = sys.platform.startswith("linux")


def has_screen() -> bool:
    """Whether windows can be opened, as far as the environment tells."""
    displays = os.environ.get("DISPLAY"), os.environ.get("WAYLAND_DISPLAY")
    return not _LINUX or any(displays)


def import_open3d(screen: bool = False) -> ModuleType:
    """Imports open3d, which takes a second or two, only where it is used, perhaps for a window on a
    screen; InputError, which names the remedy, where it is missing or broken, or there is no
    screen.

    On Linux its library needs libusb, which minimal machines lack; the libusb-package wheel has it.
    """
    if screen and not has_screen():
        raise InputError(
            "there is no screen to open a window on: say --png FILE for a picture instead"
        )
    try:
        if _LINUX:
            _load_libusb()
        import open3d
    except ImportError as error:
        raise InputError(
            f"open3d is not installed ({error}): pip install 'voxelpose[open3d]', which Python 3.13"
            " and newer on Linux have with glibc 2.35; only `view --open3d` and `evaluate --scan`"
            " need it"
        ) from None
    except OSError as error:
        raise InputError(
            f"open3d cannot be loaded ({error}): install the library it names, or do without"
            " `view --open3d` and `evaluate --scan`"
        ) from None
    return open3d


def _load_libusb() -> None:
    """Makes libusb's symbols visible to libraries loaded later.

    Where the wheel is missing, the system's own library may be sufficient.
    """
    try:
        import libusb_package
    except ImportError:
        return
    path = libusb_package.get_library_path()
    if path:
        ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
