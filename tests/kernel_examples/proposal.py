import numpy as np

from tests.kernel_examples import Example


def mixture_gradients(rng):
    count, modes, joints = 12, 4, 3
    outputs = rng.normal(size=(count, modes * (5 * joints + 1) + 6))
    outputs[:, : modes * joints * 3] *= 0.1
    outputs[:, modes * joints * 3 :] *= 1.5  # beyond the limits of the deviations as well
    truth = rng.normal(0, 0.1, (count, joints, 3)), rng.normal(0, 0.1, (count, 3))
    mean, share = rng.normal(0, 0.1, (joints, 3)), rng.choice([0.0, 0.2])
    filled = np.empty_like(outputs), np.empty(count)
    return Example((outputs, *truth, mean, modes, share, *filled), rtol=1e-9, atol=1e-12)


def adam_step(rng):
    moments = rng.normal(size=20), rng.uniform(0, 1, 20)
    settings = int(rng.integers(1, 5)), 0.01, 0.1, 0.7
    return Example((rng.normal(size=20), rng.normal(size=20), *moments, *settings), rtol=1e-12)
