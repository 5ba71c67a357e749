"""Silhouettes of a recording, kept on disk as compressed bits."""

import zlib
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager

import numpy as np

from calib.storage.temporary import ScratchFile


class MaskStore:
    """Silhouettes of all frames in a scratch file, as compressed bits.

    Memory holds only where each begins.

    Args:
        sizes: (width, height) of each camera's silhouettes.
        count: number of frames.
    """

    def __init__(self, sizes: list[tuple[int, int]], count: int):
        """Creates the scratch file; `close` or the end of the process removes it."""
        self._shapes = [(height, width) for width, height in sizes]
        self._file = ScratchFile()
        self._places = np.zeros((count, len(sizes), 2), np.int64)  # begin and bytes

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._places)

    def __getitem__(self, t: int) -> list[np.ndarray]:
        """Silhouettes (h, w) bool of one frame, one per camera; empty before they are stored."""
        if not 0 <= t < len(self):
            raise IndexError(f"there is no frame {t} of {len(self)}")
        pairs = zip(self._shapes, self._places[t].tolist(), strict=True)
        return [self._mask(shape, *place) for shape, place in pairs]

    def put(self, t: int, masks: list[np.ndarray]) -> None:
        """Stores one frame's silhouettes, (h, w) bool, one per camera."""
        for camera, mask in enumerate(masks):
            bits = zlib.compress(np.packbits(mask).tobytes(), 1)
            self._places[t, camera] = self._file.append(bits), len(bits)

    def advance(self, late: Sequence[int]) -> None:
        """Gives each frame the silhouettes that the cameras showed so many frames later, as far as
        there are any; earlier where negative.
        """
        for camera, frames in enumerate(late):
            later = np.clip(np.arange(len(self)) + frames, 0, len(self) - 1)
            self._places[:, camera] = self._places[later, camera]

    def pixels(self) -> np.ndarray:
        """(C,) int64, pixels in the foreground of all frames."""
        return sum(
            (np.array([mask.sum() for mask in masks]) for masks in self),
            start=np.zeros(len(self._shapes), np.int64),
        )

    def close(self) -> None:
        """Removes the scratch file."""
        self._file.close()

    def _mask(self, shape: tuple[int, int], start: int, size: int) -> np.ndarray:
        """A silhouette, by where its bits begin and how many bytes they have; 0: it is empty."""
        if not size:
            return np.zeros(shape, np.bool_)
        bits = np.frombuffer(zlib.decompress(self._file.read_at(start, size)), np.uint8)
        return np.unpackbits(bits, count=shape[0] * shape[1]).view(bool).reshape(shape)


@contextmanager
def mask_stores(number: int, sizes: list[tuple[int, int]], count: int) -> Iterator[list[MaskStore]]:
    """Several stores for a `with` block.

    Args:
        number: how many.
        sizes: (width, height) of each camera's silhouettes.
        count: number of frames.
    """
    with ExitStack() as stack:
        yield [stack.enter_context(closing(MaskStore(sizes, count))) for _ in range(number)]
