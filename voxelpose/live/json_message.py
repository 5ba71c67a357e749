"""Frames as JSON, one line each: the schema that docs/live.md describes."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.kinematics import quaternions
from voxelpose.live.live_frame import LiveFrame, PosedBody

SCHEMA_VERSION = 1
_DIGITS = 5  # a hundredth of a millimetre


def json_message(frame: LiveFrame, sent_unix_s: float) -> str:
    """One frame as a line of JSON that ends with a line feed.

    Args:
        frame: one moment.
        sent_unix_s: the present, Unix time.

    Returns:
        The object that docs/live.md describes; numbers that are not finite are null.
    """
    message = {
        "format": "voxelpose live",
        "version": SCHEMA_VERSION,
        "number": frame.number,
        "time_s": _number(frame.time_s),
        "captured_unix_s": _number(frame.captured_unix_s),
        "sent_unix_s": _number(sent_unix_s),
        "note": frame.note,
        "body": None if frame.body is None else _body(frame.body),
    }
    return json.dumps(message, allow_nan=False, separators=(",", ":"), ensure_ascii=False) + "\n"


def _body(body: PosedBody) -> dict[str, object]:
    model = body.model
    joints = zip(
        LANDMARK_NAMES, body.joints_m.tolist(), body.joint_confidence.tolist(), strict=True
    )
    return {
        "confidence": _number(body.confidence),
        "root": {
            "position_m": _numbers(body.pose.root_m.tolist()),
            "rotation_wxyz": _numbers(quaternions(body.pose.root_rotation).tolist()),
        },
        "joints": {
            name: {"position_m": _numbers(position), "confidence": _number(confidence)}
            for name, position, confidence in joints
        },
        "local_rotations_wxyz": {
            name: _numbers(quaternion)
            for name, quaternion in zip(
                model.names, quaternions(_local(body)).tolist(), strict=True
            )
        },
        "angles_rad": dict(
            zip(model.dof_names, _numbers(body.pose.angles_rad.tolist()), strict=True)
        ),
    }


def _local(body: PosedBody) -> NDArray[np.float64]:
    """Rotations (27, 3, 3) of the parts relative to their parents; the root's to the world."""
    rotation, parents = body.part_rotation, body.model.parents
    children = parents >= 0
    local = rotation.copy()
    local[children] = rotation[parents[children]].transpose(0, 2, 1) @ rotation[children]
    return local


def _numbers(values: Iterable[float]) -> list[float | None]:
    return [_number(value) for value in values]


def _number(value: float) -> float | None:
    return round(float(value), _DIGITS) if math.isfinite(value) else None
