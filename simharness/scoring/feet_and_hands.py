"""Scores of feet and hands: the joints beyond COCO17 of people who are paired by their bodies."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.skeleton import Skeleton
from simharness.scoring.joint_errors import joint_errors
from simharness.scoring.pairing import placed_joints
from simharness.scoring.score_registry import finite_mean

LIMBS = {"feet": ("big_toe", "small_toe", "heel"), "hands": ("hand_",)}
"""Beginnings of the names, without the side, of the joints of each limb."""

WHOLE_BODY_MM = 50
"""Limit of PCK of feet and hands, mm."""

WHOLE_BODY_SCORES = tuple(f"{limb}_{kind}" for limb in LIMBS for kind in ("mm", "pck"))
"""Keys of the scores of feet and hands."""


@dataclass(frozen=True)
class WholeBodyInput:
    """True and estimated people of T frames on a skeleton with feet or hands."""

    skeleton: Skeleton
    """The skeleton of J joints."""
    truth: Floats
    """True joints, (T, P, J, 3), metres; NaN where undefined."""
    joints: Sequence[Floats]
    """Joints of the estimates of each frame, (n, J, 3), metres; NaN where missing."""


def whole_body_scores(given: WholeBodyInput | None, partner: Integers) -> dict[str, float | None]:
    """Return error and PCK of feet and hands; None without true joints of the limb.

    Args:
        given: people with feet and hands; None where there are none.
        partner: index of the estimate that is paired with each true person by the body, (T, P); -1 where missed.
    """
    scores: dict[str, float | None] = dict.fromkeys(WHOLE_BODY_SCORES)
    if given is None:
        return scores
    paired = [placed_joints(row, joints) for row, joints in zip(partner, given.joints, strict=True)]
    errors = 1000.0 * joint_errors(given.truth, paired)
    for limb in LIMBS:
        of_limb = errors[..., joints_of(given.skeleton, limb)]
        defined = of_limb[~np.isnan(of_limb)]
        if len(defined):
            scores[f"{limb}_mm"] = finite_mean(defined)
            scores[f"{limb}_pck"] = 100.0 * float(np.mean(defined <= WHOLE_BODY_MM))
    return scores


def joints_of(skeleton: Skeleton, limb: str) -> Bools:
    """Return which joints of a skeleton belong to a limb of :data:`LIMBS`, (J,)."""
    return np.array([part.startswith(LIMBS[limb]) for part in skeleton.parts])
