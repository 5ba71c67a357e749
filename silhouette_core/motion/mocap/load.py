"""Motions of the body model from files and folders of recorded motion."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.motion.dynamics import FPS
from silhouette_core.motion.mocap.joint_frames import JointFrames, find_joint_frames
from silhouette_core.motion.mocap.read import SUFFIXES, read_clip
from silhouette_core.motion.mocap.retarget import retarget
from silhouette_core.motion.motion import Motion


def motion_files(paths: Iterable[Path]) -> list[Path]:
    """Motion files among files and folders, each once, those of a folder sorted by name.

    Folders are searched recursively; CSV files in them need skeleton.json.

    Raises:
        InputError: a path does not exist, or a folder holds no motion.
    """
    files: dict[Path, None] = {}
    for path in paths:
        if path.is_dir():
            inside = sorted(file for file in path.rglob("*") if _is_motion(file))
            if not inside:
                raise InputError(f"{path} holds no motion: no .bvh, and no .csv with skeleton.json")
            files.update(dict.fromkeys(inside))
        elif path.is_file():
            files[path] = None
        else:
            raise InputError(f"{path} does not exist")
    return list(files)


def _is_motion(file: Path) -> bool:
    return file.suffix.lower() in SUFFIXES and (
        file.suffix.lower() != ".csv" or file.with_name("skeleton.json").exists()
    )


def load_motions(
    paths: Sequence[Path], model: BodyModel, names: Path | None = None
) -> list[Motion]:
    """Recorded motions, one for each of `motion_files(paths)`, retargeted to a body; clips of one
    skeleton share the axes of its trunk.

    Recordings faster than `FPS` are reduced to it by taking the nearest frames.

    Args:
        names: joint-name map for all files; None chooses a shipped one for each.

    Raises:
        InputError: as `read_clip`.
    """
    clips = [read_clip(path, names).at_rate(FPS) for path in motion_files(paths)]
    best: dict[tuple, JointFrames] = {}
    for clip in clips:
        reference = find_joint_frames(clip)
        if clip.skeleton not in best or reference.doubt_deg < best[clip.skeleton].doubt_deg:
            best[clip.skeleton] = reference
    return [retarget(clip, model, best[clip.skeleton]) for clip in clips]
