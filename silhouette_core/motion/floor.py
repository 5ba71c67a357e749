"""The floor on which a moving body stands."""

from __future__ import annotations

import numpy as np

from silhouette_core.motion import kinematics
from silhouette_core.motion.motion import Motion

_MOST_FRAMES = 60
_STANDING = 0.3  # quantile of the lowest points: jumps are above it, bad frames below
_EXPECTED_M = 0.1  # within which the floor is where the world says: feet are found less well


def floor_height(motion: Motion) -> float:
    """Height of the floor by the lowest points of the body.

    Args:
        motion: at least one pose, in a frame with z up.

    Returns:
        Metres; 0 where the body stands within 0.1 m of z = 0.
    """
    rows = np.linspace(0, len(motion) - 1, min(len(motion), _MOST_FRAMES)).round().astype(int)
    some = motion.select(np.unique(rows))
    lowest = [
        float(kinematics.skin(motion.model, rotation, origin)[:, 2].min())
        for rotation, origin in zip(*some.parts(), strict=True)
    ]
    height = float(np.quantile(lowest, _STANDING))
    return 0.0 if abs(height) < _EXPECTED_M else height
