"""A range of frames fitted again: without a camera that misled the estimate there, or with joints
where somebody set them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import count
from typing import Any

import msgspec
import numpy as np

from calib.camera import Rig
from calib.errors import InputError
from calib.storage.atomic import replacing
from silhouette_core.estimator import ONE_CAMERA, Settings, load_estimator
from silhouette_core.motion.conditioning import Conditioning, as_estimated
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import write_motion
from silhouette_core.motion.pose import JointTarget
from silhouette_core.progress import Reporter
from silhouette_core.refinement.landmark_prior import target_gaps
from silhouette_core.setting_types import nearest
from voxelpose.corrections import Correction, FitAgain
from voxelpose.multiview.quality.quality import NEAR_MM
from voxelpose.results import Result
from voxelpose.view.viewer.result_scenes import open_fitted_recording

_TAKEN = "background", "network", "smooth", "backend"


def fit_without(
    result: Result,
    camera: str,
    frames: tuple[int, int],
    made: Sequence[Correction],
    reporter: Reporter,
) -> FitAgain:
    """Fits a range of frames, the first and one past the last, of one person again, by the result's
    other cameras; joints that were set stay so. Returns the correction, whose poses are written
    beside the estimate. InputError where that cannot be.
    """
    names = [name for name in result.rig.names if name != camera]
    if camera not in result.rig.names:
        raise InputError(f"there is no camera {camera!r}: {', '.join(names)} were used")
    if len(names) < 2:
        raise InputError(f"without {camera} {len(names)} camera is left: two are needed at least")
    targets = _targets(made)
    return _written(
        result, _fitted(result, camera, frames, targets, reporter), frames, camera, targets
    )


def fit_with_targets(
    result: Result, targets: Sequence[JointTarget], made: Sequence[Correction], reporter: Reporter
) -> FitAgain:
    """As `fit_without`, with joints where they are set. Up to a second before and after is fitted
    again, as far as where the new poses are nearest to those so far; not into a range that was
    fitted again otherwise. InputError, too, where the body does not reach there.
    """
    before = as_estimated(result.motion)
    if result.settings["estimator"] in ONE_CAMERA:
        raise InputError(
            "joints are set by hand where several cameras were used: one says too little"
        )
    _check_targets(before, targets)
    first, last = (end(one.frame for one in targets) for end in (min, max))
    camera, second = "", round(before.fps)
    start, stop = first - second, last + second + 1
    for one in made:
        if isinstance(one, FitAgain):
            if one.frames[1] <= first:
                start = max(start, one.frames[1])
            elif one.frames[0] > last:
                stop = min(stop, one.frames[0])
            else:
                camera = one.camera
    known = _targets(made, targets)
    motion = _fitted(result, camera, (start, stop), known, reporter)
    _check_targets(motion, targets, NEAR_MM / 1000)
    common, rows, rows_before = np.intersect1d(motion.frames, before.frames, return_indices=True)
    gaps_m = motion.landmarks()[rows] - before.landmarks()[rows_before]
    far_m = np.linalg.norm(gaps_m, axis=2).mean(axis=1)
    sides = (common >= start) & (common <= first), (common >= last) & (common < stop)
    start, last = (
        int(common[side & (far_m <= 2 * far_m[side].min())][end])
        for side, end in zip(sides, (-1, 0), strict=True)
    )
    return _written(result, motion, (start, last + 1), camera, known)


def targets_told(text: str, setting: str) -> list[JointTarget]:
    """Joints as a setting tells them; {} in it is its place in a message: name, frame, place in
    metres, with commas between joints. InputError where the text is none of these.
    """
    targets = []
    for words in text.split(","):
        joint, *numbers = words.split() or [""]
        content = {"joint": joint, "frame": "".join(numbers[:1]), "place_m": numbers[1:]}
        try:
            targets.append(msgspec.convert(content, JointTarget, strict=False))
        except msgspec.ValidationError:
            raise InputError(
                f"{setting.format(words.strip()[:60])} is not understood: give a joint, a frame and"
                " a place in metres, as in left_wrist 75 0.42 -0.18 1.31"
            ) from None
    return targets


def _check_targets(motion: Motion, targets: Sequence[JointTarget], most_m: float = np.inf) -> None:
    """Refuses joints that a body does not have or does not put there, and frames without a pose."""
    names = motion.model.tree.landmark_names
    for one in targets:
        if one.joint not in names:
            close = nearest(one.joint, names) or f": there are {', '.join(names)}"
            raise InputError(f"there is no joint {one.joint[:40]!r}{close}")
        rows = np.flatnonzero(motion.frames == one.frame)
        if not len(rows):
            raise InputError(f"frame {one.frame} has no pose: choose another")
        _, gaps_m = target_gaps(motion.model, motion.select(rows).landmarks(), [one])
        if (far_m := float(np.linalg.norm(gaps_m))) > most_m:
            raise InputError(
                f"{one.joint} stays {100 * far_m:.0f} cm from there in frame {one.frame}: choose a"
                " place that the body reaches"
            )


def _targets(
    made: Sequence[Correction], more: Sequence[JointTarget] = ()
) -> tuple[JointTarget, ...]:
    """Joints that were set, and more: each once in a frame."""
    past = [one for each in made if isinstance(each, FitAgain) for one in each.targets]
    return tuple({(one.frame, one.joint): one for one in (*past, *more)}.values())


def _written(
    result: Result,
    motion: Motion,
    frames: tuple[int, int],
    camera: str,
    targets: Sequence[JointTarget],
) -> FitAgain:
    """The correction by a motion in a range, which is written beside the estimate."""
    rows = np.flatnonzero((motion.frames >= frames[0]) & (motion.frames < frames[1]))
    if not len(rows):
        raise InputError("no pose is found in these frames then: choose others")
    names = (f"fitted_again_{number}.safetensors" for number in count(1))
    poses = next(name for name in names if not (result.folder / name).exists())
    with replacing(result.folder / poses) as partial:
        write_motion(motion.select(rows), partial)
    inside = tuple(one for one in targets if frames[0] <= one.frame < frames[1])
    return FitAgain(frames, poses, camera, inside)


def _fitted(
    result: Result,
    camera: str,
    frames: tuple[int, int],
    targets: Sequence[JointTarget],
    reporter: Reporter,
) -> Motion:
    """Poses as estimated of one person's body in a range of frames, the first and one past the
    last, and a second to either side, by the result's cameras but one as they were used, and by its
    settings.
    """
    settings: Any = result.settings
    names = [name for name in result.rig.names if name != camera]
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
    asked = Settings(
        **given,
        up=tuple(result.motion.up.tolist()),
        conditioning=Conditioning("none"),
        options=options,
        targets=tuple(targets),
    )
    estimator = load_estimator(settings["estimator"])
    return as_estimated(estimator.estimate(recording, asked, reporter).motion)
