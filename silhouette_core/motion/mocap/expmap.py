"""Reader of exponential maps: a CSV of numbers with skeleton.json in the same folder."""

import warnings
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from calib.checks import FloatArray, IntArray
from calib.errors import InputError
from calib.storage.documents import load_text, parse_json
from silhouette_core.body.rigs.bvh_hierarchy import LARGEST_CLIP, LARGEST_VALUE, MOST_JOINTS
from silhouette_core.motion.mocap.bvh import check_numbers

# The CMU skeleton of the motion-prediction literature, for a skeleton.json without "names".
_CMU = tuple(
    "Hips LHipJoint LeftUpLeg LeftLeg LeftFoot LeftToeBase LeftToeEnd RHipJoint RightUpLeg RightLeg"
    " RightFoot RightToeBase RightToeEnd LowerBack Spine Spine1 Neck Neck1 Head HeadEnd"
    " LeftShoulder LeftArm LeftForeArm LeftHand LeftFingers LeftIndex LeftIndexEnd LeftThumb"
    " LeftThumbEnd RightShoulder RightArm RightForeArm RightHand RightFingers RightIndex"
    " RightIndexEnd RightThumb RightThumbEnd".split()
)
_LARGEST_SKELETON = 10_000_000


def read_expmap(path: Path) -> tuple[tuple[str, ...], IntArray, FloatArray, FloatArray, float]:
    """Skeleton and transforms of a clip.

    Each row is a frame: the root's position, then the rotation vector of joint_from_parent for each
    joint (the inverse of the joint's rotation, a convention of that literature). Raises InputError
    where skeleton.json is missing or does not fit, or values are no numbers.

    Args:
        path: the CSV; skeleton.json in the same folder states parent, offset and fps, and, unless
            they are CMU's 38 joints in centimetres, names and root_scale (the root's unit in that
            of the offsets).

    Returns:
        Names, parents (J,), offsets (T, J, 3) with the root's position, parent_from_joint
        rotations (T, J, 3, 3), frames per second.
    """
    beside = path.with_name("skeleton.json")
    if not beside.exists():
        raise InputError(
            f"{path} needs skeleton.json beside it: parent, offset and fps of its joints"
        )
    skeleton = parse_json(load_text(beside, _LARGEST_SKELETON), beside)
    try:
        parents = np.array(skeleton["parent"], np.int64)
        offsets = np.array(skeleton["offset"], float).reshape(len(parents), 3)
        fps = float(skeleton["fps"])
        names = tuple(skeleton.get("names", _CMU))
        scale = float(skeleton.get("root_scale", 2.54 / 0.45))  # CMU's unit, in centimetres
        if not all(isinstance(name, str) for name in names) or parents.ndim != 1:
            raise ValueError("names or parent is no list of such")
        if len(parents) > MOST_JOINTS or not 0.1 <= fps <= 1e5:
            raise ValueError(f"{len(parents)} joints and fps {fps:g} are no recording's")
        if not (np.abs([*offsets.ravel(), scale]) < LARGEST_VALUE).all():
            raise ValueError("offset or root_scale is no bone's")
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError) as error:
        raise InputError(
            f"{beside} is no skeleton with parent, offset and fps: {repr(error)[:200]}"
        ) from error
    indices = np.arange(len(parents))
    if len(names) != len(parents) or (parents >= indices).any() or (parents < -1).any():
        raise InputError(
            f"{beside} has {len(parents)} joints: it must name as many, parents before children"
        )
    rows = _rows(path, 3 + 3 * len(parents))
    turns = -rows[:, 3:].reshape(len(rows), len(parents), 3)
    local = Rotation.from_rotvec(turns.reshape(-1, 3)).as_matrix().reshape(*turns.shape, 3)
    positions = np.tile(offsets, (len(rows), 1, 1))
    positions[:, 0] += rows[:, :3] * scale
    return names, parents, positions, local, fps


def _rows(path: Path, columns: int) -> FloatArray:
    try:
        if path.stat().st_size > LARGEST_CLIP:
            raise ValueError(f"larger than {LARGEST_CLIP / 1e6:.0f} MB")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # an empty file is reported below
            rows = np.loadtxt(path, delimiter=",", ndmin=2)
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read as rows of numbers: {str(error)[:200]}") from error
    if not len(rows) or rows.shape[1] != columns:
        raise InputError(
            f"{path} has {rows.shape[1] if len(rows) else 0} numbers a row, its skeleton.json wants"
            f" {columns}"
        )
    check_numbers(path, rows)
    return rows
