"""Prior on bone lengths from published anthropometry, for the pictorial structure (paper, section 3.3).

The paper learns its prior from Human3.6M, and its released numbers come from the test sets. This one is measured on
neither, nor on any simulated population:

- limbs and trunk between joint centres: de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters",
  J. Biomechanics 29(9), 1996, table 4, women and men averaged as fractions of stature;
- stature 1.70 m, deviation 5.5 % over adults of both sexes: NCD-RisC, "A century of trends in adult human height",
  eLife 5:e13410, 2016;
- shoulder span: biacromial breadth of ANSUR II (Gordon et al. 2014, 0.39 m) less the two distances from acromion to
  joint centre;
- head: ANSUR II (interpupillary and bitragion breadths, tragion to nose) and Drillis & Contini's segment heights.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit

from mvpose.arrays import Floats
from mvpose.skeleton import Skeleton

STATURE = 1.70  # metres
STATURE_DEVIATION = 0.055
"""Deviation of the stature of adults, as a share of it: all bones of a person together."""
PROPORTION_DEVIATION = 0.04
"""Deviation of a bone among adults of one stature, as a share of its length."""

_OUTLIER = 9.0  # squared deviations at which a bone's say is halved
_ROUNDS = 3

# Mean length in metres and the deviation, in metres, of what detectors call the joint from the joint centre.
# fmt: off
_BONES: dict[frozenset[str], tuple[float, float]] = {
    frozenset({"shoulder", "elbow"}): (0.160 * STATURE, 0.02),
    frozenset({"elbow", "wrist"}): (0.153 * STATURE, 0.02),
    frozenset({"hip", "knee"}): (0.228 * STATURE, 0.03),
    frozenset({"knee", "ankle"}): (0.249 * STATURE, 0.02),
    frozenset({"shoulder", "hip"}): (0.296 * STATURE, 0.04),   # the trunk, and half the difference of the two spans
    frozenset({"shoulder"}): (0.33, 0.03),
    frozenset({"nose", "shoulder"}): (0.26, 0.05),             # the head turns: the widest deviation of all
    frozenset({"nose", "eye"}): (0.057, 0.01),
    frozenset({"eye", "ear"}): (0.095, 0.015),
    frozenset({"shoulder", "head_bottom"}): (0.21, 0.04),
    frozenset({"head_bottom", "head_top"}): (0.25, 0.04),
}
# fmt: on


class Bones(NamedTuple):
    """The bone from every joint to its parent.

    Attributes:
        length: mean over adults, (J,), metres; 0 where nothing is published, and at the root.
        definition: deviation, in metres, of what detectors call the joints from the joint centres, (J,); infinite
            where nothing is published, and at the root.
    """

    length: Floats
    definition: Floats


@cache
def bones(skeleton: Skeleton) -> Bones:
    """The published bones of a skeleton."""
    length, definition = np.zeros(len(skeleton)), np.full(len(skeleton), np.inf)
    for parent, child in skeleton.edges:
        ends = frozenset((skeleton.parts[parent], skeleton.parts[child]))
        if ends in _BONES:
            length[child], definition[child] = _BONES[ends]
    return Bones(length, definition)


def bone_lengths(skeleton: Skeleton) -> tuple[Floats, Floats]:
    """Mean and standard deviation of the bone from every joint to its parent, over adults.

    Returns:
        Means (J,) and deviations (J,), metres. A bone without a published length, and the root, has an infinite
        deviation: it constrains nothing.
    """
    length, definition = bones(skeleton)
    return length, np.hypot(np.hypot(STATURE_DEVIATION, PROPORTION_DEVIATION) * length, definition)


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
