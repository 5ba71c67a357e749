"""A small articulated body for the kernels that pose one."""

import numpy as np
from scipy.spatial.transform import Rotation

# The types are those of bodies, or kernels would be compiled once more for the examples.
PARENTS = np.array([-1, 0, 1, 0, 3], np.int32)
DOF_PART = np.array([0, 1, 1, 1, 2, 3, 3, 4], np.int32)


def skeleton(rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Returns parents (5,), joints (5, 3), the part (8,) and the unit axis (8, 3) of each angle."""
    axes = rng.normal(size=(len(DOF_PART), 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return PARENTS, rng.normal(size=(len(PARENTS), 3)), DOF_PART, axes


def rotations(rng: np.random.Generator, count: int) -> np.ndarray:
    return Rotation.random(count, random_state=rng).as_matrix()


def skinned(rng: np.random.Generator, count: int) -> tuple[np.ndarray, ...]:
    """Returns vertices (V, 3), the parts (V, 4) on which they hang, and their weights (V, 4)."""
    weights = rng.dirichlet(np.ones(4), count)
    weights[: count // 2, 2:] = 0
    weights /= weights.sum(axis=1, keepdims=True)
    parts = rng.permuted(np.tile(np.arange(len(PARENTS)), (count, 1)), axis=1)[:, :4]
    return rng.normal(size=(count, 3)), parts.astype(np.int32), weights
