"""A recording's silhouettes over time, kept on disk as bits."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np


class MaskStore:
    """Silhouettes of all cameras and frames in one scratch file each, a bit per pixel, so that
    memory does not grow with time.

    Args:
        sizes: (width, height) of each camera's silhouettes.
        count: number of frames.
    """

    def __init__(self, sizes: list[tuple[int, int]], count: int):
        """Makes the scratch files; they vanish with `close`, or with the process."""
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
        """Returns the number of frames."""
        return len(self._bits[0])

    def __getitem__(self, t: int) -> list[np.ndarray]:
        """Returns the (h, w) bool silhouettes of one frame, a camera each."""
        return [
            np.unpackbits(bits[t], axis=1, count=width).view(bool)
            for bits, width in zip(self._bits, self._widths, strict=True)
        ]

    def put(self, t: int, masks: list[np.ndarray]) -> None:
        """Keeps one frame's silhouettes."""
        for bits, mask in zip(self._bits, masks, strict=True):
            bits[t] = np.packbits(mask, axis=1)

    def close(self) -> None:
        """Removes the scratch files."""
        self._bits.clear()
        self._folder.cleanup()
