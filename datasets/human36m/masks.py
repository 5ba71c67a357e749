"""Human3.6M's own silhouettes: MATLAB 7.3 files (HDF5) with one mask per frame."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from clip import FrameReader, InputError
from numpy.typing import NDArray


class MaskReader(FrameReader):
    """Masks of one camera of a clip, read like frames."""

    @classmethod
    def open(cls, path: Path) -> "MaskReader":
        """Opens a file.

        Raises:
            InputError: it is missing or cannot be read.
        """
        if not path.is_file():
            raise InputError(f"{path} is missing: download Segments mat, or leave out --masks")
        with _open_hdf5(path) as file:
            height, width = _mask(path, file, 0).shape
            return cls(path, (), (width, height), len(file["Masks"]), None)

    def frames(self, start: int, stop: int) -> Iterator[NDArray[np.uint8]]:
        """Yields the masks start, ..., stop - 1 as (H, W, 3) uint8, 255 where the person is.

        Raises:
            InputError: a mask cannot be read.
        """
        with _open_hdf5(self.path) as file:
            for number in range(start, stop):
                mask = np.where(_mask(self.path, file, number) > 0, 255, 0).astype(np.uint8)
                yield np.repeat(mask[:, :, None], 3, axis=2)


def _open_hdf5(path: Path):
    """Returns the open file."""
    try:
        import h5py
    except ImportError:
        raise InputError(f"{path} needs h5py: pip install h5py") from None
    try:
        file = h5py.File(path, "r")
        if "Masks" not in file:
            raise OSError("it has no Masks")
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error}): download it again") from None
    return file


def _mask(path: Path, file, number: int) -> NDArray:
    """Returns a mask, (H, W): HDF5 stores MATLAB's columns as rows."""
    try:
        return np.asarray(file[file["Masks"][number, 0]]).T
    except (OSError, KeyError, ValueError, IndexError) as error:
        raise InputError(
            f"{path}: mask {number} cannot be read ({error}): download it again"
        ) from None
