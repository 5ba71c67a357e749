"""The body of the person seen by one camera: build and sex from the clearest frames of a take."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.checks import BoolArray, FloatArray
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import STATURES_M
from silhouette_core.monocular.tracking.pose_modes import FrameModes
from silhouette_core.monocular.tuning import ADAPTING
from silhouette_core.motion.pose import PoseArrays
from silhouette_core.ranking import rounded
from silhouette_core.refinement.adaptation import Stature, adapt_shape, clothed_covariance
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.refinement.proposed_poses import place_bodies
from silhouette_core.refinement.refine import RefineSettings
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.backend import Backend
from silhouette_core.scoring.silhouette_error import silhouette_error
from silhouette_core.tuning import DYNAMICS, TRAJECTORY

_DECIMALS = 2  # of probabilities that are compared: the last digits are noise
_WEIGHTS = RefineSettings(contour_m=ADAPTING.contour_m, independence=ADAPTING.independence)
_POINTS = 500
_FRAMES = 10  # to which a body is adapted


def adapted_body(
    model: BodyModel,
    sexes: Sequence[str],
    views: PinholeViews,
    masks: Sequence[BoolArray],
    modes: Sequence[FrameModes],
    backend: Backend,
) -> BodyModel:
    """Body adapted to the frames of a take in which one mode is the likeliest by far.

    Lengths and girths are estimated together with the poses of ten frames, under their prior; the
    depth of every joint is held by the proposal. Of the templates of both sexes the one is taken
    whose silhouettes fit better. Shoes and clothes make a silhouette taller than the stature, and
    so the person is put too near and above the floor: the body's stature is that with them, see
    `shod_scale`.

    Args:
        sexes: "male", "female", or both.
        masks: T silhouettes (h, w) bool.
        modes: T frames' modes.
    """
    sure = np.round([frame.probability.max() for frame in modes], _DECIMALS)
    blocks = np.array_split(np.arange(len(modes)), min(_FRAMES, len(modes)))
    frames = [int(block[sure[block].argmax()]) for block in blocks]
    priors = [modes[t].probable(1)[0] for t in frames]
    observations = [Observation.from_masks(views, [masks[t]], modes[t].distance_m) for t in frames]
    fitted: list[tuple[float, BodyModel, float]] = []
    for sex in sexes:
        template = BodyModel.from_sizes(replace(model.sizes, sex=sex))
        surface = Surface(template, _POINTS)
        poses = place_bodies(surface, observations[0], priors)
        surface, poses = adapt_shape(
            surface,
            observations,
            poses,
            Stature(template.sizes.stature_m, ADAPTING.stature_sigma_m),
            template.shape,
            clothed_covariance(),
            _WEIGHTS,
            priors,
        )
        errors = [
            silhouette_error(surface.model, pose, observation, backend)
            for pose, observation in zip(poses, observations, strict=True)
        ]
        posed = surface.posed_many(PoseArrays.from_poses(poses)).points
        scale = shod_scale(posed[..., 2].min(1), float(views.center_m[0, 2]))
        fitted.append((float(rounded(np.mean(errors))), surface.model, scale))
    _, body, scale = min(fitted, key=lambda one: one[0])
    return _grown(body, scale)


def shod_scale(lowest_m: FloatArray, camera_m: float) -> float:
    r"""Factor by which a person is taller than the body, from feet that hang above the floor.

    A person taller by the factor :math:`s` is put at :math:`1/s` of the distance, and what stands
    on the floor at the height :math:`h`, below a camera at the height :math:`c`:

    .. math:: h = c \Bigl(1 - \frac{1}{s}\Bigr), \qquad s = \frac{c}{c - h}

    This is weighed against the prior :math:`s \sim N(1, \sigma_s^2)` by the spread of the heights,
    which is large where the person jumps; and nobody is made smaller: who seems to sink has a foot
    in front of the other.

    Args:
        lowest_m: (T,) heights of the lowest points of the body in T frames, m.
        camera_m: height of the camera above the floor, m.

    Returns:
        The factor, 1 where z = 0 is not the floor or the camera is not clearly above it.

    Source: own; similar triangles.
    """
    near = np.abs(lowest_m) < DYNAMICS.floor_m
    if near.mean() < 0.5 or camera_m < 2 * DYNAMICS.floor_m:
        return 1.0
    quarter, middle, three_quarters = np.quantile(lowest_m, (0.25, 0.5, 0.75)).tolist()
    height_m = middle - ADAPTING.sole_m
    grown = camera_m / (camera_m - height_m) - 1
    variance = (TRAJECTORY.foot_m**2 + ((three_quarters - quarter) / 2) ** 2) / camera_m**2
    return 1 + max(0.0, ADAPTING.shod_sigma**2 / (ADAPTING.shod_sigma**2 + variance) * grown)


def _grown(model: BodyModel, factor: float) -> BodyModel:
    """The body, all lengths of it larger by a factor."""
    sizes = model.sizes
    chest_m = None if sizes.chest_girth_m is None else sizes.chest_girth_m * factor
    stature_m = min(sizes.stature_m * factor, STATURES_M[1])
    grown = replace(sizes, stature_m=stature_m, chest_girth_m=chest_m)
    return BodyModel.from_sizes(grown).reshaped(model.shape)
