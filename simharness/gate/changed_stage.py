"""Stage and joint group of a change, from the scores beside it."""

from collections.abc import Callable

import numpy as np

from simharness.gate.baseline import DETECTED, GROUP_SCORES, TIME, Measurement
from simharness.gate.score_tests import Pairs, pairs_in
from simharness.runtime.number_text import signed
from simharness.scoring.catalogue import SCORES, TOLERANCES

_PIXELS = 0.01  # of the mean coordinate of all keypoints
_ROUNDING = 0.01  # of the tolerance of match F1; between processors scores differ by less


def changed_stage(pairs: Pairs, before: Measurement, after: Measurement) -> str:
    """Return which stage changed first in the trials of a score, and which joints most; empty where that is unknown.

    The input of the method shows whether detection changed, and match F1 whether matching did; if neither did, it is
    reconstruction. The baseline of an earlier version does not tell detection from matching.
    """
    if pairs.score == TIME:
        return ""

    def beside(score: str) -> Pairs:
        return pairs_in(score, pairs.variant, pairs.case, before, after)

    return ", ".join(filter(None, (_stage(beside), _joints(beside))))


def _stage(beside: Callable[[str], Pairs]) -> str:
    detected, matched = beside(DETECTED), beside("match_f1")
    if _moved(detected) > _PIXELS:
        return "from detection on"
    if not matched.trials:
        return ""
    if _moved(matched) <= _ROUNDING * TOLERANCES["match_f1"]:
        return "in reconstruction"
    return "from matching on" if detected.trials else "from detection or matching on"


def _moved(pairs: Pairs) -> float:
    return float(np.abs(pairs.after - pairs.before).mean()) if pairs.trials else 0.0


def _joints(beside: Callable[[str], Pairs]) -> str:
    """Return the group of body parts whose PCP changed most."""
    changes = {score: (each.after - each.before).mean() for score in GROUP_SCORES if (each := beside(score)).trials}
    score = max(changes, key=lambda key: abs(changes[key]), default="")
    if not score or abs(changes[score]) < TOLERANCES["pcp"]:
        return ""
    return f"most in {SCORES[score].title} ({signed(float(changes[score]), 1)})"
