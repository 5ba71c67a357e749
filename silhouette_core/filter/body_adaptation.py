"""The body of the person seen by one camera: build and sex from the clearest frames of a take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.filter.pose_modes import FrameModes
from silhouette_core.refinement.adaptation import Stature, adapt_shape, clothed_covariance
from silhouette_core.refinement.joint_placement import place_bodies
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.refinement.refine import RefineSettings
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.silhouette_error import silhouette_error

_FRAMES = 10
_STATURE_SIGMA_M = 0.008
_DECIMALS = 2  # of probabilities that are compared: the last digits are noise
_WEIGHTS = RefineSettings(contour_m=0.02, independence=0.15)
_POINTS = 500


def adapted_body(
    model: BodyModel,
    sexes: Sequence[str],
    views: PinholeViews,
    masks: Sequence[NDArray[np.bool_]],
    modes: Sequence[FrameModes],
) -> BodyModel:
    """Body adapted to the frames of a take in which one mode is the likeliest by far.

    Lengths and girths are estimated together with the poses of ten frames, under their prior; the
    depth of every joint is held by the proposal. Of the templates of both sexes the one is taken
    whose silhouettes fit better.

    Args:
        model: the body so far.
        sexes: "male", "female", or both.
        views: the camera.
        masks: T silhouettes (h, w) bool.
        modes: T frames' modes.
    """
    sure = np.round([frame.probability.max() for frame in modes], _DECIMALS)
    blocks = np.array_split(np.arange(len(modes)), min(_FRAMES, len(modes)))
    frames = [int(block[sure[block].argmax()]) for block in blocks]
    priors = [modes[t].priors[int(modes[t].probability.argmax())] for t in frames]
    observations = [Observation.from_masks(views, [masks[t]], modes[t].distance_m) for t in frames]
    found: list[tuple[float, BodyModel]] = []
    for sex in sexes:
        template = BodyModel.from_sizes(replace(model.sizes, sex=sex))
        surface = Surface(template, _POINTS)
        poses = place_bodies(surface, observations[0], priors)
        surface, poses = adapt_shape(
            surface,
            observations,
            poses,
            Stature(template.sizes.stature_m, _STATURE_SIGMA_M),
            template.shape,
            clothed_covariance(),
            _WEIGHTS,
            priors,
        )
        error = np.mean(
            [
                silhouette_error(surface.model, pose, observation)
                for pose, observation in zip(poses, observations, strict=True)
            ]
        )
        found.append((float(error), surface.model))
    return min(found, key=lambda one: one[0])[1]
