"""Comparison of two measurements of one suite, seed by seed, and the result of a gate check."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from simharness.gate.baseline import GATED, TIME, Measurement
from simharness.gate.changed_stage import changed_stage
from simharness.gate.score_tests import Pairs, Tested, pairs_of, test_of
from simharness.gate.trial_command import TrialKey
from simharness.scenario.sections.gate_section import GateSection
from simharness.scoring.catalogue import SCORES
from simharness.statistics.many_tests import joint_p

Verdict = Literal["worse", "unexpected", "better", "same"]
"""``unexpected``: better by more than its bound; a score with a best value may also have moved past it."""


@dataclass(frozen=True)
class Allowed:
    """Largest changes of a score that fail nothing, in the unit of :attr:`simharness.gate.score_tests.Tested.loss`."""

    loss: float
    """Largest loss."""
    gain: float
    """Largest gain; for a score with a best value the largest change in either direction."""


@dataclass(frozen=True)
class Change(Tested):
    """Judged change of one score of one variant.

    Its ``p`` is corrected for other tests, 1 where no test was made; its ``loss`` is in tolerances.
    """

    score: str
    """Key of the score in the catalogue, or ``TIME``."""
    variant: str
    """Variant of the method."""
    case: str | None
    """Case; None for the whole suite."""
    verdict: Verdict
    """Worse, unexpected, better or same."""
    undecided: bool
    """Larger than its tolerance, but could not be significant even if all seeds agreed."""
    allowed: Allowed
    """Largest changes that fail nothing."""
    where: str = ""
    """Stage that changed first and joints that changed most, where they are known; empty without a verdict."""


@dataclass(frozen=True)
class Comparison:
    """Changes of a suite: scores of the whole suite, then of each case; then time in the same order."""

    changes: tuple[Change, ...]
    """Change of each score and of time, by variant, over the whole suite and, if there are several cases, over each
    case."""
    cases: tuple[str, ...]
    """Names of the cases; empty if there is only one."""
    uncompared: tuple[str, ...] = ()
    """Scores that no trial of the baseline has, because they were not yet gated when it was written."""

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

    def changes_of(self, variant: str) -> tuple[Change, ...]:
        """Return the changes of a variant over the whole suite."""
        return tuple(change for change in self.changes if (change.variant, change.case) == (variant, None))


def compare(before: Measurement, after: Measurement, gate: GateSection) -> Comparison:
    """Compare two measurements of one suite.

    P-values are corrected for all tests over the whole suite, and for all in its cases; the two families share the
    level, so that many cases cannot hide what the whole suite shows (:func:`simharness.statistics.many_tests.joint_p`).

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
    p, least = _corrected(pairs, tested, made)
    changes = [_change(*each, gate.level) for each in zip(pairs, tested, allowed, p, least, strict=True)]
    changes = [
        each if each.verdict == "same" else replace(each, where=changed_stage(pair, before, after))
        for each, pair in zip(changes, pairs, strict=True)
    ]
    uncompared = tuple(score for score in GATED if _has(after, score) and not _has(before, score))
    return Comparison(tuple(changes), before.cases if len(before.cases) > 1 else (), uncompared)


def _corrected(
    pairs: Sequence[Pairs], tested: Sequence[Tested], made: Sequence[bool]
) -> tuple[list[float], list[float]]:
    """Return the p-values corrected for other tests, and the least ones that the seeds can have; 1 without a test.

    Args:
        pairs: the scores.
        tested: their tests.
        made: whether a test counts.
    """
    families = 1 + any(each.case is not None for each in pairs)
    p, least = [1.0] * len(pairs), [1.0] * len(pairs)
    for whole in (True, False):
        members = [at for at, each in enumerate(pairs) if made[at] and (each.case is None) == whole]
        flipped = [at for at in members if tested[at].changes]
        counted = [at for at in members if not tested[at].changes]
        seeds = sorted({seed for at in flipped for seed in tested[at].changes})
        changes = np.array([[tested[at].changes.get(seed, 0.0) for seed in seeds] for at in flipped])
        joint = joint_p(changes.reshape(len(flipped), len(seeds)), [tested[at].p for at in counted])
        for at, value in zip([*flipped, *counted], joint.p, strict=True):
            p[at] = min(1.0, families * float(value))
            least[at] = families * joint.corrected(tested[at].least_p)
    return p, least


