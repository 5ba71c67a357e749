"""From a recording to a result folder: what `voxelpose fit` does, callable from Python."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import tomlkit
from numpy.typing import NDArray

from calib.errors import InputError
from calib.files import write_rig
from silhouette_core.estimator import Estimate, Settings, load_estimator
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import write_motion
from silhouette_core.progress import Reporter, SilentReporter
from voxelpose import __version__
from voxelpose.export.bvh import write_bvh
from voxelpose.export.hypotheses import HYPOTHESES, write_hypotheses
from voxelpose.export.joints import write_joints
from voxelpose.recording.folder import Recording
from voxelpose.results import CALIBRATION, MOTION, SETTINGS, SUMMARY, Result, ResultWriter, as_json
from voxelpose.view.images.overlay import draw_pictures


@dataclass(frozen=True)
class Output:
    """Where results go.

    Attributes:
        folder: the folder to be made.
        overwrite: whether an earlier result there is replaced.
        pictures: whether overlay videos and the contact sheet are drawn.
    """

    folder: Path | str
    overwrite: bool = False
    pictures: bool = True


def fit(
    recording: Recording,
    output: Output,
    settings: Settings | None = None,
    estimator: str = "multiview",
    reporter: Reporter | None = None,
) -> Result:
    """Estimates the motion of a recording and writes a result folder.

    Args: recording: the frames. output: where the results go. settings: what the estimator is told;
        stature, chest girth and sex that are not set are taken from the recording's subject.toml.
        estimator: name under which the estimator is registered. reporter: told of every stage;
        None: nobody is.

    Returns:
        The result, as read back from the folder.

    Raises:
        InputError: the recording, the settings or the output cannot be used.
    """
    reporter = reporter or SilentReporter()
    started = time.perf_counter()
    settings = _with_subject(settings or Settings(), recording)
    if settings.threads is not None and settings.threads < 1:
        raise InputError(
            f"{settings.threads} threads cannot work: give --threads 1 or more, or leave it out"
        )
    writer = ResultWriter(output.folder, output.overwrite, keep_out_of=recording.folder)
    chosen = load_estimator(estimator)
    with writer as folder:
        estimate = chosen.estimate(recording, settings, reporter)
        motion = estimate.motion
        if not len(motion):
            raise InputError(
                "no pose was found in any frame: look at the silhouettes with `voxelpose carve`,"
                " and check the background"
            )
        reporter.stage("files")
        write_joints(motion, folder / "joints.csv")
        write_bvh(motion, folder / "motion.bvh")
        write_motion(motion, folder / MOTION)
        if estimate.hypotheses is not None:
            write_hypotheses(estimate.hypotheses, folder / HYPOTHESES)
        write_rig(recording.rig, folder / CALIBRATION)
        (folder / SETTINGS).write_text(
            _settings_toml(recording, output, settings, estimator), encoding="utf-8"
        )
        pictures_s = time.perf_counter()
        if output.pictures:
            draw_pictures(recording, motion, folder, _title(recording, estimate), reporter)
        seconds = {
            "pictures": time.perf_counter() - pictures_s,
            "total": time.perf_counter() - started,
        }
        summary = _summary(recording, estimate, estimator, seconds)
        (folder / SUMMARY).write_text(as_json(summary), encoding="utf-8")
    return Result.open(output.folder)


def track(
    recording: Recording,
    output: Output,
    settings: Settings | None = None,
    reporter: Reporter | None = None,
) -> Result:
    """Estimates the motion of a recording from one of its cameras, as `voxelpose track` does.

    Args: recording: one camera's frames: `Recording.open(folder, cameras=["cam_1"])`. output: where
        the results go. settings: as for `fit`. Its options: `library` (path of a pose library; else
        the default one, which is made at first use),
            `start` ("facing" or "any"), `refine`, `weighting`, `motion_model`.
        reporter: told of every stage; None: nobody is.

    Returns:
        The result, as read back from the folder.

    Raises: InputError: the recording has several cameras, or it, the settings or the output cannot
        be used.
    """
    return fit(recording, output, settings, "monocular", reporter)


def _with_subject(settings: Settings, recording: Recording) -> Settings:
    subject = recording.subject
    return replace(
        settings,
        stature_m=settings.stature_m if settings.stature_m is not None else subject.stature_m,
        chest_m=settings.chest_m if settings.chest_m is not None else subject.chest_girth_m,
        sex=settings.sex if settings.sex != "unknown" else subject.sex,
    )


def _title(recording: Recording, estimate: Estimate) -> str:
    motion = estimate.motion
    lost = recording.frame_count - len(motion)
    words = [
        recording.folder.resolve().name,
        f"stature {motion.model.sizes.stature_m:.2f} m",
        (
            f"{recording.frame_count} frames, {len(recording.rig)}"
            f" camera{'s' if len(recording.rig) > 1 else ''}"
        ),
        *([f"{lost} frames without a pose"] if lost else []),
    ]
    return " · ".join(words)


def _settings_toml(recording: Recording, output: Output, settings: Settings, estimator: str) -> str:
    document = tomlkit.document()
    document.add(
        tomlkit.comment(
            "What this result was made with; a setting that is missing was left to the program."
        )
    )
    document["recording"] = _path_from(Path(output.folder).resolve(), recording.folder.resolve())
    document["frames"] = [recording.first, recording.first + recording.frame_count]
    document["cameras"] = list(recording.rig.names)
    document["estimator"] = estimator
    told = asdict(settings)
    options = told.pop("options")
    for name, value in told.items():
        if value is not None:
            document[name] = value
    document["options"] = dict(options)
    return tomlkit.dumps(document)


def _path_from(here: Path, there: Path) -> str:
    """Returns a relative path, so that recording and result can move together; an absolute one
    across Windows drives.
    """
    try:
        return Path(os.path.relpath(there, here)).as_posix()
    except ValueError:
        return str(there)


def _summary(
    recording: Recording, estimate: Estimate, estimator: str, seconds: Mapping[str, float]
) -> dict[str, object]:
    motion = estimate.motion
    posed = {int(frame) for frame in motion.frames}
    first, count = recording.first, recording.frame_count
    sizes = motion.model.sizes
    return {
        "voxelpose": __version__,
        "estimator": estimator,
        "recording": recording.folder.resolve().name,
        "fps": recording.fps,
        "cameras": list(recording.rig.names),
        "frames": {
            "first": first,
            "last": first + count - 1,
            "with_pose": len(motion),
            "lost": [frame for frame in range(first, first + count) if frame not in posed],
        },
        "body": {
            "stature_m": sizes.stature_m,
            "chest_girth_m": sizes.chest_girth_m,
            "sex": sizes.sex,
        },
        "quality": _quality(motion),
        "seconds": {
            **{name: round(value, 3) for name, value in seconds.items()},
            "stages": {
                name: _range_of(values, 4) | {"sum": round(float(np.sum(values)), 3)}
                for name, values in estimate.stage_s.items()
            },
        },
        "facts": dict(estimate.facts),
    }


def _quality(motion: Motion) -> dict[str, object]:
    """Summarises every quality array: over frames, and per part or joint where it has them."""
    from silhouette_core.body.joints import LANDMARK_NAMES

    found: dict[str, object] = {}
    for name, array in motion.quality.items():
        values = np.asarray(array, float)
        if values.ndim == 1:
            found[name] = _range_of(values, 4)
        elif values.ndim == 2 and values.shape[1] in (len(motion.model.names), len(LANDMARK_NAMES)):
            columns = (
                motion.model.names if values.shape[1] == len(motion.model.names) else LANDMARK_NAMES
            )
            found[name] = {
                column: round(float(np.nanmean(values[:, k])), 4)
                for k, column in enumerate(columns)
            }
    return found


def _range_of(values: NDArray, digits: int) -> dict[str, float]:
    if not np.isfinite(values).any():
        return {}
    numbers = {"min": np.nanmin(values), "median": np.nanmedian(values), "max": np.nanmax(values)}
    return {name: round(float(value), digits) for name, value in numbers.items()}
