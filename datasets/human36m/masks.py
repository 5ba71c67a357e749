"""Human3.6M's own silhouettes: MATLAB 7.3 files, that is HDF5, of one mask per frame."""

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from take import InputError, Pictures


class Masks(Pictures):
    """The masks of one camera and take; they are used like the images of a folder."""

    is_video = False
    fps = None

    @classmethod
    def open(cls, path: Path) -> "Masks":
        """Looks at a file.

        Raises:
            InputError: it is missing.
        """
        if not path.is_file():
            raise InputError(f"{path} is missing: download Segments mat, or leave out --masks")
        return cls(path)

    @cached_property
    def _probed(self) -> tuple[tuple[int, int], int, None]:
        with self._file() as file:
            first = self._mask(file, 0)
            return (first.shape[1], first.shape[0]), len(file["Masks"]), None

    def frames(self, begin: int, count: int) -> Iterator[NDArray[np.uint8]]:
        """Yields frames from `begin` on, (H, W, 3) uint8, 255 where the person is.

        Raises:
            InputError: one cannot be read.
        """
        with self._file() as file:
            for number in range(begin, min(begin + count, len(file["Masks"]))):
                mask = np.where(self._mask(file, number) > 0, 255, 0).astype(np.uint8)
                yield np.repeat(mask[:, :, None], 3, axis=2)

    def _file(self):
        try:
            import h5py
        except ImportError:
            raise InputError(f"{self.path} needs h5py: pip install h5py") from None
        try:
            file = h5py.File(self.path, "r")
            if "Masks" not in file:
                raise OSError("it has no Masks")
        except OSError as error:
            raise InputError(f"{self.path} cannot be read ({error}): download it again") from None
        return file

    def _mask(self, file, number: int) -> NDArray:
        """Returns a mask, (H, W): MATLAB's columns are HDF5's rows."""
        try:
            return np.asarray(file[file["Masks"][number, 0]]).T
        except (OSError, KeyError, ValueError, IndexError) as error:
            raise InputError(
                f"{self.path}: mask {number} cannot be read ({error}): download it again"
            ) from None
