"""Test of the change of one score: of a mean, of the rate of rare events, of the time of a frame."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from simharness.gate.baseline import FRAMES, TIME, Measurement
from simharness.gate.trial_command import TrialKey
from simharness.scenario.load import Study
from simharness.scoring.catalogue import SCORES
from simharness.statistics.paired_tests import DRAWS, paired, paired_counts
from simharness.statistics.resampling import block_weights, interval

PER_FRAME = "per frame"
"""Unit of the scores that count events."""


@dataclass(frozen=True)
class Pairs:
    """One score of a variant in the n trials that have it in both measurements.

    Attributes:
        score: key of the score.
        variant: variant of the method.
        case: case of the trials; None for all cases.
        trials: the trials.
        before, after: scores, (n,).
        frames: number of frames of each trial, (n,).
    """

    score: str
    variant: str
    case: str | None
    trials: tuple[TrialKey, ...]
    before: Floats
    after: Floats
    frames: Floats

    @property
    def seed_numbers(self) -> list[int]:
        """Seeds in order."""
        return sorted({trial.seed for trial in self.trials})

    @property
    def seeds(self) -> tuple[NDArray[np.intp], ...]:
        """Indices of the trials of each seed. Trials of different seeds are independent."""
        seeds = np.array([trial.seed for trial in self.trials])
        return tuple(np.flatnonzero(seeds == seed) for seed in self.seed_numbers)

    def means(self) -> tuple[Floats, Floats]:
        """Return the means over the trials of each seed, before and after."""
        before, after = (np.array([each[at].mean() for at in self.seeds]) for each in (self.before, self.after))
        return before, after

    def counts(self) -> tuple[Floats, Floats, Floats]:
        """Return the events of each seed, before and after, and its frames; the score is a rate per frame."""
        events = (np.round(rate * self.frames) for rate in (self.before, self.after))
        before, after, frames = (np.array([each[at].sum() for at in self.seeds]) for each in (*events, self.frames))
        return before, after, frames


def pairs_of(scores: Iterable[str], before: Measurement, after: Measurement) -> Iterator[Pairs]:
    """Yield the pairs of each score and variant over the whole suite and, if there are several cases, over each case.

    Trials that only one measurement has are left out, and so are scores that do not apply to a trial in one of them.
    """
    cases = before.cases if len(before.cases) > 1 else ()
    scores = tuple(scores)
    for case in chain((None,), cases):
        for variant in before.variants:
            for score in scores:
                pairs = pairs_in(score, variant, case, before, after)
                if pairs.trials:
                    yield pairs


def pairs_in(score: str, variant: str, case: str | None, before: Measurement, after: Measurement) -> Pairs:
    """Return the pairs of a score of a variant in a case; over the whole suite where ``case`` is None."""
    rows = {
        trial: (old[score], new, old[FRAMES])
        for trial, old in before.scores.items()
        if trial.variant == variant and case in (None, trial.case)
        if old[score] is not None and (new := after.scores.get(trial, {}).get(score)) is not None
    }
    values = np.array(list(rows.values()), float).reshape(-1, 3)
    return Pairs(score, variant, case, tuple(rows), *values.T)


@dataclass(frozen=True)
class Tested:
    """Change of one score, and its test.

    Attributes:
        before, after: means over the seeds; for ``TIME``, geometric means of the middle half.
        difference: after - before; for ``TIME``, after / before.
        low, high: ends of the 95 % interval of the difference.
        n: number of seeds.
        p: two-sided p-value, not corrected for other tests.
        loss: growth of what should be small: in the unit of the score, for ``TIME`` the logarithm of the ratio.
        size: mean size of the changes of the seeds, regardless of their signs, in the unit of ``loss``.
        least_p: least p-value that a test of this number of seeds can have.
        changes: tested change of each seed; empty where events are counted.
        worst: trial with the largest loss.
    """

    before: float
    after: float
    difference: float
    low: float
    high: float
    n: int
    p: float
    loss: float
    size: float
    least_p: float
    changes: Mapping[int, float]
    worst: TrialKey


def test_of(pairs: Pairs) -> Tested:
    """Test the change of a score in the way that fits its kind."""
    return _test_time(pairs) if pairs.score == TIME else _test_mean(pairs)


def _badness(score: str, values: Floats) -> Floats:
    """Return values that are the smaller the better: distances from the best value, where there is one."""
    info = SCORES[score]
    if info.target is not None:
        return np.abs(values - info.target)
    return -values if info.better == "higher" else values


def _test_mean(pairs: Pairs) -> Tested:
    before, after = pairs.means()
    rare = SCORES[pairs.score].unit == PER_FRAME
    test = paired_counts(*pairs.counts()) if rare else paired(before, after, symmetric=True)
    ends = np.array([before.mean(), after.mean()])
    return Tested(
        before=float(ends[0]),
        after=float(ends[1]),
        difference=float(ends[1] - ends[0]),
        low=test.low,
        high=test.high,
        n=test.n,
        p=test.p,
        loss=float(np.diff(_badness(pairs.score, ends))[0]),
        size=float(np.abs(after - before).mean()),
        least_p=0.0 if rare else least_two_sided_p(test.n),
        changes={} if rare else dict(zip(pairs.seed_numbers, after - before, strict=True)),
        worst=pairs.trials[int(np.argmax(_badness(pairs.score, pairs.after) - _badness(pairs.score, pairs.before)))],
    )


def _test_time(pairs: Pairs) -> Tested:
    """Compare the middle half of the logarithmic ratios of times: some trials meet a machine that is busy."""
    ratios = np.log(pairs.after / pairs.before)
    # Exchanging before and after leaves the middle half of a seed the same trials.
    counted = [at[_middle(np.argsort(ratios[at], kind="stable"))] for at in pairs.seeds]
    before, after = (np.array([np.log(each[at]).mean() for at in counted]) for each in (pairs.before, pairs.after))
    change = after - before
    middle = _middle(np.argsort(change, kind="stable"))
    ratio = float(change[middle].mean())
    test = paired(before, after, symmetric=True)
    low, high = _middle_ends(change)
    return Tested(
        before=math.exp(before[middle].mean()),
        after=math.exp(after[middle].mean()),
        difference=math.exp(ratio),
        low=math.exp(low),
        high=math.exp(high),
        n=test.n,
        p=test.p,
        loss=ratio,
        size=float(_middle(np.sort(np.abs(change))).mean()),
        least_p=least_two_sided_p(test.n),
        changes=dict(zip(pairs.seed_numbers, change, strict=True)),
        worst=pairs.trials[int(np.argmax(ratios))],
    )


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


def least_two_sided_p(seeds: int) -> float:
    """Return the least p-value of the two-sided test of a mean: of seeds that all change alike."""
    return max(2.0 ** (1 - seeds), 1 / (1 + DRAWS))


def least_corrected_p(seeds: int, *, cases: int) -> float:
    """Return the least p-value of a comparison: of one score in which all seeds change alike, and of no other change.

    The whole suite and the single cases share the level.
    """
    return (1 + (cases > 1)) * least_two_sided_p(seeds)


def least_seeds(level: float, *, cases: int) -> int | None:
    """Return the smallest number of seeds with which a single test can be significant; None if no number is enough."""
    counts = range(1, DRAWS.bit_length() + 1)
    return next((seeds for seeds in counts if least_corrected_p(seeds, cases=cases) <= level), None)


def require_seeds(study: Study) -> None:
    """Check that a suite has enough seeds to find a regression.

    Raises:
        ValueError: the seeds are so few, or the level so low, that no change could be significant.
    """
    level, seeds, cases = study.gate.level, len(study.seeds), len(study.settings)
    p = least_corrected_p(seeds, cases=cases)
    if p <= level:
        return
    least = least_seeds(level, cases=cases)
    mend = "a higher level" if least is None else f"at least {least} seeds, or a higher level"
    raise ValueError(
        f"{study.path}: no regression can be found: {seeds} seed{'s' * (seeds > 1)} that all get worse have "
        f"p = {p:.2g}, and gate.level is {level:g}; give it {mend}"
    )
