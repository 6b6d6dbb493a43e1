"""Is it worse? Two measurements of one suite, compared seed by seed.

Every headline score of every variant, and its time, is compared over the whole suite, and then over each case alone,
which sees what the whole dilutes: a step that became quadratic in people, say. A change counts where it is larger in
the mean than its tolerance *and* significant: a paired, one-sided sign-flip test, Holm's correction over all tests that
are made.

The cases are conditions of the same scenes: a change that helps at a seed in one case tends to help there in the
others, so trials of one seed are no independent evidence. The whole suite is therefore compared by seed: before and
after, each the mean over the cases that have the score on both sides at that seed.

Which tests are made: those of which the mean size of the differences, whatever their signs, exceeds the tolerance. No
other could be a change that counts; and as the test is of the signs alone, given the sizes, choosing by size takes
nothing from its level. A change to one case makes a handful of tests, for trials that did not change differ by nothing.

How small a suite may be: n seeds that all fall have p = 2^-n, times the number of tests. One test alone needs 5 seeds
at level 0.05; a suite with fewer is refused, for it could never find anything. Of v variants and c cases at most
7 v (1 + c) tests are made, 7 v where there are no cases, and a bug that changes everything makes them all: it is
found from 8 seeds without cases, from 9 with two cases, and from 12 with eleven cases and two variants (168 tests,
168 / 4096 = 0.041). A loss beyond its tolerance that so few seeds could not have shown to be one is ``undecided``.

Time is compared by the ratio of each trial's time in units of the reference kernel, now to before, in logarithms. Of
a seed's ratios the middle half counts, for a trial during which the machine was held up says nothing, and then the
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
    """How one score of one variant changed.

    Attributes:
        score: its key in the catalogue, or ``TIME``.
        variant: of the method.
        case: None for the whole suite.
        before, after: means over the seeds; of ``TIME``, geometric means of the middle half.
        difference: after - before with its 95 % interval; of ``TIME``, after / before.
        low, high: the interval's ends.
        n: how many seeds.
        p: of a change in the direction that it went, after Holm's correction; 1 where no test was made.
        loss: how much worse, in tolerances; negative where better.
        verdict: what it comes to.
        undecided: larger than its tolerance, but not even if all seeds agreed could it be significant.
        worst: the trial that lost most.
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
    """All changes of a suite: scores of the whole, then case by case; then time, likewise.

    Attributes:
        changes: of each score and of time, by variant, over the whole suite and, where there are several, each case.
        cases: the names of the cases, where there are several.
    """

    changes: tuple[Change, ...]
    cases: tuple[str, ...]

    def with_verdict(self, verdict: Verdict) -> tuple[Change, ...]:
        """Changes of a verdict: of the whole suite first, those that lost most first."""
        found = (change for change in self.changes if change.verdict == verdict)
        return tuple(sorted(found, key=lambda change: (change.case is not None, -abs(change.loss))))

    @property
    def undecided(self) -> tuple[Change, ...]:
        """Losses beyond their tolerances of which so few seeds cannot tell whether they are by chance."""
        return tuple(change for change in self.changes if change.undecided and change.loss > 0)

    def changes_of(self, variant: str, case: str | None = None) -> tuple[Change, ...]:
        """Changes of a variant over the whole suite or one case."""
        return tuple(change for change in self.changes if (change.variant, change.case) == (variant, case))


@dataclass(frozen=True)
class _Tested:
    """A change before its verdict: its p is that of its own side, uncorrected."""

    change: Change
    made: bool  # whether the test counts


def compare(before: Measurement, after: Measurement, gate: Gate) -> Comparison:
    """Compare two measurements of one suite.

    Trials that only one of them has (they failed) are left out: who asks must look after those.

    Args:
        before: the baseline.
        after: what was measured now.
        gate: tolerances and level.
    """
    cases = before.cases if len(before.cases) > 1 else ()
    tested = list(_all_tests(before, after, gate, cases))
    worse, better = _corrected(tested, 1), _corrected(tested, -1)
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
    """A score of a variant in the trials that have it in both measurements: (n,) each."""

    variant: str
    trials: tuple[TrialKey, ...]
    before: Floats
    after: Floats

    @property
    def seeds(self) -> tuple[NDArray[np.intp], ...]:
        """Which trials are of each seed: the pairs that are independent of each other."""
        seeds = np.array([trial.seed for trial in self.trials])
        return tuple(np.flatnonzero(seeds == seed) for seed in np.unique(seeds))


def _pairs(score: str, variant: str, case: str | None, before: Measurement, after: Measurement) -> _Pairs:
    found = {
        trial: (old[score], new)
        for trial, old in before.scores.items()
        if trial.variant == variant and case in (None, trial.case)
        if old[score] is not None and (new := after.scores.get(trial, {}).get(score)) is not None
    }
    values = np.array(list(found.values()), float).reshape(-1, 2)
    return _Pairs(variant, tuple(found), values[:, 0], values[:, 1])


def _test(score: str, pairs: _Pairs, case: str | None, tolerance: float) -> _Tested | None:
    """Compare means of a score; None where no trial has it."""
    if not pairs.trials:
        return None
    bad = -1 if SCORES[score].better == "higher" else 1
    before, after = (np.array([each[at].mean() for at in pairs.seeds]) for each in (pairs.before, pairs.after))
    change = after - before
    test = paired(before, after, alternative=_side(change.sum()))
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
    """Compare times; ``tolerance`` is of the logarithm of their ratio."""
    if not pairs.trials:
        return None
    ratios = np.log(pairs.after / pairs.before)
    # The middle half of a seed is the same trials with before and after exchanged: the test asks for no more.
    counted = [at[_middle(np.argsort(ratios[at], kind="stable"))] for at in pairs.seeds]
    before, after = (np.array([np.log(each[at]).mean() for at in counted]) for each in (pairs.before, pairs.after))
    change = after - before
    middle = _middle(np.argsort(change, kind="stable"))
    ratio = float(change[middle].mean())
    test = paired(before, after, alternative=_side(ratio))
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
    """The middle half of sorted values (..., n)."""
    cut = values.shape[-1] // 4
    return values[..., cut : values.shape[-1] - cut]


def _middle_ends(change: Floats) -> tuple[float, float]:
    """The 95 % interval of the mean of the middle half, over seeds."""
    if len(change) < 2:
        return math.nan, math.nan
    weights = block_weights(np.arange(len(change))).astype(int)
    drawn = np.stack([np.repeat(np.sort(change), row) for row in weights[:, np.argsort(change)]])
    low, high = interval(_middle(drawn).mean(axis=-1), blocks=len(change))
    return float(low), float(high)


def _side(change: float) -> Alternative:
    """Of a test in the direction in which scores went."""
    return "greater" if change > 0 else "less"


def _corrected(tested: Sequence[_Tested], side: int) -> list[float]:
    """Holm's correction over the tests that were made, of a loss (side 1) or a gain (-1); 1 for all others.

    Every test that was made counts, and those that went the other way have nothing to say.
    """
    made = [index for index, each in enumerate(tested) if each.made]
    p = [tested[index].change.p if side * tested[index].change.loss > 0 else 1.0 for index in made]
    corrected = [1.0] * len(tested)
    for index, value in zip(made, holm(p), strict=True):
        corrected[index] = value
    return corrected
