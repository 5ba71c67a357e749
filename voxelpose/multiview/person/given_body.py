"""Start of tracking with a given body of any kinematic tree."""

from __future__ import annotations

from dataclasses import replace

from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.estimator import Settings
from silhouette_core.progress import Reporter
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.still_root import still_root
from silhouette_core.scoring.backend import load_backend
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.matching.pose_search import SEARCHED, BodyGeometry, PoseFit, find_pose
from voxelpose.multiview.person.body_choice import anchor_frames, clear_fits
from voxelpose.multiview.silhouettes.observation_store import ObservationStore


def start_given(
    observations: ObservationStore,
    settings: Settings,
    matching: MatchSettings,
    reporter: Reporter,
    model: BodyModel,
) -> tuple[BodyGeometry, dict[int, PoseFit]]:
    """Searches anchor frames without a prior, with a body that stays as it is.

    A root that stands still is placed once, by all anchor frames together.

    Returns:
        The body, and the fits of the frames in which it explains the silhouettes nearly as well as
        in the best.

    Raises:
        InputError: no frame shows a body.
    """
    frames = anchor_frames(observations)
    reporter.stage("first poses", max(len(frames), 1))
    body = BodyGeometry.from_model(
        model, observations.observer.voxel_size_m, load_backend(settings.backend)
    )
    fits = _searched(body, frames, matching)
    if fits and model.tree.root_fixed:
        best = min(fits.values(), key=lambda fit: fit.error)
        fits = _searched(replace(body, root=best.pose), frames, matching)
        seen, poses = [frames[t].observation for t in fits], [fit.pose for fit in fits.values()]
        root = still_root(body.surface, seen, poses, SEARCHED)
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
    return body, clear_fits(fits)


def _searched(
    body: BodyGeometry, frames: dict[int, FrameObservation], matching: MatchSettings
) -> dict[int, PoseFit]:
    found = side_by_side(lambda frame: find_pose(body, frame, matching)[:1], list(frames.values()))
    return {t: fit for t, best in zip(frames, found, strict=True) for fit in best}
