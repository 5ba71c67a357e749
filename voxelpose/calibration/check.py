"""Check of a recording's calibration against its silhouettes, with diagnosis and repair."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.agreement import SUBFRAME, Agreement, agreement
from calib.camera import Camera, Rig
from calib.errors import InputError
from calib.files import write_rig
from calib.moments import even_moments
from calib.repair import Repair, explain
from calib.tangency import Outline, OutlineTrack
from calib.upright import axis_name, other_up
from silhouette_core.estimator import Frame
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.progress import Reporter, SilentReporter
from voxelpose.findings import Finding
from voxelpose.recording.folder import Recording
from voxelpose.recording.timestamps import TIMESTAMPS, write_timestamps
from voxelpose.results import ResultWriter

LONG_SIDE_PX = 480
MOMENTS, MOST_LATE = 12, 12
"""Frames that are compared, and the largest clock offset tried, frames, where nobody says."""
_SHOWN = 3  # moments that are kept for the picture


@dataclass(frozen=True, eq=False)
class CheckedFrame:
    """Image (h, w, 3) uint8, BGR, and silhouette (h, w) bool of one camera at one moment."""

    frame: Frame
    mask: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Check:
    """Result of a check."""

    rig: Rig
    tracks: dict[str, OutlineTrack]
    moments: NDArray[np.int64]  #: numbers of the frames compared.
    times_s: NDArray[np.float64]
    agreement: Agreement
    repairs: tuple[Repair, ...]
    repaired: Rig | None  #: the rig with these cameras corrected; None if none could be.
    after: Agreement | None  #: agreement of `repaired`.
    checked_frames: dict[int, dict[str, CheckedFrame]]
    """Moment -> camera name -> image, for some of the moments."""
    notes: tuple[str, ...]


def check_recording(
    recording: Recording,
    reporter: Reporter | None = None,
    moments_count: int = MOMENTS,
    most_late: int = MOST_LATE,
) -> Check:
    """Checks a recording's cameras, two or more, against its silhouettes. InputError where there is
    one camera only, nobody is seen, or a file cannot be read.

    Args:
        moments_count: number of frames that are compared.
        most_late: largest offset of a camera that is tried, frames.
    """
    reporter = reporter or SilentReporter()
    if len(recording.rig) < 2:
        raise InputError(
            f"{recording.folder} has one camera: whether it agrees with itself cannot be asked;"
            " `check` needs two or more"
        )
    moments = even_moments(recording.frame_count, moments_count)
    reporter.stage("masks" if recording.silhouettes_given else "backgrounds")
    silhouettes = Silhouettes(recording, long_side_px=LONG_SIDE_PX)
    tracks, checked_frames = _outlines(recording, silhouettes, moments, reporter)
    times = recording.times_s[moments]
    checked = agreement(list(tracks.values()), times)
    repairs: list[Repair] = []
    if not checked.agrees and len(tracks) > 2:
        dense = dict(tracks)
        most = min(most_late, (recording.frame_count - 1) // 3)
        for name in checked.culprits if most else ():
            dense[name] = _dense_outlines(recording, silhouettes, name, moments, most, reporter)
        reporter.stage("looking for what happened")
        repairs = explain(dense, checked, times, most / recording.fps)
        tracks |= {name: dense[name] for name in checked.culprits}
    rig, after = _repaired(recording.rig, tracks, times, repairs)
    notes = _notes(recording, silhouettes, checked)
    frames = [(repair.camera, abs(repair.offset_s) * recording.fps) for repair in repairs]
    late = all(repair.kind == "out of step" for repair in repairs)
    if after is not None and late and max(count for _, count in frames) <= SUBFRAME:
        who = ", ".join(f"{camera} by {count:.1f}" for camera, count in frames)
        notes += (
            f"frames do not quite coincide ({who} of a frame), as where cameras are not triggered"
            " together; no harm",
        )
        checked = replace(checked, culprits=(), agrees=after.agrees)
        repairs, rig, after = [], None, None
    return Check(
        recording.rig,
        tracks,
        recording.numbers[moments],
        times,
        checked,
        tuple(repairs),
        rig,
        after,
        checked_frames,
        notes,
    )


def _outlines(
    recording: Recording, silhouettes: Silhouettes, moments: NDArray[np.int64], reporter: Reporter
) -> tuple[dict[str, OutlineTrack], dict[int, dict[str, CheckedFrame]]]:
    """Outlines of all cameras at the moments, and some of the images."""
    reporter.stage("silhouettes", len(moments))
    outlines: dict[str, list[Outline | None]] = {name: [] for name in recording.rig.names}
    pictured = moments[even_moments(len(moments), _SHOWN, 1 / (_SHOWN + 1))]
    checked_frames: dict[int, dict[str, CheckedFrame]] = {}
    for moment, frames in zip(moments.tolist(), recording.at(moments.tolist()), strict=True):
        masks = silhouettes.of(frames)
        for name, mask in masks.items():
            unknown = silhouettes.unknown.get(name)
            outlines[name].append(Outline.from_mask(recording.rig[name], mask, unknown))
        if moment in pictured:
            checked_frames[int(recording.numbers[moment])] = pictures = {}
            for name, mask in masks.items():
                small = cv2.resize(frames[name], mask.shape[::-1], interpolation=cv2.INTER_AREA)
                pictures[name] = CheckedFrame(np.asarray(small, np.uint8), mask)
        reporter.advance()
    times = recording.times_s[moments]
    return {
        name: OutlineTrack(recording.rig[name], times, tuple(seen))
        for name, seen in outlines.items()
    }, checked_frames


def _dense_outlines(
    recording: Recording,
    silhouettes: Silhouettes,
    name: str,
    moments: NDArray[np.int64],
    most: int,
    reporter: Reporter,
) -> OutlineTrack:
    """Outlines of one camera at all frames around the moments."""
    steps = np.unique(
        np.clip(moments[:, None] + np.arange(-most - 1, most + 2), 0, recording.frame_count - 1)
    )
    reporter.stage(f"{name} frame by frame", len(steps))
    frames = recording.readers[name].select((steps + recording.first).tolist())
    camera = recording.rig[name]
    return outline_track(camera, frames, recording.times_s[steps], silhouettes, reporter)


def outline_track(
    camera: Camera,
    frames: Iterable[Frame],
    time_s: NDArray[np.float64],
    silhouettes: Silhouettes,
    reporter: Reporter,
) -> OutlineTrack:
    """Outlines of one camera over time: T frames at times (T,) float64, s; tells each frame."""
    outlines, unknown = [], silhouettes.unknown.get(camera.name)
    for frame in frames:
        mask = silhouettes.of({camera.name: frame})[camera.name]
        outlines.append(Outline.from_mask(camera, mask, unknown))
        reporter.advance()
    return OutlineTrack(camera, time_s, tuple(outlines))


def _repaired(
    rig: Rig, tracks: dict[str, OutlineTrack], times: NDArray[np.float64], repairs: Sequence[Repair]
) -> tuple[Rig | None, Agreement | None]:
    """Rig with the repairs applied, and its agreement."""
    known = [repair for repair in repairs if repair.kind != "unexplained"]
    if not known:
        return None, None
    repaired = rig
    for repair in known:
        repaired = (
            exchanged(repaired, repair.camera, repair.with_camera)
            if repair.with_camera
            else repair.rig(repaired)
        )
    late = {repair.camera: repair.offset_s for repair in known}
    return repaired, agreement(
        [track.with_camera(repaired[name]) for name, track in tracks.items()], times, offset_s=late
    )


def exchanged(rig: Rig, first: str, second: str) -> Rig:
    """A rig with the names of two cameras exchanged."""
    other = {first: second, second: first}
    return Rig(tuple(replace(rig[other.get(name, name)], name=name) for name in rig.names))


def _notes(recording: Recording, silhouettes: Silhouettes, checked: Agreement) -> tuple[str, ...]:
    """Limitations of the check of this recording."""
    notes = []
    if silhouettes.without_background:
        who = ", ".join(silhouettes.without_background)
        notes.append(
            f"no empty view of {who}: its background was guessed, so its silhouettes are less sure,"
            " and this check with them"
        )
    if len(recording.rig) == 2:
        notes.append(
            "with two cameras it can be seen that one is wrong, not which one; a third tells"
        )
    elif len(recording.rig) == 3:
        notes.append(
            "with three cameras a small error can be laid at the wrong one's door; a fourth makes"
            " it sure"
        )
    up = other_up(recording.rig) if recording.up is None else None
    if up is not None:
        notes.append(
            f"the cameras stand as if {axis_name(up)} were up, not z; `fit` finds up by itself,"
            " `voxelpose calibrate convert --up cameras` writes a calibration with z up"
        )
    few = [
        line.camera
        for line in checked.table
        if line.moments < len(recording.rig) or line.planes < 12
    ]
    if few:
        notes.append(
            f"{', '.join(few)}: nobody is seen whole there at most of the moments; little can be"
            " said of it"
        )
    return tuple(notes)


def verdict_on(check: Check, camera: str) -> str:
    """Whether a camera `agrees`, `does not agree`, or `?` where that cannot be said of one."""
    swapped = any(
        repair.with_camera and camera in (repair.camera, repair.with_camera)
        for repair in check.repairs
    )
    if camera in check.agreement.culprits or swapped:
        return "does not agree"
    return "agrees" if check.agreement.agrees or check.agreement.culprits else "?"


def check_findings(check: Check, repairing: str = "run with --repair") -> list[Finding]:
    """What a check found of the cameras, of each that does not agree, and, about `note`, of itself,
    in the order in which it is told. `repairing`: how the repaired files are written.
    """
    agreement = check.agreement
    findings = [Finding("cameras", "good" if agreement.agrees else "bad", agreement.summary)]
    for repair in check.repairs:
        help_words = _remedy(repair, repairing)
        findings.append(Finding(repair.camera, "bad", repair.summary, remedy=help_words))
    if check.after is not None:
        level = "good" if check.after.agrees else "bad"
        findings.append(Finding("cameras", level, f"with that put right: {check.after.summary}"))
    if not agreement.agrees and not check.repairs and len(agreement.table) > 2:
        words = "calibrate again; if the videos were not started together, first"
        findings.append(Finding("cameras", "bad", f"{words} `voxelpose calibrate sync`"))
    return findings + [Finding("note", "look", note) for note in check.notes]


def _remedy(repair: Repair, repairing: str) -> str:
    camera = repair.camera
    remedies = {
        "swapped": f"rename the two videos (and backgrounds): {camera} <-> {repair.with_camera}",
        "out of step": f"{repairing} for a timestamps.csv, or `voxelpose calibrate sync`",
        "scaled": "record as you calibrated (same resolution, no black bars, no crop), or"
        f" {repairing}; but if {camera}'s picture is whole, heads or feet are missing from its"
        " silhouettes: look at the picture of the check",
        "unexplained": f"look at {camera}'s silhouettes first; if they are good, calibrate it"
        " again",
    }
    return remedies.get(repair.kind, f"calibrate it again, or {repairing}")


def write_repair(check: Check, recording: Recording, out: Path | str) -> Path:
    """Writes the repaired calibration, and timestamps.csv where a camera is out of step, into a
    folder. InputError where nothing can be repaired, or the folder exists or cannot be made.
    """
    if check.repaired is None:
        reason = "all cameras agree" if check.agreement.agrees else "what happened is not known"
        raise InputError(f"there is nothing to repair: {reason}; {out} was not written")
    late = {repair.camera: repair.offset_s for repair in check.repairs if repair.offset_s}
    with ResultWriter(out) as folder:
        write_rig(check.repaired, folder / "calibration.toml")
        if late:
            times = recording.file_times()
            write_timestamps(
                folder / TIMESTAMPS,
                {name: camera_times - late.get(name, 0.0) for name, camera_times in times.items()},
            )
    return Path(out)
