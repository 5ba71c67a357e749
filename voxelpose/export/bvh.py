"""Biovision hierarchy (BVH): skeletal animation for Blender, Maya, MotionBuilder and others."""

from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from silhouette_core.motion.anatomical import continuous_degrees
from silhouette_core.motion.motion import Motion
from voxelpose.export.rigged import RiggedMotion, rigged
from voxelpose.export.skeleton import ascii_names, every_frame

CM_PER_M = 100


def write_bvh(motion: Motion | RiggedMotion, path: Path) -> None:
    """Writes a motion of at least one pose as BVH.

    Axis map: x_bvh = x, y_bvh = z, z_bvh = -y of the upright frame; centimetres. With all rotations
    zero the skeleton stands in its rest pose (ours: upright, arms 45 degrees down), facing +z.
    Every joint has Z, X and Y rotations in degrees, applied as R = Rz Rx Ry and continuous in time,
    as programs interpolate between frames; positions precede those of the root, and of a joint that
    moves in the one above. Our joints, 27 of a person, have the names of the body's parts; the last
    ones end in end sites. Importers that ask for axes (Blender): forward -Z, up Y, scale 0.01.

    Frames without a pose between the first and the last pose are interpolated, since BVH cannot
    contain gaps.
    """
    body = rigged(motion).without_axes()  # which BVH cannot hold
    rotations, places = _without_gaps(body)
    degrees, moving = continuous_degrees(rotations), body.moving(places)
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("HIERARCHY\n")
        order = _write_joint(file, body, moving, 0, 0)
        file.write(f"MOTION\nFrames: {len(degrees)}\nFrame Time: {1.0 / body.motion.fps:.8f}\n")
        columns = [
            values[:, bone]
            for bone in order
            for values in ((CM_PER_M * places, degrees) if moving[bone] else (degrees,))
        ]
        for numbers in np.hstack(columns):
            file.write(" ".join(f"{number:.5f}" for number in numbers) + "\n")


def _without_gaps(body: RiggedMotion) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotations (F, B, 3, 3) of bones and their joints (F, B, 3) relative to the bones above them,
    of every frame from the first to the last pose.
    """
    rotations, places = body.local()
    known, frames = body.motion.frames, every_frame(body.motion)
    if len(frames) > len(known):
        flat = places.reshape(len(places), -1)
        between = np.column_stack([np.interp(frames, known, column) for column in flat.T])
        places = between.reshape(-1, *places.shape[1:])
        slerped = [
            Slerp(known, Rotation.from_matrix(turns))(frames).as_matrix()
            for turns in np.swapaxes(rotations, 0, 1)
        ]
        rotations = np.stack(slerped, axis=1)
    return rotations, places


def _write_joint(
    file: TextIO, body: RiggedMotion, moving: NDArray[np.bool_], bone: int, depth: int
) -> list[int]:
    """Writes a joint and those that it carries; returns their bones in the file's order."""
    pad, order = "  " * depth, [bone]
    parent, names = body.parents[bone], ascii_names(body.names)
    offset = np.zeros(3) if parent < 0 else body.rest_m[bone] - body.rest_m[parent]
    file.write(f"{pad}{'ROOT' if parent < 0 else 'JOINT'} {names[bone]}\n{pad}{{\n")
    file.write(f"{pad}  OFFSET {_numbers(offset)}\n")
    channels = "6 Xposition Yposition Zposition " if moving[bone] else "3 "
    file.write(f"{pad}  CHANNELS {channels}Zrotation Xrotation Yrotation\n")
    for child in np.flatnonzero(body.parents == bone).tolist():
        order += _write_joint(file, body, moving, child, depth + 1)
    if len(order) == 1:
        end = _numbers(body.ends_m[bone] - body.rest_m[bone])
        file.write(f"{pad}  End Site\n{pad}  {{\n{pad}    OFFSET {end}\n{pad}  }}\n")
    file.write(f"{pad}}}\n")
    return order


def _numbers(vector_m: NDArray[np.float64]) -> str:
    return " ".join(f"{number:.5f}" for number in CM_PER_M * vector_m)
