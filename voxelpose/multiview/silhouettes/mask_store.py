"""Silhouettes of a recording, kept on disk as bits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager

import numpy as np

from silhouette_core.scratch_file import ScratchFile


class MaskStore:
    """Silhouettes of all frames, one scratch file per camera, one bit per pixel.

    Memory does not grow with the number of frames.

    Args:
        sizes: (width, height) of each camera's silhouettes.
        count: number of frames.
    """

    def __init__(self, sizes: list[tuple[int, int]], count: int):
        """Creates the scratch files; `close` or the end of the process removes them."""
        self._widths = [width for width, _ in sizes]
        self._shapes = [(height, (width + 7) // 8) for width, height in sizes]
        self._files = [ScratchFile() for _ in sizes]
        self._count = count

    def __len__(self) -> int:
        """Number of frames."""
        return self._count

    def __getitem__(self, t: int) -> list[np.ndarray]:
        """Silhouettes (h, w) bool of one frame, one per camera; empty before they are stored."""
        return [
            np.unpackbits(
                np.frombuffer(self._bits(camera, t), np.uint8).reshape(shape), axis=1, count=width
            ).view(bool)
            for camera, (shape, width) in enumerate(zip(self._shapes, self._widths, strict=True))
        ]

    def put(self, t: int, masks: list[np.ndarray]) -> None:
        """Stores one frame's silhouettes, (h, w) bool, one per camera."""
        for camera, mask in enumerate(masks):
            self._put(camera, t, np.packbits(mask, axis=1).tobytes())

    def advance(self, late: Sequence[int]) -> None:
        """Gives each frame the silhouettes that the cameras showed so many frames later, as far as
        there are any; earlier where negative.
        """
        last = self._count - 1
        for camera, frames in enumerate(late):
            order = range(last + 1) if frames > 0 else range(last, -1, -1)
            for t in order if frames else ():
                self._put(camera, t, self._bits(camera, min(max(t + frames, 0), last)))

    def pixels(self) -> np.ndarray:
        """(C,) int64, pixels in the foreground of all frames."""
        cameras, frames = range(len(self._files)), range(self._count)
        return np.array(
            [sum(int.from_bytes(self._bits(c, t)).bit_count() for t in frames) for c in cameras]
        )

    def close(self) -> None:
        """Removes the scratch files."""
        for file in self._files:
            file.close()

    def _bits(self, camera: int, t: int) -> bytes:
        height, row = self._shapes[camera]
        if not 0 <= t < self._count:
            raise IndexError(f"there is no frame {t} of {self._count}")
        return self._files[camera].read_at(t * height * row, height * row)

    def _put(self, camera: int, t: int, bits: bytes) -> None:
        height, row = self._shapes[camera]
        self._files[camera].write_at(t * height * row, bits)


@contextmanager
def mask_stores(number: int, sizes: list[tuple[int, int]], count: int) -> Iterator[list[MaskStore]]:
    """Several stores for a `with` block.

    Args:
        number: how many.
        sizes: (width, height) of each camera's silhouettes.
        count: number of frames.
    """
    with ExitStack() as kept:
        yield [kept.enter_context(closing(MaskStore(sizes, count))) for _ in range(number)]
