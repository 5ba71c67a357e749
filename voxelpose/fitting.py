"""Estimation of a recording's motion into a result folder, as by `voxelpose fit` and `track`."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
import tomlkit
from numpy.typing import NDArray

from calib.errors import InputError
from calib.files import write_rig
from silhouette_core.body.model import BodyModel
from silhouette_core.estimator import Estimate, Estimator, Settings, load_estimator
from silhouette_core.image.segmenter import load_segmenter
from silhouette_core.jit import check_threads
from silhouette_core.motion.conditioning import describe_conditioning, filter_warning
from silhouette_core.motion.dynamics import is_person_tree
from silhouette_core.motion.heading import fastest_turn
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import write_motion
from silhouette_core.progress import Reporter, SilentReporter
from silhouette_core.scoring.backend import load_backend
from voxelpose.export.bvh import write_bvh
from voxelpose.export.tables import HYPOTHESES, JOINTS, write_hypotheses, write_joints
from voxelpose.recording.folder import Recording
from voxelpose.recording.input_digests import input_digests
from voxelpose.reliability import verdict_of
from voxelpose.results import CALIBRATION, MOTION, SETTINGS, SUMMARY, Result, ResultWriter, as_json
from voxelpose.version import __version__
from voxelpose.view.images.overlay import draw_pictures, refusal_drawn


@dataclass(frozen=True)
class Output:
    """Destination and contents of a result.

    Attributes:
        folder: the result folder to be made.
        overwrite: whether an earlier result of this name is replaced.
        pictures: whether overlay videos and the contact sheet are drawn.
        sources: files that settings were taken from, by the names of the options; kept in
            summary.json.
    """

    folder: Path | str
    overwrite: bool = False
    pictures: bool = True
    sources: Mapping[str, str] = field(default_factory=dict)


def fit(
    recording: Recording,
    output: Output,
    settings: Settings | None = None,
    estimator: str = "multiview",
    reporter: Reporter | None = None,
) -> Result:
    """Estimates the motion of a recording and writes a result folder; returns the result, as read
    back.

    Args:
        settings: settings of the estimator; stature, chest girth, sex and body that are not set are
            taken from the recording's subject.toml, and up from its calibration.
        estimator: name under which the estimator is registered.
        reporter: receiver of progress; None reports nothing.

    Raises:
        InputError: the recording, the settings or the output cannot be used. Silhouettes that
            cannot be a person's are shown in `OUT.silhouettes.png`.
    """
    reporter = reporter or SilentReporter()
    started = time.perf_counter()
    implementation = load_estimator(estimator)
    settings = _with_subject(settings or Settings(), recording, implementation)
    check_threads(settings.threads)
    writer = ResultWriter(output.folder, output.overwrite, keep_out_of=recording.folder)
    load_backend(settings.backend)  # refuses an unknown name before the work begins
    if settings.segmenter is not None:
        load_segmenter(settings.segmenter)
    for words in recording.notes:
        reporter.note(words)
    with writer as folder:
        inputs = input_digests(recording, estimator)  # before they can change
        with refusal_drawn(recording, output.folder):
            estimate = implementation.estimate(recording, settings, reporter)
        estimation = _Estimation(recording, estimate, settings, estimator, started, inputs)
        _write_files(folder, output, estimation, reporter)
    return Result.open(output.folder)


def write_estimate(
    recording: Recording,
    output: Output,
    estimate: Estimate,
    settings: Settings,
    estimator: str = "multiview",
    spent_s: float = 0.0,
) -> Result:
    """Writes a result folder of an estimate that was made otherwise, with these settings and in
    `spent_s` seconds; returns the result, as read back.

    Raises:
        InputError: it holds no pose, or the output cannot be used.
    """
    started = time.perf_counter() - spent_s
    settings = _with_subject(settings, recording, load_estimator(estimator))
    writer = ResultWriter(output.folder, output.overwrite, keep_out_of=recording.folder)
    with writer as folder:
        inputs = input_digests(recording, estimator)
        estimation = _Estimation(recording, estimate, settings, estimator, started, inputs)
        _write_files(folder, output, estimation, SilentReporter())
    return Result.open(output.folder)


@dataclass(frozen=True, eq=False)
class _Estimation:
    """An estimate of a recording and how it was made, from `started` of the process's clock on."""

    recording: Recording
    estimate: Estimate
    settings: Settings
    estimator: str
    started: float
    inputs: Mapping[str, str]


