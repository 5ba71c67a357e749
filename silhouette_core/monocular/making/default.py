"""Default library, built from the project's own motions on first use and cached."""

from __future__ import annotations

import hashlib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from platformdirs import user_cache_path

from calib.atomic_folder import claimed
from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.monocular.making.from_motion import make_library
from silhouette_core.monocular.making.network_training import TrainingSettings
from silhouette_core.monocular.making.proposal_learning import LearningSettings
from silhouette_core.monocular.tree.pose_library import LibrarySettings, PoseLibrary
from silhouette_core.monocular.tree.store import VERSION, read_library
from silhouette_core.progress import Reporter, SilentReporter

SETTINGS = LibrarySettings(poses=24_000)
# A third of the usual takes, and a fifth of the encoders' samples: somebody waits for it. All takes
# are varied: there is little motion.
LEARNING = LearningSettings(
    takes=20, all_varied=True, encoding=TrainingSettings(steps=2_000, batch=128, units=512)
)


def default_library(
    sizes: BodySizes, reporter: Reporter | None = None, folder: Path | None = None
) -> PoseLibrary:
    """Default library of a body, built if it is not cached.

    Args:
        sizes: measurements of the body, rounded to 1 cm of stature and 2 cm of chest girth.
        reporter: informed of the build.
        folder: folder of the cached libraries; None: the user's cache.

    Returns:
        About 24,000 samples of the motions of `silhouette_core.motion.keyposes`.

    Raises:
        InputError: it cannot be written.
    """
    reporter = reporter or SilentReporter()
    chest = None if sizes.chest_girth_m is None else round(sizes.chest_girth_m / 0.02) * 0.02
    body = BodySizes(round(sizes.stature_m, 2), chest, sizes.sex)
    path = (folder or user_cache_path("voxelpose") / "libraries") / _name(body)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path.parent} cannot be made: {error.strerror or error}") from error
    library = _kept(path, reporter)
    if library is not None:
        return library

    def waiting() -> None:
        reporter.note("another process is making the pose library of this body: waiting for it")

    with claimed(path.with_name(f"{path.name}.first"), waiting):
        library = _kept(path, reporter)
        return _make(path, body, reporter) if library is None else library


def _kept(path: Path, reporter: Reporter) -> PoseLibrary | None:
    """The library of a file; None where there is none, or a damaged one, which is removed."""
    if not path.exists():
        return None
    try:
        return read_library(path)
    except InputError as error:
        reporter.note(f"{error}; it is made again")
        path.unlink(missing_ok=True)
        return None


def _make(path: Path, body: BodySizes, reporter: Reporter) -> PoseLibrary:
    reporter.note(
        "first use with this body: a pose library is made from the program's own motions and kept"
        " (a few minutes, once); voxelpose library build makes one from recorded motion"
    )
    from silhouette_core.motion.keyposes import keypose_motions

    model = BodyModel.from_sizes(body)
    motions = keypose_motions(model)
    return make_library(motions, model, path, SETTINGS, reporter, learning=LEARNING)


def _name(body: BodySizes) -> str:
    """File name with everything that determines the content."""
    try:
        program = version("voxelpose")
    except PackageNotFoundError:
        program = "unknown"
    chest = "usual" if body.chest_girth_m is None else f"{body.chest_girth_m:.2f}"
    settings = hashlib.sha256(repr((SETTINGS, LEARNING)).encode()).hexdigest()[:6]
    return f"default-{program}-{VERSION}-{settings}-{body.stature_m:.2f}-{chest}-{body.sex}.vplib"
