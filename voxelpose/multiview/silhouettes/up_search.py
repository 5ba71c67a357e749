"""Which way is up, by how the cameras stand and, where that leaves a doubt, by the person."""

from collections.abc import Callable

import numpy as np

from calib.camera import Rig
from calib.checks import FloatArray
from calib.errors import InputError
from calib.moments import even_moments
from calib.upright import (
    AXES,
    Z_UP,
    UprightFrame,
    axis_name,
    cameras_worth,
    is_cameras_own,
    up_candidates,
)
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.estimator import Settings
from silhouette_core.progress import Reporter
from silhouette_core.ranking import rounded
from silhouette_core.tuning import MEASURING
from voxelpose.multiview.carving.observe import HullObserver
from voxelpose.multiview.proposers.pose_search import BodyGeometry, find_pose
from voxelpose.multiview.silhouettes.mask_store import MaskStore
from voxelpose.multiview.tuning import UP_SEARCH

_MOMENTS = 3
_PLACEMENTS = 3


def choose_upright(
    rig: Rig,
    settings: Settings,
    masks: MaskStore,
    observer_of: Callable[[Rig], HullObserver],
    reporter: Reporter,
    *,
    person: bool = True,
) -> UprightFrame:
    """The upright frame of a calibration's world, floor at the world's origin.

    Up is what the settings state. Else it is z where the cameras stand upright, or nearly so, in a
    world with z up. Where they do not, poses are searched at some moments in each of the worlds
    that are possible, and the trunks of those that explain the silhouettes best decide; a person
    who lies decides nothing, and the cameras do.

    Args:
        rig: pinhole cameras of the silhouettes, in the calibration's world.
        settings: for the body, and for up where it is stated.
        masks: silhouettes of every frame.
        observer_of: makes an observer for cameras of another world.
        reporter: told if up is not z.
        person: whether the body is a person, whose trunk may tell; else the cameras do.
    """
    if settings.up is not None:
        return UprightFrame.from_up(settings.up)
    possible = up_candidates(rig)
    from_camera = is_cameras_own(rig)
    if not from_camera and not any(up @ Z_UP > np.cos(np.radians(20)) for up in possible):
        possible.append(Z_UP)
    sure = from_camera or cameras_worth(rig, possible[0]) >= UP_SEARCH.sure
    if (sure and len(possible) == 1) or not person:
        up, reason = possible[0], "by how the cameras stand"
    else:
        reporter.stage("which way is up")
        trunk = _trunk(rig, settings, possible, masks, observer_of)
        # A body is found in a wrong world, too, if only with some luck: its trunk may tell what was
        # not searched.
        others = possible if from_camera else [*possible, *AXES.values()]
        up = max(others, key=lambda up: float(rounded(up @ trunk)))
        if up @ trunk < possible[0] @ trunk + UP_SEARCH.clearly:
            up = possible[0]
        reason = "by how the cameras and the person stand"
    if not np.array_equal(up, Z_UP):
        reporter.note(
            f"up is {axis_name(up)} of the calibration's world, {reason} (--up z keeps z; results"
            " stay in that world, exports are upright)"
        )
    return UprightFrame.from_up(up)


def _trunk(
    rig: Rig,
    settings: Settings,
    possible: list[FloatArray],
    masks: MaskStore,
    observer_of: Callable[[Rig], HullObserver],
) -> FloatArray:
    """Mean direction (3,) of the trunk in the calibration's world, at most of unit length: that of
    the best pose of each moment, in whichever world it was found.
    """
    sex = "male" if settings.sex == "unknown" else settings.sex
    sizes = BodySizes(settings.stature_m or MEASURING.usual_m, settings.chest_m, sex)
    model = BodyModel.from_sizes(sizes)
    moments = even_moments(len(masks), _MOMENTS)
    best: dict[int, tuple[float, FloatArray]] = {}
    for up in possible:
        frame = UprightFrame.from_up(up)
        observer = observer_of(frame.rig(rig))
        body = BodyGeometry.from_model(model, observer.voxel_size_m, settings.backend)
        for t in moments.tolist():
            try:
                observation = observer.observe(masks[t])
            except InputError:
                continue
            if observation is None:
                continue
            for fit in find_pose(body, observation, count=_PLACEMENTS)[:1]:
                trunk = fit.pose.root_rotation[:, 2] @ frame.rotation
                if t not in best or fit.error < best[t][0]:
                    best[t] = fit.error, trunk
    if not best:
        return np.zeros(3)
    return np.mean([trunk for _, trunk in best.values()], axis=0)