def _write_files(folder: Path, output: Output, estimation: _Estimation, reporter: Reporter) -> None:
    """Writes the files of a result into a folder."""
    recording, estimate = estimation.recording, estimation.estimate
    motion = estimate.motion
    if estimate.rig is not None:
        recording = replace(recording, rig=estimate.rig)
    if not len(motion):
        raise InputError(
            "no pose was found in any frame: look at the silhouettes with `voxelpose setup`,"
            " and mend them"
        )
    warning = filter_warning(motion)
    if warning:
        reporter.note(warning)
    reporter.stage("files")
    write_joints(motion, folder / JOINTS)
    write_bvh(motion, folder / "motion.bvh")
    write_motion(motion, folder / MOTION)
    if estimate.hypotheses is not None:
        write_hypotheses(estimate.hypotheses, folder / HYPOTHESES, motion.model.tree)
    write_rig(recording.rig, folder / CALIBRATION)
    document = _settings_toml(recording, output, estimation.settings, estimation.estimator)
    (folder / SETTINGS).write_text(document, encoding="utf-8")
    estimated = time.perf_counter()
    if output.pictures:
        draw_pictures(recording, motion, folder, _title(recording, estimate), reporter)
    finished = time.perf_counter()
    seconds = {"pictures": finished - estimated, "total": finished - estimation.started}
    summary = _summary(recording, estimate, estimation.estimator, seconds)
    summary["inputs"] = estimation.inputs
    if output.sources:
        start = Path(output.folder).resolve()
        files = {name: _path_from(start, Path(file)) for name, file in output.sources.items()}
        summary["settings_from"] = files
    (folder / SUMMARY).write_text(as_json(summary), encoding="utf-8")


def track(
    recording: Recording,
    output: Output,
    settings: Settings | None = None,
    reporter: Reporter | None = None,
) -> Result:
    """Estimates the motion of a recording from one camera, as `voxelpose track` does; returns the
    result, as read back.

    Args:
        recording: frames of one camera: `Recording.open(folder, cameras=["cam_1"])`.
        settings: as for `fit`, with the options `library` (path of a pose library; by default the
            program's own proposal is used), `start` ("facing" or "any") and `outline_only`.
        reporter: receiver of progress; None reports nothing.

    Raises:
        InputError: the recording has several cameras, or the recording, the settings or the output
            cannot be used.
    """
    return fit(recording, output, settings, "monocular", reporter)


def _with_subject(settings: Settings, recording: Recording, estimator: Estimator) -> Settings:
    subject = recording.subject
    options = dict(settings.options)
    if subject.body is not None and getattr(estimator, "takes_body", False):
        options.setdefault("body", subject.body)
    return replace(
        settings,
        options=options,
        stature_m=settings.stature_m if settings.stature_m is not None else subject.stature_m,
        chest_m=settings.chest_m if settings.chest_m is not None else subject.chest_girth_m,
        sex=settings.sex if settings.sex != "unknown" else subject.sex,
        up=settings.up if settings.up is not None else _stated_up(recording),
    )


def _stated_up(recording: Recording) -> tuple[float, float, float] | None:
    if recording.up is None:
        return None
    x, y, z = recording.up.tolist()
    return x, y, z


def _title(recording: Recording, estimate: Estimate) -> str:
    motion = estimate.motion
    lost = recording.frame_count - int((~motion.filled).sum())
    plural = "s" if len(recording.rig) > 1 else ""
    phrases = [
        recording.folder.resolve().name,
        _describe(motion.model),
        f"{recording.frame_count} frames, {len(recording.rig)} camera{plural}",
        *([f"{lost} frames without a pose"] if lost else []),
    ]
    return " · ".join(phrases)


def _describe(model: BodyModel) -> str:
    person = model.person
    if person is not None:
        return f"stature {person.stature_m:.2f} m"
    return f"a given body of {len(model.names)} parts"


