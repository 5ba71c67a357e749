"""Start of tracking with a given body of any kinematic tree, and the place of a root that stands
still.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.estimator import Settings
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import Reporter
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.refine import RefinedPose, free_unknowns, refine
from silhouette_core.scoring.backend import load_backend
from voxelpose.matching.matcher import MatchSettings
from voxelpose.matching.observation_store import ObservationStore
from voxelpose.matching.observe import FrameObservation
from voxelpose.matching.pose_search import SEARCHED, BodyGeometry, PoseFit, find_pose

_ANCHORS, _FRAMES_PER_ANCHOR = 5, 60
_CLEAR = 1.4  # an anchor is used where its error is below this many times the smallest one
_FAR_M = 0.15  # roots of single frames farther than this from their median do not count


def start_given(
    observations: ObservationStore,
    settings: Settings,
    matching: MatchSettings,
    reporter: Reporter,
    model: BodyModel,
) -> tuple[BodyGeometry, dict[int, PoseFit]]:
    """Searches anchor frames without a prior, with a body that stays as it is.

    A root that stands still is placed once, by all anchor frames together.

    Args:
        observations: of every frame.
        settings: for the backend.
        matching: settings of the full search.
        reporter: receives the progress.
        model: the body.

    Returns:
        The body, and the fits of the frames in which it explains the silhouettes nearly as well as
        in the best.

    Raises:
        InputError: no frame shows a body.
    """
    total = len(observations)
    count = min(total, max(_ANCHORS, total // _FRAMES_PER_ANCHOR))
    anchors = np.unique(np.round((np.arange(count) + 0.5) / count * (total - 1)).astype(int))
    frames = {t: frame for t in anchors.tolist() if (frame := observations.observe(t)) is not None}
    reporter.stage("first poses", max(len(frames), 1))
    body = BodyGeometry.from_model(
        model, observations.observer.voxel_size_m, load_backend(settings.backend)
    )
    fits = _searched(body, frames, matching)
    if fits and model.tree.root_fixed:
        best = min(fits.values(), key=lambda fit: fit.error)
        fits = _searched(replace(body, root=best.pose), frames, matching)
        root = still_root(body, [frames[t] for t in fits], [fit.pose for fit in fits.values()])
        body = replace(body, root=root)
        fits = _searched(body, frames, matching)
    reporter.advance(max(len(frames), 1))
    if not fits:
        raise InputError(
            "the silhouettes leave no hull in which the body is found: look at it with `voxelpose"
            " carve RECORDING --frame 0 --out hull.ply`, and check the background pictures, the"
            " calibration and the body's size"
        )
    for group in sorted({group for fit in fits.values() for group in fit.stopped}):
        reporter.note(
            f"the joint search of {', '.join(group)} stopped at its bound of memory or work: the"
            " best of what it had tried stands (larger voxels make it shorter)"
        )
    smallest = min(fit.error for fit in fits.values())
    return body, {t: fit for t, fit in fits.items() if fit.error <= _CLEAR * smallest}


def still_root(body: BodyGeometry, frames: list[FrameObservation], poses: list[Pose]) -> Pose:
    r"""Placement of a root that stands still, by several frames.

    Every frame is refined with its root free, and gives a root :math:`x_i` with the information
    :math:`S_i` that is left when its joint angles are free (the Schur complement of its normal
    equations). Together they give

    .. math:: x = \Bigl(\sum_i S_i\Bigr)^{-1} \sum_i S_i x_i

    Args:
        body: the body.
        frames: the frames.
        poses: of each, with about the same root.

    Source: textbook (information-weighted mean).
    """
    refined = side_by_side(
        lambda k: refine(body.surface, frames[k].observation, poses[k], None, SEARCHED),
        range(len(frames)),
    )
    places = np.array([one.pose.root_m for one in refined])
    near = np.linalg.norm(places - np.median(places, axis=0), axis=1) < _FAR_M
    refined = [one for one, kept in zip(refined, near, strict=True) if kept] or refined
    middle = refined[0].pose
    steps = np.array([one.pose.minus(middle)[:6] for one in refined])
    weights = np.array([_root_information(one, body.model) for one in refined])
    step = np.linalg.solve(weights.sum(0), np.einsum("kij,kj->i", weights, steps))
    turn = Rotation.from_rotvec(step[3:]).as_matrix()
    return Pose(middle.root_m + step[:3], turn @ middle.root_rotation, middle.angles_rad)


def _root_information(refined: RefinedPose, model: BodyModel) -> np.ndarray:
    free = free_unknowns(model)[6:]
    matrix = refined.normal_matrix
    across = matrix[:6, free]
    if not len(free):
        return matrix[:6, :6]
    return matrix[:6, :6] - across @ np.linalg.solve(matrix[np.ix_(free, free)], across.T)


def _searched(
    body: BodyGeometry, frames: dict[int, FrameObservation], matching: MatchSettings
) -> dict[int, PoseFit]:
    found = side_by_side(lambda frame: find_pose(body, frame, matching)[:1], list(frames.values()))
    return {t: fit for t, best in zip(frames, found, strict=True) for fit in best}
