"""Comparison of two measurements of one suite, seed by seed.

Every headline score of every variant, and its time, is compared over the whole suite and over each case alone. A
single case shows changes that the mean over the suite dilutes, for example a step that became quadratic in the number
of people. A change counts if its mean is larger than the tolerance *and* it is significant: a paired, one-sided
sign-flip test with Holm's correction over all tests that are made. The test is exact for its hypothesis, that a change
does no more than another draw of the noise: scores before and after have one distribution then, and their differences
are symmetrical.

The cases are conditions of the same scenes: a change that helps at a seed in one case tends to help at that seed in the
other cases, so trials of one seed are not independent. The whole suite is therefore compared by seed: before and after
are means over the cases that have the score in both measurements at that seed.

A test is made where the mean absolute difference exceeds the tolerance; no other change could count. Given the absolute
differences, the test depends on their signs alone, so this selection does not change its level. A change of one case
makes few tests, because unchanged trials have the difference zero.

Number of seeds: n seeds that all get worse have p = 2^-n, times the number of tests. One test alone needs 5 seeds at
level 0.05; a suite with fewer is refused, because it could not find any regression. With v variants and c cases at most
7 v (1 + c) tests are made, 7 v where there are no cases. A bug that changes everything makes all of them: it is found
from 8 seeds without cases, from 9 with two cases, and from 12 with eleven cases and two variants (168 tests,
168 / 4096 = 0.041). A loss beyond its tolerance that the number of seeds could not have shown to be significant is
``undecided``.

Time is compared by the logarithm of the ratio of each trial's time after and before, both in units of the reference
kernel. The middle half of a seed's ratios is used, because the machine may have been busy during a trial, and then the
middle half of the seeds: their geometric mean must exceed the allowed slow-down, and the seeds must be significant by
the same test.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from simharness.gate.baseline import TIME, Measurement
from simharness.gate.required_seeds import least_p
from simharness.gate.trial_command import TrialKey
from simharness.scenario.sections.gate import Gate
from simharness.scoring.catalogue import HEADLINE, SCORES
from simharness.statistics.bootstrap import block_weights, interval
from simharness.statistics.paired_tests import Alternative, holm, paired

Verdict = Literal["worse", "better", "same"]


@dataclass(frozen=True)
class Change:
    """Change of one score of one variant.

    Attributes:
        score: key of the score in the catalogue, or ``TIME``.
        variant: variant of the method.
        case: case; None for the whole suite.
        before, after: means over the seeds; for ``TIME``, geometric means of the middle half.
        difference: after - before; for ``TIME``, after / before.
        low, high: ends of the 95 % interval of the difference.
        n: number of seeds.
        p: p-value of a change in the observed direction after Holm's correction; 1 where no test was made.
        loss: size of the loss in tolerances; negative for a gain.
        verdict: worse, better or same.
        undecided: larger than its tolerance, but could not be significant even if all seeds agreed.
        worst: trial with the largest loss.
    """

    score: str
    variant: str
    case: str | None
    before: float
    after: float
    difference: float
    low: float
    high: float
    n: int
    p: float
    loss: float
    verdict: Verdict
    undecided: bool
    worst: TrialKey


@dataclass(frozen=True)
class Comparison:
    """Changes of a suite: scores of the whole suite, then of each case; then time in the same order.

    Attributes:
        changes: change of each score and of time, by variant, over the whole suite and, if there are several cases,
            over each case.
        cases: names of the cases; empty if there is only one.
    """

    changes: tuple[Change, ...]
    cases: tuple[str, ...]

    def with_verdict(self, verdict: Verdict) -> tuple[Change, ...]:
        """Return the changes with a verdict: those of the whole suite first, the largest first."""
        changes = (change for change in self.changes if change.verdict == verdict)
        return tuple(sorted(changes, key=lambda change: (change.case is not None, -abs(change.loss))))

    @property
    def undecided(self) -> tuple[Change, ...]:
        """Losses beyond their tolerances that may be chance: the seeds are too few to decide."""
        return tuple(change for change in self.changes if change.undecided and change.loss > 0)

    def changes_of(self, variant: str, case: str | None = None) -> tuple[Change, ...]:
        """Return the changes of a variant over the whole suite or one case."""
        return tuple(change for change in self.changes if (change.variant, change.case) == (variant, case))


@dataclass(frozen=True)
class _Tested:
    """Change without a verdict; its p-value is one-sided in the direction of the change, and not corrected."""

    change: Change
    made: bool  # whether the test is made, and so counts in Holm's correction


def compare(before: Measurement, after: Measurement, gate: Gate) -> Comparison:
    """Compare two measurements of one suite.

    Trials that only one of them has, because they failed in the other, are left out; the caller reports them.

    Args:
        before: the baseline.
        after: the new measurement.
        gate: tolerances and level.
    """
    cases = before.cases if len(before.cases) > 1 else ()
    tested = list(_all_tests(before, after, gate, cases))
    worse, better = _corrected_p(tested, 1), _corrected_p(tested, -1)
    made = sum(each.made for each in tested)
    changes = []
    for each, p_worse, p_better in zip(tested, worse, better, strict=True):
        loss, p = each.change.loss, p_worse if each.change.loss > 0 else p_better
        verdict: Verdict = "same"
        if abs(loss) > 1 and p <= gate.level:
            verdict = "worse" if loss > 0 else "better"
        undecided = abs(loss) > 1 and verdict == "same" and made * least_p(each.change.n) > gate.level
        changes.append(replace(each.change, p=p, verdict=verdict, undecided=undecided))
    return Comparison(tuple(changes), cases)


def _all_tests(before: Measurement, after: Measurement, gate: Gate, cases: tuple[str, ...]) -> Iterator[_Tested]:
    for case in (None, *cases):
        for variant in before.variants:
            for score in HEADLINE:
                tested = _test(score, _pairs(score, variant, case, before, after), case, getattr(gate.tolerance, score))
                if tested is not None:
                    yield tested
    for case in (None, *cases):
        for variant in before.variants:
            tested = _test_time(_pairs(TIME, variant, case, before, after), case, math.log(gate.slowdown))
            if tested is not None:
                yield tested


@dataclass(frozen=True)
class _Pairs:
    """One score of a variant in the trials that have it in both measurements, (n,) each."""

    variant: str
    trials: tuple[TrialKey, ...]
    before: Floats
    after: Floats

    @property
    def seeds(self) -> tuple[NDArray[np.intp], ...]:
        """Indices of the trials of each seed. Trials of different seeds are independent."""
        seeds = np.array([trial.seed for trial in self.trials])
        return tuple(np.flatnonzero(seeds == seed) for seed in np.unique(seeds))


def _pairs(score: str, variant: str, case: str | None, before: Measurement, after: Measurement) -> _Pairs:
    values_by_trial = {
        trial: (old[score], new)
        for trial, old in before.scores.items()
        if trial.variant == variant and case in (None, trial.case)
        if old[score] is not None and (new := after.scores.get(trial, {}).get(score)) is not None
    }
    values = np.array(list(values_by_trial.values()), float).reshape(-1, 2)
    return _Pairs(variant, tuple(values_by_trial), values[:, 0], values[:, 1])


def _test(score: str, pairs: _Pairs, case: str | None, tolerance: float) -> _Tested | None:
    """Compare the means of a score; return None where no trial has it."""
    if not pairs.trials:
        return None
    bad = -1 if SCORES[score].better == "higher" else 1
    before, after = (np.array([each[at].mean() for at in pairs.seeds]) for each in (pairs.before, pairs.after))
    change = after - before
    test = paired(before, after, alternative=_alternative(change.sum()), symmetric=True)
    loss = bad * test.difference
    result = Change(
        score=score,
        variant=pairs.variant,
        case=case,
        before=float(before.mean()),
        after=float(after.mean()),
        difference=test.difference,
        low=test.low,
        high=test.high,
        n=test.n,
        p=test.p,
        loss=loss / tolerance if tolerance else math.copysign(math.inf, loss) if loss else 0.0,
        verdict="same",
        undecided=False,
        worst=pairs.trials[int(np.argmax(bad * (pairs.after - pairs.before)))],
    )
    return _Tested(result, bool(np.abs(change).mean() > tolerance))


def _test_time(pairs: _Pairs, case: str | None, tolerance: float) -> _Tested | None:
    """Compare times; ``tolerance`` is the largest allowed logarithm of their ratio."""
    if not pairs.trials:
        return None
    ratios = np.log(pairs.after / pairs.before)
    # Exchanging before and after leaves the middle half of a seed the same trials, as the sign-flip test requires.
    counted = [at[_middle(np.argsort(ratios[at], kind="stable"))] for at in pairs.seeds]
    before, after = (np.array([np.log(each[at]).mean() for at in counted]) for each in (pairs.before, pairs.after))
    change = after - before
    middle = _middle(np.argsort(change, kind="stable"))
    ratio = float(change[middle].mean())
    test = paired(before, after, alternative=_alternative(ratio), symmetric=True)
    low, high = _middle_ends(change)
    result = Change(
        score=TIME,
        variant=pairs.variant,
        case=case,
        before=math.exp(before[middle].mean()),
        after=math.exp(after[middle].mean()),
        difference=math.exp(ratio),
        low=math.exp(low),
        high=math.exp(high),
        n=test.n,
        p=test.p,
        loss=ratio / tolerance,
        verdict="same",
        undecided=False,
        worst=pairs.trials[int(np.argmax(ratios))],
    )
    return _Tested(result, bool(_middle(np.sort(np.abs(change))).mean() > tolerance))


def _middle(values: NDArray[Any]) -> NDArray[Any]:
    """Return the middle half of sorted values (..., n)."""
    cut = values.shape[-1] // 4
    return values[..., cut : values.shape[-1] - cut]


def _middle_ends(change: Floats) -> tuple[float, float]:
    """Return the 95 % interval over seeds of the mean of the middle half; NaN for fewer than two seeds."""
    if len(change) < 2:
        return math.nan, math.nan
    weights = block_weights(np.arange(len(change))).astype(int)
    drawn = np.stack([np.repeat(np.sort(change), row) for row in weights[:, np.argsort(change)]])
    low, high = interval(_middle(drawn).mean(axis=-1), blocks=len(change))
    return float(low), float(high)


def _alternative(change: float) -> Alternative:
    """Return the one-sided alternative in the direction of a change."""
    return "greater" if change > 0 else "less"


def _corrected_p(tested: Sequence[_Tested], side: int) -> list[float]:
    """Return p-values of losses (side 1) or gains (side -1) after Holm's correction; 1 where no test was made.

    Every test that was made counts in the correction; changes in the other direction count with p = 1.
    """
    made = [index for index, each in enumerate(tested) if each.made]
    p = [tested[index].change.p if side * tested[index].change.loss > 0 else 1.0 for index in made]
    corrected = [1.0] * len(tested)
    for index, value in zip(made, holm(p), strict=True):
        corrected[index] = value
    return corrected
