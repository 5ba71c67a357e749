import numpy as np

from tests.kernel_examples import Example
from tests.kernel_examples.bodies import DOF_PART, PARENTS, rotations, skinned

PARTS, DOFS = len(PARENTS), len(DOF_PART)


def directions(rng, count):
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def match_contours(rng):
    center = directions(rng, 3) * 3
    camera = np.sort(rng.integers(0, 3, 40, np.int32))
    target = 0.6 * directions(rng, 40)
    ray = target - center[camera]
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    normal = directions(rng, 40)
    points, normals = (directions(rng, 400).reshape(2, 200, 3) for _ in range(2))
    filled = np.empty((2, 40), np.int64), np.empty((2, 40))
    reach = np.array([0.3, 0.1])
    arguments = camera, center, ray, normal, 0.6 * points, normals, reach, *filled
    return Example(arguments, atol=1e-12)


def measure_outside(rng):
    outside = rng.uniform(0, 5, (30, 40)).astype(np.float32)
    points = rng.uniform(-1, 1, (2, 60, 3)) + np.array([0, 0, 2])
    placement = rotations(rng, 1)[0] * 0.2 + 0.8 * np.eye(3), rng.normal(size=3) * 0.1
    intrinsics = np.array([30.0, 31.0, 19.5, 14.5])
    filled = np.empty((2, 60)), np.zeros((2, 60, 3))
    return Example((points, intrinsics, *placement, outside, *filled), rtol=1e-5, atol=1e-5)


def pose_surfaces(rng):
    rest, parts, weights = skinned(rng, 20)
    joints = rng.normal(size=(PARTS, 3))
    placed = rotations(rng, 2 * PARTS).reshape(2, PARTS, 3, 3), rng.normal(size=(2, PARTS, 3))
    filled = np.empty((2, 20, 3)), np.empty((2, 20, 3))
    arguments = rest, directions(rng, 20), joints, parts, weights, *placed, *filled
    return Example(arguments, atol=1e-12)


def add_silhouette_terms(rng):
    rest, parts, weights = skinned(rng, 20)
    joints = rng.normal(size=(PARTS, 3))
    placed = rotations(rng, 3 * PARTS).reshape(3, PARTS, 3, 3), rng.normal(size=(3, PARTS, 3))
    descends = rng.random((PARTS, PARTS)) < 0.5
    contour = rng.integers(-1, 20, (3, 30)), 0.1 * rng.normal(size=(3, 30)), directions(rng, 30)
    outside = np.maximum(rng.normal(size=(3, 2, 20)), 0), rng.normal(size=(3, 2, 20, 3))
    size = 6 + DOFS
    filled = np.zeros((3, size, size)), rng.normal(size=(3, size))
    return Example(
        (
            contour,
            outside,
            np.array([[0.1, 2.0, 1.0], [0.1, 0.0, 0.0], [0.2, 3.0, 0.5]]),
            0.15,
            (rest, joints, parts, weights, descends, DOF_PART),
            (*placed, rng.normal(size=(3, DOFS, 3))),
            *filled,
        ),
        atol=1e-11,
    )


def fill_jacobian(rng):
    rest, parts, weights = skinned(rng, 20)
    placed = rotations(rng, PARTS), rng.normal(size=(PARTS, 3))
    joints = rng.normal(size=(PARTS, 3))
    descends = rng.random((PARTS, PARTS)) < 0.5
    rows = np.empty((30, 6 + DOFS))
    index = rng.integers(0, 20, 30), directions(rng, 30)
    body = rest, joints, parts, weights, *placed, descends, DOF_PART, rng.normal(size=(DOFS, 3))
    return Example((*index, *body, rows), atol=1e-12)


def fill_shape_jacobian(rng):
    _, parts, weights = skinned(rng, 20)
    index = rng.integers(0, 20, 30), directions(rng, 30)
    changes = (rng.normal(size=shape) for shape in ((20, 4, 3), (4, PARTS, 3), (4, PARTS, 3)))
    arguments = *index, parts, weights, rotations(rng, PARTS), *changes, np.empty((30, 4))
    return Example(arguments, atol=1e-12)


def add_normal_equations(rng):
    rows = rng.normal(size=(30, 9)) * (rng.random((30, 9)) < 0.5)
    filled = np.eye(9), rng.normal(size=9)
    return Example((rows, rng.uniform(0, 2, 30), rng.normal(size=30), *filled), atol=1e-12)


def poses(rng, count):
    """Roots, rotations and angles."""
    return rng.normal(size=(count, 3)), rotations(rng, count), rng.uniform(-1, 1, (count, DOFS))


def add_pose_terms(rng):
    size = 6 + DOFS
    precision = rng.uniform(0, 2, (3, size)) * np.array([[1], [0], [1]])
    usual = rng.uniform(0, 1, (3, DOFS)), rng.normal(size=DOFS)
    filled = np.zeros((3, size, size)), rng.normal(size=(3, size))
    arguments = poses(rng, 3), poses(rng, 3), precision, usual, *filled
    return Example(arguments, atol=1e-11)


def add_landmark_terms(rng):
    marks, size = 6, 6 + DOFS
    spread = rng.normal(size=(3, marks + 1, 3, 3))
    inverse = spread @ np.swapaxes(spread, 2, 3)
    part = rng.integers(0, PARTS, marks, np.int32)
    body = part, rng.normal(size=(marks, 3)), rng.random((PARTS, PARTS)) < 0.5, DOF_PART
    placed = (
        rotations(rng, 3 * PARTS).reshape(3, PARTS, 3, 3),
        rng.normal(size=(3, PARTS, 3)),
        rng.normal(size=(3, DOFS, 3)),
    )
    means = rng.normal(size=(3, marks, 3)), inverse[:, 1:].copy(), rng.normal(size=(3, 3))
    prior = np.array([True, False, True]), *means, inverse[:, 0].copy()
    filled = np.zeros((3, size, size)), rng.normal(size=(3, size))
    return Example((body, placed, prior, 4.0, *filled), atol=1e-10)


def bounded_steps(rng):
    spread = rng.normal(size=(3, 8, 8))
    matrix = spread @ np.swapaxes(spread, 1, 2) + 2 * np.eye(8)
    low, high = np.full((3, 8), -0.3), np.full((3, 8), 0.4)
    free = np.array([0, 1, 3, 4, 6, 7])
    return Example((matrix, rng.normal(size=(3, 8)), free, low, high, np.empty((3, 8))), atol=1e-10)


def move_poses(rng):
    steps = 0.4 * rng.normal(size=(3, 6 + DOFS))
    return Example((steps, np.tile([-0.9, 0.8], (DOFS, 1)), *poses(rng, 3)), atol=1e-12)
