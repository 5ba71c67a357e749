"""Contents of the files of a result that tell how it was made, and how good it is."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np
import tomlkit
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.estimator import Estimate, Settings
from silhouette_core.motion.conditioning import describe_conditioning
from silhouette_core.motion.dynamics import is_person_tree
from silhouette_core.motion.heading import fastest_turn
from silhouette_core.motion.motion import Motion
from voxelpose.recording.folder import Recording
from voxelpose.reliability import findings_of, verdict_of
from voxelpose.version import __version__


def _head(recording: Recording, estimator: str) -> dict[str, object]:
    return {
        "voxelpose": __version__,
        "estimator": estimator,
        "recording": recording.folder.resolve().name,
        "fps": recording.fps,
        "cameras": list(recording.rig.names),
    }


def _body_table(model: BodyModel) -> dict[str, object]:
    person = model.person
    if person is None:
        return {"parts": len(model.names), "extent_m": round(model.extent_m, 4)}
    return {
        "stature_m": round(person.stature_m, 4),
        "chest_girth_m": person.chest_girth_m,
        "sex": person.sex,
    }


def settings_document(
    recording: Recording, folder: Path, settings: Settings, estimator: str
) -> tomlkit.TOMLDocument:
    """Contents of settings.toml of a result in a folder."""
    document = tomlkit.document()
    document.add(
        tomlkit.comment("Settings of this result; the program chose those that are not listed.")
    )
    document["recording"] = path_from(folder.resolve(), recording.folder.resolve())
    document["frames"] = [int(recording.numbers[0]), int(recording.numbers[-1]) + 1]
    document["cameras"] = list(recording.rig.names)
    document["estimator"] = estimator
    if recording.label is not None:
        document["label"] = recording.label
    given = asdict(settings)
    options, conditioning = given.pop("options"), given.pop("conditioning")
    people = [{key: v for key, v in each.items() if v is not None} for each in given.pop("people")]
    if recording.silhouettes_given:
        given.pop("background")
    for name, value in given.items():
        if value not in (None, ()):
            document[name] = value
    document["conditioning"] = {name: v for name, v in conditioning.items() if v is not None}
    document["options"] = dict(options)
    if people:
        document["people"] = people
    return document


def path_from(start: Path, target: Path) -> str:
    """Returns a relative path, so that recording and result can be moved together."""
    try:
        return Path(os.path.relpath(target, start)).as_posix()
    except ValueError:  # another Windows drive
        return str(target)


def summary_document(
    recording: Recording, estimate: Estimate, estimator: str, seconds: Mapping[str, float]
) -> dict[str, object]:
    """Contents of summary.json, but for the inputs."""
    motion = estimate.motion
    posed, filmed = set(motion.frames[~motion.filled].tolist()), recording.numbers.tolist()
    first, last = filmed[0], filmed[-1]
    summary: dict[str, object] = {
        **_head(recording, estimator),
        "up": motion.up.round(6) + 0.0,
        "floor_m": round(motion.floor_m, 4),
        "frames": {
            "first": first,
            "last": last,
            "with_pose": len(posed),
            "lost": [frame for frame in filmed if frame not in posed | estimate.absent_frames],
            "away": sorted(estimate.absent_frames - posed),
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
    summary["findings"] = [asdict(finding) for finding in findings_of(summary, motion)]
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
    numbers = {"min": np.nanmin, "median": np.nanmedian, "max": np.nanmax, "mean": np.nanmean}
    return {name: round(float(statistic(values)), 4) for name, statistic in numbers.items()}


def people_document(
    recording: Recording, estimator: str, summaries: Mapping[str, Mapping], seconds: Mapping
) -> dict[str, object]:
    """Contents of summary.json of several people's results: an index, by the folders' names."""
    return {
        **_head(recording, estimator),
        "people": {
            name: {key: summary[key] for key in ("frames", "body", "verdict")}
            for name, summary in summaries.items()
        },
        "seconds": {name: round(value, 3) for name, value in seconds.items()},
    }
