"""Pairs of a score before and after: trial by trial, and seed by seed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from simharness.gate.baseline import FRAMES, Measurement
from simharness.gate.trial_command import TrialKey


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
    def seeds(self) -> tuple[NDArray[np.intp], ...]:
        """Indices of the trials of each seed. Trials of different seeds are independent."""
        seeds = np.array([trial.seed for trial in self.trials])
        return tuple(np.flatnonzero(seeds == seed) for seed in np.unique(seeds))

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
                pairs = _pairs(score, variant, case, before, after)
                if pairs.trials:
                    yield pairs


def _pairs(score: str, variant: str, case: str | None, before: Measurement, after: Measurement) -> Pairs:
    rows = {
        trial: (old[score], new, old[FRAMES])
        for trial, old in before.scores.items()
        if trial.variant == variant and case in (None, trial.case)
        if old[score] is not None and (new := after.scores.get(trial, {}).get(score)) is not None
    }
    values = np.array(list(rows.values()), float).reshape(-1, 3)
    return Pairs(score, variant, case, tuple(rows), *values.T)