def _has(measurement: Measurement, score: str) -> bool:
    return any(scores[score] is not None for scores in measurement.scores.values())


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
        **{**vars(tested), "p": p, "loss": loss},
        score=pairs.score,
        variant=pairs.variant,
        case=pairs.case,
        verdict=verdict,
        undecided=abs(loss) > 1 and verdict == "same" and least > level,
        allowed=allowed,
    )


def _has_target(score: str) -> bool:
    return score != TIME and SCORES[score].target is not None


def _ratio(value: float, limit: float) -> float:
    return value / limit if limit else math.copysign(math.inf, value) if value else 0.0


@dataclass(frozen=True)
class FailedCase:
    """Case at a seed that could not be run."""

    case: str
    """Name of the setting, :func:`simharness.gate.trial_command.setting_name`."""
    seed: int
    """Seed."""
    error: str
    """Message of the error."""


@dataclass(frozen=True)
class GateResult:
    """Result of a gate check: comparison of a suite with its baseline."""

    suite: str
    """Name of the suite."""
    variants: tuple[str, ...]
    """Variants of the method."""
    gate: GateSection
    """Tolerances and level."""
    comparison: Comparison
    """Changes of all scores from the baseline."""
    failed: tuple[FailedCase, ...]
    """Trials that could not be run."""
    trials: int
    """Number of trials; a trial is a setting at a seed."""
    worst: TrialKey
    """Trial to inspect first: one that could not be run, else the one with the largest loss, else the one with the
    lowest PCP."""
    command: str
    """Command line that runs this trial."""
    seconds: float
    """Duration of the run."""
    accept_better: bool = False
    """Whether unexpected improvements fail nothing."""

    @property
    def passed(self) -> bool:
        """Whether no score got worse or, unless that is accepted, unexpectedly better, and every trial ran."""
        return not (self.failed or self.comparison.with_verdict("worse") or self.refused)

    @property
    def refused(self) -> tuple[Change, ...]:
        """Unexpected improvements that nobody has accepted."""
        return () if self.accept_better else self.comparison.with_verdict("unexpected")

    @property
    def advice(self) -> str:
        """What unexpected improvements mean and how to accept them; empty where there are none to accept."""
        if not self.refused:
            return ""
        return (
            "Unexpected improvements fail the check: either the method became better, or what it is tested with became "
            "easier. If the change is meant to do that, accept them with --accept-better for this run, or write a new "
            "baseline with --update-baseline."
        )

    @property
    def verdict(self) -> str:
        """Summary in a few words."""
        worse, unexpected = (len(self.comparison.with_verdict(kind)) for kind in ("worse", "unexpected"))
        improvements = f"{unexpected} unexpected improvement{'s' * (unexpected > 1)}" if unexpected else ""
        parts = [
            f"{worse} regression{'s' * (worse > 1)}" if worse else "",
            "" if self.accept_better else improvements,
            f"{len(self.failed)} of {self.trials} trials could not be run" if self.failed else "",
        ]
        verdict = ", ".join(filter(None, parts)) or "no regression"
        if self.accept_better and improvements:
            verdict += f", {improvements} accepted"
        if undecided := self.comparison.undecided:
            seeds = max(change.n for change in undecided)
            losses = f"{len(undecided)} loss{'es' * (len(undecided) > 1)} beyond tolerance"
            verdict += f", but {losses} that {seeds} seeds are too few to judge"
        if uncompared := self.comparison.uncompared:
            titles = ", ".join(SCORES[key].title for key in uncompared)
            verdict += f"; not compared, because the baseline lacks it: {titles}"
        return verdict

    @property
    def worst_description(self) -> str:
        """Description of the worst trial, which the command runs."""
        why = "lost most" if self.comparison.with_verdict("worse") else "has the lowest PCP"
        return f"the trial that {'could not be run' if self.failed else why}: {self.worst}"
