"""Limbs hang down the trunk: which of two depths a joint has that one view alone sees.

Along such a joint's ray a bone fits at two depths, and its length cannot tell which. How people hold themselves can:
upper arms, forearms, thighs and shanks point from the shoulders towards the hips more often than not. The direction of
a limb is von Mises-Fisher about the trunk's, without a word on which way is up, so somebody who lies is no exception.
The paper's prior knows lengths alone (section 3.3), and its released code places such joints by any depth.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.skeleton import Skeleton

# Nine clips of recorded motion (the CMU database's subjects 02 and 03: walk, run, jump, balance; dance and mime from
# elsewhere) have mean cosines of 0.98, 0.89, 0.72, 0.83 and 0.83, so concentrations of 50, 9, 4, 6 and 6. Half of the
# last four: those people sit and bend less than others. The trunk's own side matters where only the neck tells its
# direction (0.96, a concentration of 25, and a nose is not where the head is).
_CONCENTRATION: dict[tuple[str, str], float] = {
    ("shoulder", "hip"): 5.0,
    ("shoulder", "elbow"): 4.5,
    ("elbow", "wrist"): 2.0,
    ("hip", "knee"): 3.0,
    ("knee", "ankle"): 3.0,
}
_SEGMENTS = {"shoulder": 1, "hip": 2, "nose": 3, "eye": 3, "ear": 3, "head_top": 3}


@cache
def hang(skeleton: Skeleton) -> Floats:
    """Concentration of the direction from the parent to every joint about that down the trunk, (J,); 0: any will do."""
    concentration = np.zeros(len(skeleton))
    for parent, child in skeleton.edges:
        concentration[child] = _CONCENTRATION.get((skeleton.parts[parent], skeleton.parts[child]), 0.0)
    return concentration


@cache
def parts(skeleton: Skeleton) -> NDArray[np.int64]:
    """What tells the trunk's direction: 1 for the shoulders, 2 for the hips, 3 for the head, 0 for others, (J,)."""
    return np.array([_SEGMENTS.get(part, 0) for part in skeleton.parts], np.int64)


@njit(cache=True)
def down_the_trunk(states, count, parts, down):
    """Write the direction (3,) from the shoulders to the hips, or from the head to the shoulders; zeros if unknown.

    Args:
        states: of every joint, (J, S, 3), metres, the likeliest first.
        count: how many are valid, (J,).
        parts: from :func:`parts`.
        down: is written.
    """
    middle, placed = np.zeros((4, 3)), np.zeros(4)
    for j in range(len(parts)):
        if count[j] > 0:
            placed[parts[j]] += 1.0
            for r in range(3):
                middle[parts[j], r] += states[j, 0, r]
    upper, lower = (1, 2) if placed[2] > 0.0 else (3, 1)
    size = 0.0
    for r in range(3):
        down[r] = middle[lower, r] / max(placed[lower], 1.0) - middle[upper, r] / max(placed[upper], 1.0)
        size += down[r] ** 2
    known = placed[upper] > 0.0 and placed[lower] > 0.0 and size > 0.0
    for r in range(3):
        down[r] = down[r] / np.sqrt(size) if known else 0.0


@njit(cache=True)
def how_it_hangs(point, other, outward, concentration, down):
    """Log-likelihood of a bone's direction, but for a constant: at most 0.

    Args:
        point: one end, (3,).
        other: the other end, (3,).
        outward: whether the point is the child of the other.
        concentration: of the bone.
        down: the trunk's direction, (3,); zeros: unknown.
    """
    size, cosine = 0.0, 0.0
    for r in range(3):
        x = point[r] - other[r]
        size += x * x
        cosine += x * down[r]
    if concentration == 0.0 or size == 0.0 or (down[0] == 0.0 and down[1] == 0.0 and down[2] == 0.0):
        return 0.0
    cosine /= np.sqrt(size)
    return concentration * ((cosine if outward else -cosine) - 1.0)
