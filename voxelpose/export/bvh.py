"""Biovision hierarchy (BVH): skeletal animation for Blender, Maya, MotionBuilder and others."""

from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from silhouette_core.body.model import BodyModel
from silhouette_core.motion.anatomical import continuous_degrees
from silhouette_core.motion.motion import Motion
from voxelpose.export.skeleton import (
    Y_UP_FROM_WORLD,
    ascii_names,
    every_frame,
    local_rotations,
    part_ends,
)

CM_PER_M = 100


def write_bvh(motion: Motion, path: Path) -> None:
    """Writes a motion of at least one pose as BVH.

    Axis map: x_bvh = x, y_bvh = z, z_bvh = -y of the upright frame; centimetres. With all rotations
    zero the skeleton stands in the model's rest pose (upright, arms 45 degrees down), facing +z.
    Every joint has Z, X and Y rotations in degrees, applied as R = Rz Rx Ry and continuous in time,
    as programs interpolate between frames; the root's position precedes them. The joints, 27 of a
    person, have the names of the body's parts; the last ones end in end sites. Importers that ask
    for axes (Blender): forward -Z, up Y, scale 0.01.

    Frames without a pose between the first and the last pose are interpolated, since BVH cannot
    contain gaps.
    """
    motion = motion.upright()
    local, root = _without_gaps(motion)
    degrees = continuous_degrees(local)
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("HIERARCHY\n")
        order = _write_joint(file, motion.model, part_ends(motion.model), 0, 0)
        file.write(f"MOTION\nFrames: {len(local)}\nFrame Time: {1.0 / motion.fps:.8f}\n")
        for frame in range(len(local)):
            numbers = [*root[frame], *degrees[frame, order].ravel()]
            file.write(" ".join(f"{number:.5f}" for number in numbers) + "\n")


def _without_gaps(motion: Motion) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotations (F, P, 3, 3) of parts relative to their parents and root positions (F, 3), cm, of
    every frame from the first to the last pose, BVH axes.
    """
    local, root, frames = local_rotations(motion), motion.parts()[1][:, 0], every_frame(motion)
    if len(frames) > len(motion):
        root = np.column_stack(
            [np.interp(frames, motion.frames, root[:, axis]) for axis in range(3)]
        )
        slerped = [
            Slerp(motion.frames, Rotation.from_matrix(rotations))(frames).as_matrix()
            for rotations in np.swapaxes(local, 0, 1)
        ]
        local = np.stack(slerped, axis=1)
    return Y_UP_FROM_WORLD @ local @ Y_UP_FROM_WORLD.T, CM_PER_M * root @ Y_UP_FROM_WORLD.T


def _write_joint(
    file: TextIO, model: BodyModel, ends: NDArray[np.float64], part: int, depth: int
) -> list[int]:
    """Writes a joint and those that it carries; returns their parts in the file's order."""
    pad, order = "  " * depth, [part]
    parent, names = model.tree.parents[part], ascii_names(model.names)
    offset = np.zeros(3) if parent < 0 else model.joints_m[part] - model.joints_m[parent]
    file.write(f"{pad}{'ROOT' if parent < 0 else 'JOINT'} {names[part]}\n{pad}{{\n")
    file.write(f"{pad}  OFFSET {_numbers(offset)}\n")
    channels = "6 Xposition Yposition Zposition " if parent < 0 else "3 "
    file.write(f"{pad}  CHANNELS {channels}Zrotation Xrotation Yrotation\n")
    for child in np.flatnonzero(model.tree.parents == part).tolist():
        order += _write_joint(file, model, ends, child, depth + 1)
    if len(order) == 1:
        end = _numbers(ends[part] - model.joints_m[part])
        file.write(f"{pad}  End Site\n{pad}  {{\n{pad}    OFFSET {end}\n{pad}  }}\n")
    file.write(f"{pad}}}\n")
    return order


def _numbers(vector_m: NDArray[np.float64]) -> str:
    return " ".join(f"{number:.5f}" for number in CM_PER_M * Y_UP_FROM_WORLD @ vector_m)
