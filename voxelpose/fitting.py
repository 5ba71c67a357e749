"""Estimation of a recording's motion into a result folder, as by `voxelpose fit` and `track`."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import tomlkit

from calib.errors import InputError
from calib.files import write_rig
from silhouette_core.body.model import BodyModel
from silhouette_core.estimator import (
    ONE_CAMERA,
    Estimate,
    Estimator,
    PeopleEstimator,
    Settings,
    load_estimator,
)
from silhouette_core.jit import check_threads
from silhouette_core.motion.conditioning import filter_warning
from silhouette_core.motion.joint_files import JOINTS
from silhouette_core.motion.motion_file import write_motion
from silhouette_core.network_files import installed_network
from silhouette_core.progress import Reporter, SilentReporter
from silhouette_core.scoring.backend import load_backend
from voxelpose.export.bvh import write_bvh
from voxelpose.export.tables import HYPOTHESES, write_hypotheses, write_joints, write_people_joints
from voxelpose.people_marks import person_names
from voxelpose.recording.folder import Recording
from voxelpose.recording.input_digests import input_digests
from voxelpose.result_documents import (
    path_from,
    people_document,
    settings_document,
    summary_document,
)
from voxelpose.results import (
    CALIBRATION,
    MOTION,
    SETTINGS,
    SUMMARY,
    Result,
    ResultWriter,
    as_json,
    load_summary,
    open_people,
)
from voxelpose.view.images.overlay import draw_pictures, refusal_drawn

_LONG_S = 600  # of work, from which it is told
# Of a camera's picture in a frame, see "how fast" in docs/results.md: ms of work with overlays, and
# bytes of scratch files and of the result.
_MS_SEVERAL, _MS_ONE = 70, 65
_SCRATCH, _RESULT = 15_000, 5_000
_MEMORY, _MEMORY_A_FRAME = 1_800_000_000, 1_300  # bytes


@dataclass(frozen=True)
class Output:
    """Destination and contents of a result."""

    folder: Path | str  #: the result folder to be made.
    overwrite: bool = False  #: whether an earlier result of this name is replaced.
    pictures: bool = True  #: whether overlay videos and the contact sheet are drawn.
    sources: Mapping[str, str] = field(default_factory=dict)
    """Files that settings were taken from, by the names of the options; kept in summary.json."""


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
    return fit_people(recording, output, settings, estimator, reporter, 1)[0]


def fit_people(
    recording: Recording,
    output: Output,
    settings: Settings | None = None,
    estimator: str = "multiview",
    reporter: Reporter | None = None,
    people: int | None = None,
) -> list[Result]:
    """As `fit`, of everybody in a recording; returns a result each.

    Of one person the output's folder is the result. Of several it has a result in `person_1`,
    `person_2` and so on, with joints.csv and pictures of all of them and an index, summary.json.

    Args:
        people: how many there are; None: as many as are seen.

    Raises:
        InputError: as `fit`; fewer people are there; the estimator can estimate but one.
    """
    reporter = reporter or SilentReporter()
    started = time.perf_counter()
    implementation = load_estimator(estimator)
    settings = _with_subject(settings or Settings(), recording, implementation)
    check_threads(settings.threads)
    writer = ResultWriter(output.folder, output.overwrite, keep_out_of=recording.folder)
    load_backend(settings.backend)  # refuses an unknown name before the work begins
    installed_network(settings.network)  # likewise what is no network
    for words in filter(None, (*recording.notes, work_ahead(recording, estimator))):
        reporter.note(words)
    with writer as folder:
        inputs = input_digests(recording, estimator)  # before they can change
        with refusal_drawn(recording, output.folder):
            if isinstance(implementation, PeopleEstimator):
                estimates = implementation.estimate_people(recording, settings, reporter, people)
            elif people in (None, 1):
                estimates = [implementation.estimate(recording, settings, reporter)]
            else:
                raise InputError(f"estimator {estimator!r} estimates one person, not {people}")
        several = len(estimates) > 1
        estimations = [
            _Estimation(recording, estimate, known, estimator, started, inputs)
            for k, estimate in enumerate(estimates)
            for known in [settings.of_person(k) if several else settings]
        ]
        if len(estimations) > 1:
            _write_people(folder, output, estimations, reporter)
        else:
            _write_files(folder, output, estimations[0], reporter)
    return open_people(output.folder)


def work_ahead(recording: Recording, estimator: str) -> str:
    """Words on time, disk and memory that an estimation takes; "" where it is short.

    Raises:
        InputError: the folder of temporary files has no room for it.
    """
    frames, cameras = recording.frame_count, len(recording.rig)
    pictures = frames * cameras
    seconds = pictures * (_MS_ONE if estimator in ONE_CAMERA else _MS_SEVERAL) / 1000
    if seconds < _LONG_S:
        return ""
    scratch, folder = pictures * _SCRATCH, tempfile.gettempdir()
    free = shutil.disk_usage(folder).free
    needs = f"{scratch / 1e9:.1f} GB in the folder of temporary files {folder}"
    if scratch > free:
        raise InputError(
            f"{frames:,} frames of {cameras} cameras need about {needs}, which has"
            f" {free / 1e9:.1f}: set TMPDIR to another folder, or estimate parts with --frames"
        )
    hours = f"{seconds / 3600:.1f} hours" if seconds > 3600 else f"{seconds / 60:.0f} minutes"
    memory = (_MEMORY + frames * _MEMORY_A_FRAME) / 1e9
    return (
        f"{frames:,} frames of {cameras} camera{'s' * (cameras > 1)} take about {hours} on two"
        f" cores, {needs} ({free / 1e9:.0f} free), {pictures * _RESULT / 1e9:.1f} GB for the result"
        f" and {memory:.1f} GB of memory"
    )


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
    settings, estimator = estimation.settings, estimation.estimator
    document = settings_document(recording, Path(output.folder), settings, estimator)
    (folder / SETTINGS).write_text(tomlkit.dumps(document), encoding="utf-8")
    estimated = time.perf_counter()
    if output.pictures:
        draw_pictures(recording, [motion], folder, _title(recording, estimate), reporter)
    finished = time.perf_counter()
    seconds = {"pictures": finished - estimated, "total": finished - estimation.started}
    summary = summary_document(recording, estimate, estimator, seconds)
    summary["inputs"] = estimation.inputs
    if output.sources:
        start = Path(output.folder).resolve()
        files = {name: path_from(start, Path(file)) for name, file in output.sources.items()}
        summary["settings_from"] = files
    (folder / SUMMARY).write_text(as_json(summary), encoding="utf-8")


def _write_people(
    folder: Path, output: Output, estimations: Sequence[_Estimation], reporter: Reporter
) -> None:
    """Writes a result for each of several people, and what shows them all."""
    names = person_names(len(estimations))
    for name, estimation in zip(names, estimations, strict=True):
        person_output = replace(output, folder=Path(output.folder) / name, pictures=False)
        (folder / name).mkdir()
        _write_files(folder / name, person_output, estimation, reporter)
    first, motions = estimations[0], [person.estimate.motion for person in estimations]
    write_people_joints(motions, folder / JOINTS)
    estimated = time.perf_counter()
    if output.pictures:
        recording, rig = first.recording, first.estimate.rig
        filmed = recording if rig is None else replace(recording, rig=rig)
        title = f"{recording.folder.resolve().name} · {len(motions)} people"
        draw_pictures(filmed, motions, folder, title, reporter)
    summaries = {name: load_summary(folder / name / SUMMARY) for name in names}
    finished = time.perf_counter()
    seconds = {"pictures": finished - estimated, "total": finished - first.started}
    index = people_document(first.recording, first.estimator, summaries, seconds)
    (folder / SUMMARY).write_text(as_json(index), encoding="utf-8")


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
    background = settings.background
    if background == "auto":
        background = getattr(estimator, "usual_background", background)
    up = settings.up
    if up is None and recording.up is not None:
        up = tuple(recording.up.tolist())
    return replace(
        settings,
        options=options,
        background=background,
        stature_m=settings.stature_m if settings.stature_m is not None else subject.stature_m,
        chest_m=settings.chest_m if settings.chest_m is not None else subject.chest_girth_m,
        sex=settings.sex if settings.sex != "unknown" else subject.sex,
        up=up,
    )


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
