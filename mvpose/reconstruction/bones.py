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

from mvpose.arrays import Floats
from mvpose.skeleton import Skeleton

STATURE = 1.70  # metres
STATURE_DEVIATION = 0.055
"""Deviation of the stature of adults, as a share of it: all bones of a person together."""
PROPORTION_DEVIATION = 0.04
"""Deviation of a bone among adults of one stature, as a share of its length."""

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
