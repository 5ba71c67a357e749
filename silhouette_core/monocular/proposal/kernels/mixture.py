"""Gradient of a mixture's likelihood, and steps of Adam.

Source: Bishop, Mixture density networks (1994), with Student's t in place of the Gaussian; Kingma
and Ba, Adam (2015), weight decay as in Loshchilov and Hutter (2019). Reference:
`tests.oracles.proposal`.
"""

from math import lgamma

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange
from silhouette_core.monocular.tuning import MIXTURE
from silhouette_core.tuning import REFINEMENT

FREEDOM, SIGMA = REFINEMENT.student_freedom, MIXTURE.sigma
JOINT_LOG_SIGMA, OFFSET_LOG_SIGMA = MIXTURE.joint_log_sigma, MIXTURE.offset_log_sigma
# Logarithms of the densities' constants for one dimension and for two.
_LOG_1 = lgamma((FREEDOM + 1) / 2) - lgamma(FREEDOM / 2) - np.log(FREEDOM * np.pi) / 2
_LOG_2 = lgamma((FREEDOM + 2) / 2) - lgamma(FREEDOM / 2) - np.log(FREEDOM * np.pi)


@kernel
def mixture_gradients(outputs, joints, offsets, mean, modes, share, gradients, likelihoods):
    """Fills gradients (N, O) of -log p with respect to a network's outputs (N, O), and likelihoods
    (N,), log p.

    p = sum_m pi_m prod_j t2(across) t1(along) prod_k t1(offset) for joints (N, J, 3) right, away
    and up, and offsets (N, 3). Outputs are the modes' joints less `mean` (J, 3), M * J * 3; the
    logarithms of their deviations across and along the line of sight, M * J * 2; M logits of pi;
    offsets, 3, and the logarithms of their deviations, 3. If share is above 0, the mode nearest to
    the joints is responsible for 1 - share and all modes equally for the rest.
    """
    count = joints.shape[1]
    first_sigma = modes * count * 3
    first_logit = modes * count * 5
    first_offset = modes * (count * 5 + 1)
    for n in range(len(outputs)):
        density, pi, part = np.empty(modes), np.empty(modes), np.empty(modes)
        # By mode and joint: error, precisions, and squared errors in deviations.
        terms = np.empty((modes, count, 7))
        nearest, nearest2 = 0, np.inf
        largest = -np.inf
        for m in range(modes):
            largest = max(largest, outputs[n, first_logit + m])
        total = 0.0
        for m in range(modes):
            pi[m] = np.exp(outputs[n, first_logit + m] - largest)
            total += pi[m]
        best = -np.inf
        for m in range(modes):
            pi[m] /= total
            sum_log, distance2 = count * (_LOG_2 + _LOG_1 - 3 * np.log(SIGMA)), 0.0
            for j in range(count):
                a, b = (m * count + j) * 3, first_sigma + (m * count + j) * 2
                x = outputs[n, a] + mean[j, 0] - joints[n, j, 0]
                y = outputs[n, a + 1] + mean[j, 1] - joints[n, j, 1]
                z = outputs[n, a + 2] + mean[j, 2] - joints[n, j, 2]
                across = min(max(outputs[n, b], JOINT_LOG_SIGMA[0]), JOINT_LOG_SIGMA[1])
                along = min(max(outputs[n, b + 1], JOINT_LOG_SIGMA[0]), JOINT_LOG_SIGMA[1])
                precision2 = np.exp(-2 * across) / SIGMA**2
                precision1 = np.exp(-2 * along) / SIGMA**2
                q2, q1 = (x * x + z * z) * precision2, y * y * precision1
                sum_log -= 2 * across + along
                sum_log -= (FREEDOM + 2) / 2 * np.log1p(q2 / FREEDOM)
                sum_log -= (FREEDOM + 1) / 2 * np.log1p(q1 / FREEDOM)
                distance2 += x * x + y * y + z * z
                terms[m, j, 0], terms[m, j, 1], terms[m, j, 2] = x, y, z
                terms[m, j, 3], terms[m, j, 4] = precision2, precision1
                terms[m, j, 5], terms[m, j, 6] = q2, q1
            if distance2 < nearest2:
                nearest, nearest2 = m, distance2
            density[m] = sum_log + np.log(max(pi[m], 1e-300))
            best = max(best, density[m])
        total = 0.0
        for m in range(modes):
            part[m] = np.exp(density[m] - best)
            total += part[m]
        likelihoods[n] = best + np.log(total)
        for m in range(modes):
            # Smaller parts are 0: arithmetic with denormal numbers is slow.
            part[m] = part[m] / total if part[m] > 1e-9 * total else 0.0
            if share > 0:
                part[m] = share / modes + (1 - share if m == nearest else 0.0)
            gradients[n, first_logit + m] = pi[m] - part[m]
            for j in range(count):
                a, b = (m * count + j) * 3, first_sigma + (m * count + j) * 2
                x, y, z = terms[m, j, 0], terms[m, j, 1], terms[m, j, 2]
                q2, q1 = terms[m, j, 5], terms[m, j, 6]
                weight2, weight1 = (FREEDOM + 2) / (FREEDOM + q2), (FREEDOM + 1) / (FREEDOM + q1)
                pull2, pull1 = weight2 * terms[m, j, 3], weight1 * terms[m, j, 4]
                gradients[n, a] = part[m] * pull2 * x
                gradients[n, a + 1] = part[m] * pull1 * y
                gradients[n, a + 2] = part[m] * pull2 * z
                for k in range(2):
                    slope = 2 - weight2 * q2 if k == 0 else 1 - weight1 * q1
                    raw = outputs[n, b + k]
                    # A deviation at its limit is not pushed outward, and may come back.
                    outward = (raw < JOINT_LOG_SIGMA[0] and slope > 0) or (
                        raw > JOINT_LOG_SIGMA[1] and slope < 0
                    )
                    gradients[n, b + k] = 0.0 if outward else part[m] * slope
        for k in range(3):
            raw = outputs[n, first_offset + 3 + k]
            log_sigma = min(max(raw, OFFSET_LOG_SIGMA[0]), OFFSET_LOG_SIGMA[1])
            error = outputs[n, first_offset + k] - offsets[n, k]
            precision1 = np.exp(-2 * log_sigma) / SIGMA**2
            q1 = error * error * precision1
            weight1 = (FREEDOM + 1) / (FREEDOM + q1)
            likelihoods[n] += _LOG_1 - log_sigma - np.log(SIGMA)
            likelihoods[n] -= (FREEDOM + 1) / 2 * np.log1p(q1 / FREEDOM)
            gradients[n, first_offset + k] = weight1 * precision1 * error
            slope = 1 - weight1 * q1
            outward = (raw < OFFSET_LOG_SIGMA[0] and slope > 0) or (
                raw > OFFSET_LOG_SIGMA[1] and slope < 0
            )
            gradients[n, first_offset + 3 + k] = 0.0 if outward else slope


@parallel_kernel
def adam_step(parameters, gradients, first, second, step, rate, decay, scale):
    """Moves parameters (K,) by one step of Adam along gradients (K,) times scale.

    Also updates the running moments first (K,) and second (K,). Steps count from 1; decay is the
    fraction of the parameters lost per unit of rate.
    """
    one, two = 1 / (1 - 0.9**step), 1 / (1 - 0.999**step)
    for k in prange(len(parameters)):
        gradient = gradients[k] * scale
        m = 0.9 * first[k] + 0.1 * gradient
        v = 0.999 * second[k] + 0.001 * gradient * gradient
        first[k], second[k] = m, v
        moved = parameters[k] - rate * (m * one) / (np.sqrt(v * two) + 1e-8)
        parameters[k] = moved * (1 - rate * decay)