def _body_table(model: BodyModel) -> dict[str, object]:
    """The body's entry of the summary."""
    person = model.person
    if person is None:
        return {"parts": len(model.names), "extent_m": round(model.extent_m, 4)}
    return {
        "stature_m": round(person.stature_m, 4),
        "chest_girth_m": person.chest_girth_m,
        "sex": person.sex,
    }


def _settings_toml(recording: Recording, output: Output, settings: Settings, estimator: str) -> str:
    document = tomlkit.document()
    document.add(
        tomlkit.comment("Settings of this result; the program chose those that are not listed.")
    )
    document["recording"] = _path_from(Path(output.folder).resolve(), recording.folder.resolve())
    document["frames"] = [int(recording.numbers[0]), int(recording.numbers[-1]) + 1]
    document["cameras"] = list(recording.rig.names)
    document["estimator"] = estimator
    if recording.label is not None:
        document["label"] = recording.label
    given = asdict(settings)
    options, conditioning = given.pop("options"), given.pop("conditioning")
    if recording.silhouettes_given:
        given.pop("background")
    for name, value in given.items():
        if value is not None:
            document[name] = value
    document["conditioning"] = {name: v for name, v in conditioning.items() if v is not None}
    document["options"] = dict(options)
    return tomlkit.dumps(document)


def _path_from(start: Path, target: Path) -> str:
    """Returns a relative path, so that recording and result can be moved together."""
    try:
        return Path(os.path.relpath(target, start)).as_posix()
    except ValueError:  # another Windows drive
        return str(target)


def _summary(
    recording: Recording, estimate: Estimate, estimator: str, seconds: Mapping[str, float]
) -> dict[str, object]:
    motion = estimate.motion
    posed, filmed = set(motion.frames[~motion.filled].tolist()), recording.numbers.tolist()
    first, last = filmed[0], filmed[-1]
    summary: dict[str, object] = {
        "voxelpose": __version__,
        "estimator": estimator,
        "recording": recording.folder.resolve().name,
        "fps": recording.fps,
        "cameras": list(recording.rig.names),
        "up": motion.up.round(6) + 0.0,
        "floor_m": round(motion.floor_m, 4),
        "frames": {
            "first": first,
            "last": last,
            "with_pose": len(posed),
            "lost": [frame for frame in filmed if frame not in posed],
            "not_filmed": sorted({*range(first, last + 1)} - {*filmed}),
        },
        "body": _body_table(motion.model),
        "quality": _quality(motion, recording.rig.names),
        "seconds": {
            **{name: round(value, 3) for name, value in seconds.items()},
            "stages": {
                name: _range_of(values) | {"sum": round(float(np.sum(values)), 3)}
                for name, values in estimate.stage_s.items()
            },
        },
        "conditioning": describe_conditioning(motion),
        "facts": dict(estimate.facts),
    }
    if is_person_tree(motion.model.tree):
        speed, frame = fastest_turn(motion)
        summary["facts"] = {**estimate.facts, "fastest_turn": [round(speed, 1), frame]}
    summary["verdict"] = asdict(verdict_of(summary))
    return summary


def _quality(motion: Motion, cameras: tuple[str, ...]) -> dict[str, dict[str, float]]:
    """Ranges of the quality arrays over frames, and means of those per part, joint or camera."""
    summary: dict[str, dict[str, float]] = {}
    for name, array in motion.quality.items():
        values = np.asarray(array, float)
        if values.ndim == 1:
            summary[name] = _range_of(values)
            if name == "right_probability":
                summary[name] |= {"lower_quarter": round(float(np.nanquantile(values, 0.25)), 4)}
        columns = cameras if name == "camera_agreement" else motion.model.names
        if name.startswith(("joint_", "landmark_")):
            columns = motion.model.tree.landmark_names
        if values.ndim == 2 and values.shape[1] == len(columns):
            summary[name] = {
                column: round(float(np.nanmean(values[:, k])), 4)
                for k, column in enumerate(columns)
                if np.isfinite(values[:, k]).any()
            }
    return summary


def _range_of(values: NDArray) -> dict[str, float]:
    if not np.isfinite(values).any():
        return {}
    numbers = {"min": np.nanmin(values), "median": np.nanmedian(values), "max": np.nanmax(values)}
    return {name: round(float(value), 4) for name, value in numbers.items()}
