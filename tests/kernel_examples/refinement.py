import numpy as np

from tests.kernel_examples import Example
from tests.kernel_examples.bodies import DOF_PART, PARENTS, rotations, skinned

PARTS, DOFS = len(PARENTS), len(DOF_PART)


def directions(rng, count):
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def match_contours(rng):
    center = directions(rng, 3) * 3
    camera = rng.integers(0, 3, 40)
    target = 0.6 * directions(rng, 40)
    ray = target - center[camera]
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    normal = directions(rng, 40)
    points = 0.6 * directions(rng, 200)
    filled = np.empty(40, np.int64), np.empty(40)
    arguments = camera, center, ray, normal, points, directions(rng, 200), 0.3, *filled
    return Example(arguments, atol=1e-12)


def measure_outside(rng):
    outside = rng.uniform(0, 5, (30, 40)).astype(np.float32)
    points = rng.uniform(-1, 1, (60, 3)) + np.array([0, 0, 2])
    placement = rotations(rng, 1)[0] * 0.2 + 0.8 * np.eye(3), rng.normal(size=3) * 0.1
    intrinsics = np.array([30.0, 31.0, 19.5, 14.5])
    filled = np.empty(60), np.zeros((60, 3))
    return Example((points, intrinsics, *placement, outside, *filled), rtol=1e-5, atol=1e-5)


def pose_surface(rng):
    rest, parts, weights = skinned(rng, 20)
    joints = rng.normal(size=(PARTS, 3))
    placed = rotations(rng, PARTS), rng.normal(size=(PARTS, 3))
    filled = np.empty((20, 3)), np.empty((20, 3))
    arguments = rest, directions(rng, 20), joints, parts, weights, *placed, *filled
    return Example(arguments, atol=1e-12)


def fill_jacobian(rng):
    rest, parts, weights = skinned(rng, 20)
    placed = rotations(rng, PARTS), rng.normal(size=(PARTS, 3))
    joints = rng.normal(size=(PARTS, 3))
    descends = rng.random((PARTS, PARTS)) < 0.5
    rows = np.empty((30, 6 + DOFS))
    index = rng.integers(0, 20, 30), directions(rng, 30)
    body = rest, joints, parts, weights, *placed, descends, DOF_PART, rng.normal(size=(DOFS, 3))
    return Example((*index, *body, rows), atol=1e-12)


def add_normal_equations(rng):
    rows = rng.normal(size=(30, 9)) * (rng.random((30, 9)) < 0.5)
    filled = np.eye(9), rng.normal(size=9)
    return Example((rows, rng.uniform(0, 2, 30), rng.normal(size=30), *filled), atol=1e-12)
