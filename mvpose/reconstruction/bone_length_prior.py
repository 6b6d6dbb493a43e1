"""Prior on bone lengths, of the adult population or scaled to one person of any age (paper, section 3.3).

The paper learns its prior from Human3.6M, and the numbers in its released code come from the test sets. This prior is
taken from published anthropometry, and uses neither those data sets nor a simulated population:

- limbs and trunk between joint centres: de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters",
  J. Biomechanics 29(9), 1996, table 4, women and men averaged as fractions of stature;
- stature 1.70 m, standard deviation 5.5 % over adults of both sexes: NCD-RisC, "A century of trends in adult human
  height", eLife 5:e13410, 2016;
- children: a quarter of all people are younger than 15 years (United Nations, "World Population Prospects 2022"); they
  are 0.87 m tall at two years of age (WHO, "Child growth standards", 2006) and as tall as adults at the end;
- shoulder span: biacromial breadth of ANSUR II (Gordon et al. 2014, 0.39 m) minus the two distances from acromion to
  joint centre;
- hip span: hip centres lie 14 % of the distance of the anterior superior iliac spines inside of these (Bell, Pedersen &
  Brand, J. Biomechanics 23, 1990), which is 0.23 m (bispinous breadth, ANSUR II); detectors put hips further out;
- head: ANSUR II (interpupillary and bitragion breadths, tragion to nose) and Drillis & Contini's segment heights.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from mvpose.arrays import Floats
from mvpose.kernels import njit
from mvpose.reconstruction.bone_graph import bone_graph
from mvpose.skeleton import Skeleton

STATURE = 1.70  # metres
STATURE_DEVIATION = 0.055
"""Standard deviation of the stature of adults, as a fraction of it; common to all bones of a person."""
PROPORTION_DEVIATION = 0.04
"""Standard deviation of a bone length among adults of equal stature, as a fraction of the length."""

_CHILDREN = 0.25  # share of people who still grow
_SMALLEST, _TALLEST = 0.5, 1.25  # sizes of people by that of the mean adult: from two years of age to 2.1 m
_FEWEST = 5  # bones whose median ratio is where the search for a size begins
_OUTLIER = 9.0  # squared standardised residual at which the Cauchy weight of a bone is 1/2
_ROUNDS = 3  # of iteratively reweighted least squares

# Mean length, and standard deviation of the detectors' definition of the joints from the joint centres, in metres.
# fmt: off
_BONES: dict[frozenset[str], tuple[float, float]] = {
    frozenset({"shoulder", "elbow"}): (0.160 * STATURE, 0.02),
    frozenset({"elbow", "wrist"}): (0.153 * STATURE, 0.02),
    frozenset({"hip", "knee"}): (0.228 * STATURE, 0.03),
    frozenset({"knee", "ankle"}): (0.249 * STATURE, 0.02),
    frozenset({"shoulder", "hip"}): (0.296 * STATURE, 0.04),   # trunk, and half the difference of shoulder and hip span
    frozenset({"shoulder"}): (0.33, 0.03),
    frozenset({"hip"}): (0.19, 0.04),
    frozenset({"nose", "shoulder"}): (0.26, 0.05),             # the head turns: the widest deviation of all
    frozenset({"nose", "eye"}): (0.057, 0.01),
    frozenset({"eye", "ear"}): (0.095, 0.015),
    frozenset({"shoulder", "head_bottom"}): (0.21, 0.04),
    frozenset({"head_bottom", "head_top"}): (0.25, 0.04),
}
# fmt: on


class Bones(NamedTuple):
    """Published lengths of the bones of :func:`mvpose.reconstruction.bone_graph.bone_graph`."""

    length: Floats
    """Mean over adults, (B,), metres; 0 where no length is published, and for the bone of the root."""
    definition: Floats
    """Standard deviation of the length due to the detectors' definition of the joints, (B,), metres; infinite where no
    length is published, and for the bone of the root."""


@cache
def published_bones(skeleton: Skeleton) -> Bones:
    """Return the published bone lengths of a skeleton."""
    graph = bone_graph(skeleton)
    length, definition = np.zeros(len(graph.share)), np.full(len(graph.share), np.inf)
    for bone, (parent, child) in enumerate(zip(graph.parents, graph.children, strict=True)):
        ends = frozenset((skeleton.parts[parent], skeleton.parts[child]))
        if parent >= 0 and ends in _BONES:
            length[bone], definition[bone] = _BONES[ends]
    return Bones(length, definition)


def bone_lengths(skeleton: Skeleton) -> tuple[Floats, Floats]:
    """Return means and standard deviations, over adults, of the bone lengths.

    Returns:
        Means (B,) and standard deviations (B,), metres, of the bones of
        :func:`mvpose.reconstruction.bone_graph.bone_graph`. A bone without a published length, and that of the root,
        has an infinite deviation: it is not constrained.
    """
    length, definition = published_bones(skeleton)
    return length, np.hypot(np.hypot(STATURE_DEVIATION, PROPORTION_DEVIATION) * length, definition)


@njit(cache=True)
def personal_prior(states, count, weights, sigmas, graph, length, definition, personal):
    """Return mean bone lengths (B,), metres, and the precisions of their priors (B,), 1/m^2, for one person.

    Stature is a scale that all bones of a person share, and that the distances between the likeliest proposals measure.
    Its prior is a mixture: adults are Gaussian, and the logarithm of the scale of children is uniform, so that small
    people are not stretched to adults (expectation and maximisation, from the median ratio of the bones on). Long bones
    seen by many views weigh most, outliers weigh little (Cauchy weights). The deviation of each bone is then that of
    proportions combined with the posterior deviation of stature.

    Args:
        states: proposals (J, S, 3), metres, the likeliest first.
        count: number of valid proposals per joint, (J,).
        weights: scores in every view, (J, n, K).
        sigmas: standard deviation of each joint across a ray, (J,), metres.
        graph: bones of the skeleton, :class:`mvpose.reconstruction.bone_graph.BoneGraph`.
        length: mean bone lengths of the population, (B,), metres.
        definition: standard deviation due to the definition of the joints, (B,), metres; infinite for no prior.
        personal: whether to scale to the person; if not, the prior of the population is returned.
    """
    joints, n, _ = weights.shape
    bones = len(length)
    scale, deviation = 1.0, STATURE_DEVIATION
    if personal:
        views = np.zeros(joints)
        for j in range(joints):
            if count[j] > 0:
                for v in range(n):
                    views[j] += weights[j, v, 0] > 0.0
        scale = _first_scale(states, views, graph, length)
        for _ in range(_ROUNDS):
            adult = _adult(scale) / STATURE_DEVIATION**2
            weighted_sum, information = adult, adult
            for bone in range(bones):
                j, parent = graph.children[bone], graph.parents[bone]
                if parent < 0 or length[bone] == 0.0 or views[j] < 2 or views[parent] < 2:
                    continue
                d2 = 0.0
                for r in range(3):
                    d2 += (states[j, 0, r] - states[parent, 0, r]) ** 2
                measured = sigmas[j] ** 2 / (views[j] - 1) + sigmas[parent] ** 2 / (views[parent] - 1)
                variance = (PROPORTION_DEVIATION * length[bone]) ** 2 + definition[bone] ** 2 + measured
                residual = np.sqrt(d2) - scale * length[bone]
                weight = graph.share[bone] / (1.0 + residual * residual / (_OUTLIER * variance))
                weighted_sum += weight * length[bone] * np.sqrt(d2) / variance
                information += weight * length[bone] ** 2 / variance
            scale, deviation = weighted_sum / information, 1.0 / np.sqrt(information)
    scaled, precision = np.empty(bones), np.empty(bones)
    for bone in range(bones):
        scaled[bone] = scale * length[bone]
        variance = (deviation**2 + PROPORTION_DEVIATION**2) * length[bone] ** 2 + definition[bone] ** 2
        precision[bone] = graph.share[bone] / variance
    return scaled, precision


@njit(cache=True, borrows=True)
def _adult(scale):
    """Return the probability that a person of a scale is an adult."""
    residual = (scale - 1.0) / STATURE_DEVIATION
    adult = (1.0 - _CHILDREN) * np.exp(-0.5 * residual * residual) / (np.sqrt(2.0 * np.pi) * STATURE_DEVIATION)
    child = _CHILDREN / (max(scale, _SMALLEST) * np.log(1.0 / _SMALLEST))
    return adult / (adult + child) if scale < 1.0 else 1.0


@njit(cache=True)
def _first_scale(states, views, graph, length):
    """Return the median ratio of the lengths of bones, whose ends two views see, to their means; 1 for too few."""
    ratios, count = np.empty(len(length)), 0
    for bone in range(len(length)):
        j, parent = graph.children[bone], graph.parents[bone]
        if parent >= 0 and length[bone] > 0.0 and views[j] >= 2 and views[parent] >= 2:
            ratios[count] = np.sqrt(np.sum((states[j, 0] - states[parent, 0]) ** 2)) / length[bone]
            count += 1
    if count < _FEWEST:
        return 1.0
    return min(max(np.median(ratios[:count]), _SMALLEST), _TALLEST)
