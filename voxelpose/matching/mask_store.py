"""Silhouettes of a recording, kept on disk as bits."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np


class MaskStore:
    """Silhouettes of all frames, one scratch file per camera, one bit per pixel.

    Memory does not grow with the number of frames.

    Args:
        sizes: (width, height) of each camera's silhouettes.
        count: number of frames.
    """

    def __init__(self, sizes: list[tuple[int, int]], count: int):
        """Creates the scratch files; `close` or the end of the process removes them."""
        self._folder = tempfile.TemporaryDirectory(prefix="voxelpose-")
        self._widths = [width for width, _ in sizes]
        self._bits = [
            np.memmap(
                Path(self._folder.name) / f"{c}.bits",
                np.uint8,
                "w+",
                shape=(count, height, (width + 7) // 8),
            )
            for c, (width, height) in enumerate(sizes)
        ]

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._bits[0])

    def __getitem__(self, t: int) -> list[np.ndarray]:
        """Silhouettes (h, w) bool of one frame, one per camera."""
        return [
            np.unpackbits(bits[t], axis=1, count=width).view(bool)
            for bits, width in zip(self._bits, self._widths, strict=True)
        ]

    def put(self, t: int, masks: list[np.ndarray]) -> None:
        """Stores one frame's silhouettes, (h, w) bool, one per camera."""
        for bits, mask in zip(self._bits, masks, strict=True):
            bits[t] = np.packbits(mask, axis=1)

    def advance(self, camera: int, frames: int) -> None:
        """Gives each frame the silhouette that a camera showed so many frames later, as far as
        there are any; earlier where negative.
        """
        bits = self._bits[camera]
        last = len(bits) - 1
        order = range(last + 1) if frames > 0 else range(last, -1, -1)
        for t in order:
            bits[t] = bits[min(max(t + frames, 0), last)]

    def close(self) -> None:
        """Removes the scratch files."""
        self._bits.clear()
        self._folder.cleanup()
