"""The bone-length prior of one person: the population's, scaled to the stature that his well-seen bones tell."""

from __future__ import annotations

import numpy as np
from numba import njit

from mvpose.reconstruction.bones import PROPORTION_DEVIATION, STATURE_DEVIATION

_OUTLIER = 9.0  # squared deviations at which a bone's say is halved
_ROUNDS = 3


@njit(cache=True)
def personal_prior(states, count, weights, sigmas, parents, length, definition, personal):
    """Mean bone lengths (J,), metres, and their precisions (J,), 1/m^2, of one person.

    Stature is the one scale that all bones share: its posterior is Gaussian about the population's, from the lengths
    between the likeliest proposals, of which long bones with many views say most and misfits little (Cauchy weights).
    What is left for each bone is the deviation of proportions, and of stature as far as it is still in doubt.

    Args:
        states: proposals (J, S, 3), metres, the likeliest first.
        count: how many are valid, (J,).
        weights: scores in every view, (J, n, K).
        sigmas: deviation of each joint across a ray, (J,), metres.
        parents: the tree, (J,).
        length: of the population, (J,), metres.
        definition: deviation of what is called the joint, (J,), metres; infinite for no prior.
        personal: whether to scale; if not, this is the population's prior.
    """
    joints, n, _ = weights.shape
    scale, doubt = 1.0, STATURE_DEVIATION
    if personal:
        views = np.zeros(joints)
        for j in range(joints):
            if count[j] > 0:
                for v in range(n):
                    views[j] += weights[j, v, 0] > 0.0
        for _ in range(_ROUNDS):
            top, mass = 1.0 / STATURE_DEVIATION**2, 1.0 / STATURE_DEVIATION**2
            for j in range(joints):
                parent = parents[j]
                if parent < 0 or length[j] == 0.0 or views[j] < 2 or views[parent] < 2:
                    continue
                d2 = 0.0
                for r in range(3):
                    d2 += (states[j, 0, r] - states[parent, 0, r]) ** 2
                measured = sigmas[j] ** 2 / (views[j] - 1) + sigmas[parent] ** 2 / (views[parent] - 1)
                variance = (PROPORTION_DEVIATION * length[j]) ** 2 + definition[j] ** 2 + measured
                residual = np.sqrt(d2) - scale * length[j]
                weight = 1.0 / (1.0 + residual * residual / (_OUTLIER * variance))
                top += weight * length[j] * np.sqrt(d2) / variance
                mass += weight * length[j] ** 2 / variance
            scale, doubt = top / mass, 1.0 / np.sqrt(mass)
    own, precision = np.empty(joints), np.empty(joints)
    for j in range(joints):
        own[j] = scale * length[j]
        precision[j] = 1.0 / ((doubt**2 + PROPORTION_DEVIATION**2) * length[j] ** 2 + definition[j] ** 2)
    return own, precision
