"""Library files from motion files."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from calib.storage.atomic import claimed
from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.making.learning_settings import LearningSettings
from silhouette_core.monocular.proposal.pose_proposal import PoseProposal
from silhouette_core.monocular.tree.base_poses import base_poses
from silhouette_core.monocular.tree.build import Checkpoint, build_library
from silhouette_core.monocular.tree.pose_library import LibrarySettings, PoseLibrary
from silhouette_core.monocular.tree.store import is_library, read_library, write_library
from silhouette_core.motion.mocap.load import load_motions, motion_files
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import motion_path, read_motion
from silhouette_core.progress import Reporter, SilentReporter

_USUAL = LearningSettings()


def read_clips(
    paths: Sequence[Path],
    model: BodyModel,
    names: Path | None = None,
    leave_out: Sequence[str] = (),
    reporter: Reporter | None = None,
) -> dict[str, Motion]:
    """Recorded motions by clip. Raises InputError where a clip to be skipped does not exist, or a
    file cannot be read.

    Args:
        paths: files and folders; of another body than a person's its own motions, each a result
            folder or a motion file of it.
        model: the body to which the motions are retargeted.
        names: joint-name map, see `silhouette_core.motion.mocap`.
        leave_out: clips to be skipped, by the file's name without its ending, or by the end of that
            name after an underscore.

    Returns:
        Motions by the file's name without its ending, with a number where two names are the same.
    """
    is_given = model.person is None
    files = [motion_path(path) for path in paths] if is_given else motion_files(paths)
    for name in leave_out:
        if not any(_has_name(file, name) for file in files):
            raise InputError(
                f"--leave-out {name}: no clip is called so; give a file's name without its ending"
            )
    files = [file for file in files if not any(_has_name(file, name) for name in leave_out)]
    if reporter is not None:
        reporter.stage("reading motion")
    motions = (
        [_motion_of(file, model) for file in files]
        if is_given
        else load_motions(files, model, names)
    )
    clips: dict[str, Motion] = {}
    for file, motion in zip(files, motions, strict=True):
        clips[file.stem if file.stem not in clips else f"{file.stem} ({len(clips)})"] = motion
    return clips


def _motion_of(file: Path, model: BodyModel) -> Motion:
    """Motion file of a body that is no person's."""
    motion = read_motion(file)
    if motion.model.tree.dof_names != model.tree.dof_names:
        raise InputError(
            f"{file} is the motion of a body with other joint angles: give motions of this one"
        )
    return replace(motion.upright(), model=model)


def _has_name(file: Path, name: str) -> bool:
    return file.stem == name or file.stem.endswith(f"_{name}")


def make_library(
    motions: Mapping[str, Motion],
    model: BodyModel,
    path: Path,
    settings: LibrarySettings,
    reporter: Reporter | None = None,
    learning: LearningSettings | None = _USUAL,
    begun: PoseProposal | None = None,
) -> PoseLibrary:
    """Builds and writes a library; an interrupted build resumes from the checkpoints in
    `path`.partial. Raises InputError where there is no motion, the file is no library or cannot be
    written, or another process is building it.

    Args:
        path: the library's file; an existing library is replaced once the new one is complete.
        learning: settings of the proposal that a person's library learns from the motion, of which
            `mirror` is that of the library; None: it has none.
        begun: proposal that goes on learning, see `learn_proposal`.

    Returns:
        The library, opened from its file.
    """
    reporter = reporter or SilentReporter()
    if model.person is None:
        settings, learning = replace(settings, mirror=False, weighting="xor"), None
    if learning is not None and find_spec("jax") is None:
        raise InputError(
            "a person's library is learned by JAX, which is not installed: pip install"
            " 'voxelpose[train]'"
        )
    if path.is_dir() or (path.exists() and not is_library(path)):
        raise InputError(
            f"{path} exists and is not a pose library, so it is not overwritten: give --out another"
            " name"
        )
    reporter.stage("choosing poses")
    bases = base_poses(motions, settings)
    reporter.note(
        f"{len(bases.angles)} of {bases.frames} poses are kept, {100 * bases.spacing_m:.0f} cm or"
        f" more apart in some joint; seen from {settings.views_count} sides each, they make"
        f" {len(bases.angles) * settings.views_count} samples"
    )
    partial = path.with_name(f"{path.name}.partial")
    with claimed(path):
        library = build_library(bases, model, settings, reporter, partial)
        if learning is not None:
            learning = replace(learning, mirror=settings.mirror)
            proposal = learned_from(motions, model, learning, partial / "proposal", reporter, begun)
            library = replace(library, proposal=proposal)
        write_library(library, path)
        Checkpoint.remove(partial)
    return read_library(path)


def motion_digest(motions: Mapping[str, Motion]) -> str:
    """SHA-256 of motions, hexadecimal."""
    digest = hashlib.sha256()
    for motion in motions.values():
        for array in (motion.root_m, motion.root_quaternion, motion.angles_rad, motion.time_s):
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def learned_from(
    motions: Mapping[str, Motion],
    model: BodyModel,
    settings: LearningSettings,
    partial: Path,
    reporter: Reporter,
    begun: PoseProposal | None = None,
) -> PoseProposal:
    """Proposal learned from all motion, with checkpoints in a folder of its encoding and of all of
    it; see `learn_proposal`.
    """
    from silhouette_core.monocular.making.proposal_learning import learn_proposal

    facts = json.dumps([asdict(settings), asdict(model.sizes), motion_digest(motions)])
    digest = hashlib.sha256(facts.encode())
    for array in begun.arrays().values() if begun is not None else ():
        digest.update(np.ascontiguousarray(array).tobytes())
    checkpoint = Checkpoint(partial, digest.hexdigest())

    def learned() -> Mapping[str, NDArray]:
        takes = list(motions.values())
        return learn_proposal(takes, model, settings, reporter, checkpoint.step, begun).arrays()

    return PoseProposal.from_arrays(checkpoint.step("proposal", learned))
