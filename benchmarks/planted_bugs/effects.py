"""Effects of bugs on the scores of the suite, with seeds that the suite does not have."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from simharness.gate.baseline import TIME, read_baseline
from simharness.statistics.many_tests import holm
from simharness.statistics.paired_tests import paired

_FIRST_SEED = 1000  # of the fresh seeds; those of the suite are smaller

WHOLE = "suite"
"""Name of the whole suite beside those of its cases."""

_LEVEL = 0.01
_DRAWS = 200_000  # of sign flips: the least p-value of hundreds of tests must stay far below the level when corrected

Scores = Mapping[tuple[str, int, str, str], float]
"""Scores by case, seed, variant and key of the score."""


@dataclass(frozen=True)
class Effect:
    """Effect of a bug on the scores.

    Attributes:
        identical: whether no score of any trial differs.
        clear: whether a mean of a score over the suite, or in one case, differs with p < 0.01 after Holm's correction.
        text: the change with the least p-value; of equals, that of the whole suite and of most standard errors.
        p: its corrected p-value.
        seeds: number of seeds.
    """

    identical: bool
    clear: bool
    text: str
    p: float
    seeds: int


def fresh_seeds(count: int) -> list[int]:
    """Return seeds that the suite does not have."""
    return list(range(_FIRST_SEED, _FIRST_SEED + count))


def read_scores(path: Path) -> dict[tuple[str, int, str, str], float]:
    """Return the scores in a baseline file, without running times and without scores that do not apply."""
    return {
        (trial.case, trial.seed, trial.variant, key): value
        for trial, scores in read_baseline(path).scores.items()
        for key, value in scores.items()
        if key != TIME and value is not None
    }


def effect(before: Scores, after: Scores) -> Effect:
    """Compare scores without and with a bug, seed by seed: means over the cases, and each case alone.

    Args:
        before: scores without the bug.
        after: scores with it; only its seeds are compared. A score that applies to one of them only is a difference,
            but is not tested.
    """
    seeds = {key[1] for key in after}
    before = {key: value for key, value in before.items() if key[1] in seeds}
    groups: dict[tuple[str, str, str], dict[int, list[float]]] = defaultdict(lambda: defaultdict(list))
    for (case, seed, variant, score), value in before.items():
        other = after.get((case, seed, variant, score))
        if other is not None:
            for place in (WHOLE, case):
                groups[place, variant, score][seed].append(other - value)
    if before == after:
        return Effect(True, False, "no score differs", 1.0, len(seeds))
    changes = {key: np.array([np.mean(each) for each in by_seed.values()]) for key, by_seed in groups.items()}
    differing = {key: each for key, each in changes.items() if each.any()}
    if not differing:
        return Effect(False, False, "scores apply to other trials", 1.0, len(seeds))
    results = {key: paired(np.zeros(len(each)), each, draws=_DRAWS) for key, each in differing.items()}
    corrected = dict(zip(results, holm([each.p for each in results.values()]), strict=True))
    best = min(results, key=lambda key: (corrected[key], key[0] != WHOLE, -_strength(differing[key])))
    place, variant, score = best
    found = results[best]
    text = f"{score} {found.difference:+.4g} ({found.low:+.4g} to {found.high:+.4g}), {variant}, {place}"
    return Effect(False, corrected[best] < _LEVEL, text, corrected[best], len(seeds))


def _strength(change: np.ndarray) -> float:
    """Return the mean over its standard error."""
    spread = float(change.std(ddof=1)) if len(change) > 1 else 0.0
    return abs(float(change.mean())) / spread * math.sqrt(len(change)) if spread else math.inf
