"""A range of frames fitted again without a camera that misled the estimate there."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from calib.camera import Rig
from calib.errors import InputError
from silhouette_core.estimator import Settings, load_estimator
from silhouette_core.motion.conditioning import Conditioning, as_estimated
from silhouette_core.motion.motion import Motion
from silhouette_core.progress import Reporter
from voxelpose.results import Result
from voxelpose.view.viewer.result_scenes import open_fitted_recording

_TAKEN = "background", "network", "smooth", "backend"


def fit_range_again(
    result: Result, camera: str, frames: tuple[int, int], reporter: Reporter
) -> Motion:
    """Poses as estimated of one person's body in a range of frames, the first and one past the
    last, by the result's other cameras as they were used, and by its settings. A second to either
    side is fitted with them and left out. InputError where that cannot be.
    """
    settings: Any = result.settings
    names = [name for name in result.rig.names if name != camera]
    if camera not in result.rig.names:
        raise InputError(f"there is no camera {camera!r}: {', '.join(names)} were used")
    if len(names) < 2:
        raise InputError(f"without {camera} {len(names)} camera is left: two are needed at least")
    fps, limits = result.motion.fps, settings.get("frames")
    first, stop = frames[0] - round(fps), frames[1] + round(fps)
    limits = (max(first, limits[0]), min(stop, limits[1])) if limits else (max(first, 0), stop)
    folder, label = (result.folder / str(settings["recording"])).resolve(), settings.get("label")
    recording = open_fitted_recording(folder, limits, names, None, fps, label)
    recording = replace(recording, rig=Rig(tuple(result.rig[name] for name in names)))
    given = {name: settings[name] for name in _TAKEN if name in settings}
    options = {**settings.get("options", {}), "body": str(result.folder)}
    if settings["estimator"] == "multiview":
        options["repair"] = "off"  # the cameras are as the first fit put them right
    up = tuple(result.motion.up.tolist())
    asked = Settings(**given, up=up, conditioning=Conditioning("none"), options=options)
    motion = load_estimator(settings["estimator"]).estimate(recording, asked, reporter).motion
    motion = as_estimated(motion)
    rows = np.flatnonzero((motion.frames >= frames[0]) & (motion.frames < frames[1]))
    if not len(rows):
        raise InputError(f"without {camera} no pose is found in these frames: choose others")
    return motion.select(rows)
