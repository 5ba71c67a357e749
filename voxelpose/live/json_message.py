"""Frames as JSON, one line each: the schema that docs/live.md describes."""

from typing import Any

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.kinematics import quaternions, relative_rotations
from voxelpose.live.live_frame import LiveFrame, PosedBody

SCHEMA_VERSION = 1


def json_message(frame: LiveFrame, sent_unix_s: float) -> str:
    """One frame, sent at a Unix time, as a line of JSON that ends with a line feed.

    Returns:
        The object that docs/live.md describes; numbers that are not finite are null.
    """
    message = {
        "format": "voxelpose live",
        "version": SCHEMA_VERSION,
        "number": frame.number,
        "time_s": _rounded(frame.time_s),
        "captured_unix_s": _rounded(frame.captured_unix_s),
        "sent_unix_s": _rounded(sent_unix_s),
        "note": frame.note,
        "body": None if frame.body is None else _body(frame.body),
    }
    return msgspec.json.encode(message).decode() + "\n"


def _body(body: PosedBody) -> dict[str, object]:
    model, pose = body.model, body.pose
    joints = zip(_rounded(body.joints_m), _rounded(body.joint_confidence), strict=True)
    turns = _rounded(quaternions(relative_rotations(body.part_rotation, model.parents)))
    return {
        "confidence": _rounded(body.confidence),
        "root": {
            "position_m": _rounded(pose.root_m),
            "rotation_wxyz": _rounded(quaternions(pose.root_rotation)),
        },
        "joints": {
            name: {"position_m": position, "confidence": confidence}
            for name, (position, confidence) in zip(LANDMARK_NAMES, joints, strict=True)
        },
        "local_rotations_wxyz": dict(zip(model.names, turns, strict=True)),
        "angles_rad": dict(zip(model.dof_names, _rounded(pose.angles_rad), strict=True)),
    }


def _rounded(values: ArrayLike) -> Any:
    """Numbers as lists, to a hundredth of a millimetre; JSON has those not finite as null."""
    return np.round(np.asarray(values, float), 5).tolist()
