"""Silhouettes before and after completion: `python -m benchmarks.completed RECORDING ...`.

For recordings with true silhouettes (masks/masks.npz, as the shared rendered ones have them): a
line for each with the intersection over union with those, averaged over the cameras and frames, and
the smallest. The cameras are left as they stand.
"""

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.without_empty_view import overlap
from silhouette_core.estimator import Settings
from silhouette_core.image.silhouettes import Silhouettes, UndistortedView
from silhouette_core.progress import SilentReporter, StageClock
from voxelpose.multiview.silhouettes.prepared_silhouettes import (
    LONG_SIDE_PX,
    PreparationSettings,
    prepare_silhouettes,
)
from voxelpose.multiview.tuning import CARVING
from voxelpose.recording.folder import Recording


def main(folders: list[str]) -> None:
    """Compares the silhouettes of each recording."""
    for folder in folders:
        recording = Recording.open(folder)
        names = recording.rig.names
        lenses = [UndistortedView.from_camera(camera, LONG_SIDE_PX) for camera in recording.rig]
        with np.load(Path(folder) / "masks" / "masks.npz") as file:
            width, bits = int(file["width"]), [file[name] for name in names]
        silhouettes = Silhouettes(recording, "auto", LONG_SIDE_PX)
        settings = PreparationSettings(CARVING.voxel_m, 0, "off")
        work = recording, Settings(), settings, StageClock(), SilentReporter()
        before, after = [], []
        with prepare_silhouettes(*work) as prepared:
            for t, (_, _, frames) in enumerate(recording):
                found, completed = silhouettes.of(frames), prepared.store[t]
                for c, (name, lens) in enumerate(zip(names, lenses, strict=True)):
                    packed: NDArray[np.uint8] = bits[c][t]
                    true = lens.undistort(np.unpackbits(packed, axis=1, count=width).view(np.bool_))
                    before.append(overlap(lens.undistort(found[name]), true))
                    after.append(overlap(completed[c], true))
        words = [f"{np.mean(values):.3f} (least {min(values):.2f})" for values in (before, after)]
        print(f"{recording.folder.name}: before {words[0]}, after {words[1]}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
