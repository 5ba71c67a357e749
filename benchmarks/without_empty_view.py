"""Silhouettes without an empty view: `python -m benchmarks.without_empty_view RECORDING ...`.

For recordings that have one, silhouettes are found with it, with the median over time of the
recording's own frames, and with the empty scene estimated from these (`EmptyScene`). A line for
each camera: intersection over union with the first, of both others, averaged over eight frames.
"""

import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from silhouette_core.image.background import BackgroundModel
from silhouette_core.image.silhouettes import scaled_size
from voxelpose.multiview.silhouettes.prepared_silhouettes import LONG_SIDE_PX
from voxelpose.recording.folder import Recording

_SAMPLES, _COMPARED = 40, 8


def overlap(first: NDArray[np.bool_], second: NDArray[np.bool_]) -> float:
    """Intersection over union."""
    return float((first & second).sum() / max((first | second).sum(), 1))


def main(folders: list[str]) -> None:
    """Compares the backgrounds of each recording."""
    for folder in folders:
        recording = Recording.open(folder)
        at = np.unique(np.linspace(0, recording.frame_count - 1, _SAMPLES).astype(int)).tolist()
        backgrounds = recording.backgrounds()
        frames = list(recording.at(at))
        for camera in recording.rig:
            if camera.name not in backgrounds:
                continue
            size = scaled_size(camera, LONG_SIDE_PX)

            def scaled(image: NDArray, size: tuple[int, int] = size) -> NDArray[np.uint8]:
                return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)

            empty = BackgroundModel.from_frames(map(scaled, backgrounds[camera.name]))
            stack = np.stack([scaled(seen[camera.name]) for seen in frames])
            median = BackgroundModel.from_frames([np.median(stack, axis=0).astype(np.uint8)])
            estimated = BackgroundModel.from_occupied(stack)
            scores = np.array(
                [
                    [
                        overlap(model.silhouette(frame), empty.silhouette(frame))
                        for model in (median, estimated)
                    ]
                    for frame in stack[:: len(stack) // _COMPARED]
                ]
            ).mean(axis=0)
            print(
                f"{recording.folder.name} {camera.name}: median {scores[0]:.3f}, estimated"
                f" {scores[1]:.3f}",
                flush=True,
            )


if __name__ == "__main__":
    main([str(Path(folder)) for folder in sys.argv[1:]])
