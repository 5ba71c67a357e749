import numpy as np

from tests.kernel_examples import Example
from tests.kernel_examples.bodies import DOF_PART, PARENTS, rotations, skeleton, skinned

PARTS, DOFS = len(PARENTS), len(DOF_PART)


def posed(rng, *shape):
    """Body, root rotation and position, and angles of the given shape."""
    root = rotations(rng, 1)[0], rng.normal(size=3)
    return (*skeleton(rng), *root, rng.uniform(-1, 1, (*shape, DOFS)))


def exponential_map(rng):
    vector = rng.normal(size=3) * rng.choice([1e-5, 1.0, 3.0])
    return Example((vector, np.empty((3, 3)), np.empty((3, 3))), atol=1e-13)


def place_bodies(rng):
    roots = rotations(rng, 4), rng.normal(size=(4, 3))
    filled = np.empty((4, PARTS, 3, 3)), np.empty((4, PARTS, 3)), np.empty((4, DOFS, 3))
    return Example((*skeleton(rng), *roots, rng.uniform(-1, 1, (4, DOFS)), *filled), atol=1e-12)


def place_one_part(rng):
    return Example((*posed(rng, 6), 2, np.empty((6, 3, 3)), np.empty((6, 3))), atol=1e-12)


def skin_vertices(rng):
    vertices, parts, weights = skinned(rng, 20)
    placed = rotations(rng, PARTS), rng.normal(size=(PARTS, 3))
    joints = rng.normal(size=(PARTS, 3))
    return Example((vertices, joints, parts, weights, *placed, np.empty((20, 3))), atol=1e-12)


def solve_angles(rng):
    body = skeleton(rng)
    limits = np.tile([-0.8, 0.8], (DOFS, 1))
    roots = np.tile(np.eye(3), (4, 1, 1))
    part = np.array([2, 4])
    directions = np.tile(rng.normal(size=(2, 3)), (4, 1, 1)) + 0.05 * rng.normal(size=(4, 2, 3))
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    axes = directions[0] + 0.3 * rng.normal(size=(2, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    targets = part, axes, np.array([1.0, 0.5])
    return Example(
        (*body, limits, roots, targets, directions, 0.02, np.zeros((4, DOFS))), atol=2e-3
    )
