"""Comparison of two measurements of one suite, seed by seed.

Every gated score of every variant, and its time, is compared over the whole suite and over each case alone. A single
case shows changes that the mean over the suite dilutes, for example a step that became quadratic in the number of
people. A change counts if it is larger than allowed *and* significant.

*Allowed* is a loss of the score's tolerance, and a gain of its bound. A gain that is too large is no success until
somebody has accepted it: the method may have become better, and then the baseline should know, or the suite easier. A
score with a best value, such as coverage, may move away from it by its tolerance, and in either direction by its bound.
A frame may take longer by a factor, which is smaller on the kind of processor that measured the baseline than on
others; a faster method needs no acceptance, because it is no sign of an easier suite.

*Significant* is a two-sided paired test over seeds with Holm's correction, where the whole suite and the single cases
have half of the level each. The cases are conditions of the same scenes: a change that helps at a seed in one case
tends to help at that seed in the other cases, so trials of one seed are not independent. The whole suite is therefore
compared by seed: before and after are means over the cases that have the score in both measurements at that seed. Rates
of rare events, missed people and ghosts, are compared by their counts.

A test is made where the mean absolute difference exceeds what is allowed; no other change could count. A change of one
case makes few tests, because unchanged trials have the difference zero. A loss beyond its tolerance that the number of
seeds could not have shown to be significant is ``undecided``.

Time is compared by the logarithm of the ratio of each trial's time after and before, both in units of the reference
kernel. The middle half of a seed's ratios is used, because the machine may have been busy during a trial, and then the
middle half of the seeds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from simharness.gate.baseline import GATED, TIME, Measurement
from simharness.gate.score_tests import Pairs, Tested, pairs_of, test_of
from simharness.gate.trial_command import TrialKey
from simharness.scenario.sections.gate_section import GateSection
from simharness.scoring.catalogue import SCORES
from simharness.statistics.paired_tests import holm

Verdict = Literal["worse", "unexpected", "better", "same"]
"""``unexpected``: better by more than its bound; a score with a best value may also have moved past it."""


@dataclass(frozen=True)
class Allowed:
    """Largest changes of a score that fail nothing, in the unit of :attr:`simharness.gate.score_tests.Tested.loss`.

    Attributes:
        loss: largest loss.
        gain: largest gain; for a score with a best value the largest change in either direction.
    """

    loss: float
    gain: float


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
        p: p-value after correction; 1 where no test was made.
        loss: size of the loss in tolerances; negative for a gain.
        verdict: worse, unexpected, better or same.
        undecided: larger than its tolerance, but could not be significant even if all seeds agreed.
        allowed: largest changes that fail nothing.
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
    allowed: Allowed
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
        """Losses beyond their tolerances that may be chance: the seeds are too few to decide.

        Those of a score and variant that became worse anyway, over the whole suite or in another case, are left out.
        """
        worse = {(change.score, change.variant) for change in self.changes if change.verdict == "worse"}
        return tuple(
            change
            for change in self.changes
            if change.undecided and change.loss > 0 and (change.score, change.variant) not in worse
        )

    def changes_of(self, variant: str, case: str | None = None) -> tuple[Change, ...]:
        """Return the changes of a variant over the whole suite or one case."""
        return tuple(change for change in self.changes if (change.variant, change.case) == (variant, case))


def compare(before: Measurement, after: Measurement, gate: GateSection) -> Comparison:
    """Compare two measurements of one suite.

    Trials that only one of them has, because they failed in the other, are left out; the caller reports them.

    Args:
        before: the baseline.
        after: the new measurement.
        gate: tolerances, bounds and level.
    """
    pairs = [*pairs_of(GATED, before, after), *pairs_of((TIME,), before, after)]
    tested = [test_of(each) for each in pairs]
    slowdown = gate.slowdown if before.processor == after.processor else gate.slowdown_elsewhere
    allowed = [_allowed(each.score, gate, slowdown) for each in pairs]
    made = [test.size > min(limits.loss, limits.gain) for test, limits in zip(tested, allowed, strict=True)]
    families = 1 + any(each.case is not None for each in pairs)
    p = [1.0] * len(pairs)
    least = [1.0] * len(pairs)
    for whole in (True, False):
        family = [at for at, each in enumerate(pairs) if made[at] and (each.case is None) == whole]
        for at, value in zip(family, holm([tested[at].p for at in family]), strict=True):
            p[at] = min(1.0, families * value)
            least[at] = families * len(family) * tested[at].least_p
    changes = [_change(*each, gate.level) for each in zip(pairs, tested, allowed, p, least, strict=True)]
    return Comparison(tuple(changes), before.cases if families > 1 else ())


def _allowed(score: str, gate: GateSection, slowdown: float) -> Allowed:
    if score == TIME:
        return Allowed(math.log(slowdown), math.inf)
    return Allowed(gate.tolerance_of(score), gate.improvement_of(score))


def _change(pairs: Pairs, tested: Tested, allowed: Allowed, p: float, least: float, level: float) -> Change:
    """Return the change with its verdict.

    Args:
        pairs: the score.
        tested: its test.
        allowed: largest changes that fail nothing.
        p: corrected p-value.
        least: smallest corrected p-value that this number of seeds can have.
        level: significance level.
    """
    loss = _ratio(tested.loss, allowed.loss)
    gain = abs(tested.difference) if _has_target(pairs.score) else -tested.loss
    verdict: Verdict = "same"
    if p <= level:
        if loss > 1:
            verdict = "worse"
        elif _ratio(gain, allowed.gain) > 1:
            verdict = "unexpected"
        elif loss < -1:
            verdict = "better"
    return Change(
        score=pairs.score,
        variant=pairs.variant,
        case=pairs.case,
        before=tested.before,
        after=tested.after,
        difference=tested.difference,
        low=tested.low,
        high=tested.high,
        n=tested.n,
        p=p,
        loss=loss,
        verdict=verdict,
        undecided=abs(loss) > 1 and verdict == "same" and least > level,
        allowed=allowed,
        worst=tested.worst,
    )


def _has_target(score: str) -> bool:
    return score != TIME and SCORES[score].target is not None


def _ratio(value: float, limit: float) -> float:
    return value / limit if limit else math.copysign(math.inf, value) if value else 0.0
