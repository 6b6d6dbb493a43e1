"""Power of a suite: the change of each score that its seeds can show, and the seeds that a smaller one needs.

How much a change will differ between seeds is not known beforehand. It is taken to differ as much as the score itself.
A change that is alike in all seeds is found from its tolerance on, if there are enough seeds for the number of tests.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri, stdtrit

from mvpose.arrays import Floats
from simharness.gate.baseline import GATED, TIME, Measurement
from simharness.gate.score_tests import least_two_sided_p, pairs_of
from simharness.scenario.sections.gate_section import GateSection

POWER = 0.8
"""Probability with which a change is found."""

WISHED = (2, 4, 10)
"""Changes, in tolerances, for which the number of seeds is given: 1, 2 and 5 points of PCP by default."""

MOST = 1000
"""Largest number of seeds that is considered."""


@dataclass(frozen=True)
class Power:
    """What a suite shows of one score of one variant, in the unit of the score; for time in logarithms."""

    score: str
    """Key of the score, or ``TIME``."""
    variant: str
    """Variant of the method."""
    tolerance: float
    """Largest loss that fails nothing."""
    whole: float
    """Change of the mean over the whole suite that is found; infinite where the seeds are too few for any."""
    case: float
    """Change in one case alone that is found: median over the cases."""
    seeds: Mapping[int, int | None]
    """Seeds that changes of the whole suite need, by their size in tolerances; None: more than :data:`MOST`."""


def power_of(measurement: Measurement, gate: GateSection) -> list[Power]:
    """Return the power of a suite for each score and variant that it measured."""
    spreads: dict[tuple[str, str], list[tuple[bool, int, float]]] = {}
    for pairs in pairs_of((*GATED, TIME), measurement, measurement):
        values = replace(pairs, before=np.log(pairs.before)).means()[0] if pairs.score == TIME else pairs.means()[0]
        if len(values) > 1:
            each = pairs.case is None, len(values), float(values.std(ddof=1))
            spreads.setdefault((pairs.score, pairs.variant), []).append(each)
    found, level = [], _level(measurement, gate)
    for (score, variant), rows in spreads.items():
        limit = math.log(gate.slowdown) if score == TIME else gate.tolerance_of(score)
        (seeds, spread), *_ = [(n, size) for whole, n, size in rows if whole]
        single = [least_changes(n, size, limit, level) for whole, n, size in rows if not whole]
        needed = {wish: needed_seeds(wish * limit, spread, limit, level) for wish in WISHED}
        whole = float(least_changes(seeds, spread, limit, level))
        found.append(Power(score, variant, limit, whole, float(np.median(single)) if single else whole, needed))
    return found


def _level(measurement: Measurement, gate: GateSection) -> float:
    """Return the level of one test if all scores of all variants change, the others less clearly: Boole's inequality.

    It is the worst case, since scores that agree share it (:func:`simharness.statistics.many_tests.joint_p`). Of the
    cases, one changes alone.
    """
    scores = {key for scores in measurement.scores.values() for key in (*GATED, TIME) if scores[key] is not None}
    tests = len(measurement.variants) * len(scores) * (1 + (len(measurement.cases) > 1))
    return gate.level / max(tests, 1)


def even_changes(measurement: Measurement, gate: GateSection) -> str:
    """Return which changes that are alike in all seeds are found, in a sentence."""
    seeds, level = len({trial.seed for trial in measurement.scores}), _level(measurement, gate)
    if least_two_sided_p(seeds) <= level:
        return "A change that is alike in all seeds is shown from its tolerance on."
    enough = needed_seeds(1.0, 0.0, 0.0, level)
    more = f"{enough} seeds are enough" if enough else "choose a higher gate.level"
    return f"A change is shown only if most variants and scores show it, never one score among others: {more}."


def needed_seeds(change: float, spread: float, tolerance: float, level: float) -> int | None:
    """Return the least number of seeds with which a mean change is found; None: more than :data:`MOST`."""
    seeds = np.arange(2, MOST + 1)
    enough = np.flatnonzero(least_changes(seeds, spread, tolerance, level) <= change)
    return int(seeds[enough[0]]) if len(enough) else None


def least_changes(seeds: ArrayLike, spread: float, tolerance: float, level: float) -> Floats:
    """Return the mean changes (...) that are found with the probability :data:`POWER`: significant, above tolerance.

    Args:
        seeds: numbers of seeds, (...).
        spread: standard deviation of the change over seeds.
        tolerance: largest change that counts as none.
        level: level of one test; the change is infinite where no result of so few seeds is significant.
    """
    seeds = np.asarray(seeds)
    error, margin = spread / np.sqrt(seeds), float(ndtri(POWER))
    change = np.maximum((stdtrit(seeds - 1, 1 - level / 2) + margin) * error, tolerance + margin * error)
    possible = np.vectorize(least_two_sided_p)(seeds) <= level
    return np.where(possible, change, np.inf)


def power_rows(found: Iterable[Power]) -> list[tuple[str, ...]]:
    """Return rows of text: score, variant, changes that are found, and the seeds that :data:`WISHED` ones need."""
    from simharness.gate.gate_reports import difference_text, title

    def change(each: Power, size: float) -> str:
        if math.isinf(size):
            return "none"
        return difference_text(each.score, math.exp(size) if each.score == TIME else size).removeprefix("+")

    return [
        (
            title(each.score),
            each.variant,
            change(each, each.whole),
            change(each, each.case),
            *(
                f"{seeds or f'> {MOST}'} for {change(each, wish * each.tolerance)}"
                for wish, seeds in each.seeds.items()
            ),
        )
        for each in sorted(found, key=lambda each: list((*GATED, TIME)).index(each.score))
    ]
