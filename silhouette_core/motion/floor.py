"""The floor on which a moving body stands."""

import numpy as np

from calib.moments import even_moments
from silhouette_core.motion import kinematics
from silhouette_core.motion.motion import Motion
from silhouette_core.tuning import DYNAMICS

_MOST_FRAMES = 60


def floor_height(*motions: Motion) -> float:
    """Height of the floor, m, by the lowest points of bodies on it in a frame with z up, at least
    one pose of each; 0 where they stand within 0.1 m of z = 0.
    """
    lowest = []
    for motion in motions:
        some = motion.select(even_moments(len(motion), _MOST_FRAMES, margin=0))
        lowest += [
            float(kinematics.skin(motion.model, rotation, origin)[:, 2].min())
            for rotation, origin in zip(*some.parts(), strict=True)
        ]
    height = float(np.quantile(lowest, DYNAMICS.standing))
    return 0.0 if abs(height) < DYNAMICS.floor_m else height
