"""The kernels of this folder in NumPy, as close to their definitions as can be: what tests compare
with. Each takes the arguments of the kernel of its name and fills the same arrays.
"""

import numpy as np
from scipy.special import logsumexp, softmax
from scipy.stats import multivariate_t, t

# The numbers of `mixture`, written out: what is imported from there would not be checked.
FREEDOM, SIGMA, LEAST_PART = 4.0, 0.05, 1e-9
JOINT_LOG_SIGMA, OFFSET_LOG_SIGMA = (-1.6, 2.2), (-2.0, 3.0)


def mixture_gradients(outputs, joints, offsets, mean, modes, share, gradients, likelihoods):
    """Densities of scipy; their derivatives by hand."""
    count = len(joints[0])
    ends = np.cumsum([modes * count * 3, modes * count * 2, modes, 3])
    places, deviations, logits, shift, spread = np.split(np.asarray(outputs, float), ends, axis=1)
    errors = places.reshape(-1, modes, count, 3) + mean - joints[:, None]
    raw = deviations.reshape(-1, modes, count, 2)
    sigma = SIGMA * np.exp(np.clip(raw, *JOINT_LOG_SIGMA))
    across = errors[..., [0, 2]] / sigma[..., :1]
    along = errors[..., 1] / sigma[..., 1]
    logs = multivariate_t.logpdf(across, df=FREEDOM, shape=np.eye(2))  # type: ignore[arg-type]
    logs = logs - 2 * np.log(sigma[..., 0]) + t.logpdf(along, FREEDOM) - np.log(sigma[..., 1])
    pi = softmax(logits, axis=1)
    density = logs.sum(-1) + np.log(pi)
    part = softmax(density, axis=1)
    part = np.where(part > LEAST_PART, part, 0.0)
    if share > 0:
        nearest = (errors**2).sum(axis=(2, 3)).argmin(axis=1)
        part = share / modes + (1 - share) * np.eye(modes)[nearest]
    weight = (FREEDOM + 2) / (FREEDOM + (across**2).sum(-1))
    weight1 = (FREEDOM + 1) / (FREEDOM + along**2)
    slope = np.stack([2 - weight * (across**2).sum(-1), 1 - weight1 * along**2], axis=-1)
    pull = np.stack(
        [
            weight * across[..., 0] / sigma[..., 0],
            weight1 * along / sigma[..., 1],
            weight * across[..., 1] / sigma[..., 0],
        ],
        axis=-1,
    )
    offset_sigma = SIGMA * np.exp(np.clip(spread, *OFFSET_LOG_SIGMA))
    off = (shift - offsets) / offset_sigma
    weight_off = (FREEDOM + 1) / (FREEDOM + off**2)
    likelihoods[:] = logsumexp(density, axis=1) + (
        t.logpdf(off, FREEDOM) - np.log(offset_sigma)
    ).sum(axis=1)
    rows = len(outputs)
    gradients[:] = np.concatenate(
        [
            (part[..., None, None] * pull).reshape(rows, -1),
            (part[..., None, None] * _inward(slope, raw, JOINT_LOG_SIGMA)).reshape(rows, -1),
            pi - part,
            weight_off * off / offset_sigma,
            _inward(1 - weight_off * off**2, spread, OFFSET_LOG_SIGMA),
        ],
        axis=1,
    )


def adam_step(parameters, gradients, first, second, step, rate, decay, scale):
    """The four lines of the paper, and decoupled decay."""
    first[:] = 0.9 * first + 0.1 * scale * gradients
    second[:] = 0.999 * second + 0.001 * (scale * gradients) ** 2
    corrected = first / (1 - 0.9**step), second / (1 - 0.999**step)
    parameters[:] = (parameters - rate * corrected[0] / (np.sqrt(corrected[1]) + 1e-8)) * (
        1 - rate * decay
    )


def _inward(slope, raw, limits):
    """Slopes, without those that push a value beyond its limits further out."""
    outward = ((raw < limits[0]) & (slope > 0)) | ((raw > limits[1]) & (slope < 0))
    return np.where(outward, 0.0, slope)
