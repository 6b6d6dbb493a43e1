"""Sums of scores over frames, from which the figures of a recording, and of its bootstrap resamples, are computed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from mvpose.arrays import Floats
from simharness.scoring.frame_scores import RULES, ByRule, HeadRule
from simharness.scoring.pcp import Part
from simharness.statistics.resampling import resampled

DEFAULT_RULE = RULES[0]


@dataclass(frozen=True)
class ScoreSums:
    """Sums of a variant's scores over frames, by the H rules of ``RULES``.

    The leading axes (...) are the frames, the resamples of a bootstrap, or absent.

    Attributes:
        correct: number of correct parts of each scored actor, (..., H, S).
        defined: number of parts that the truth defines, (..., H, S).
        error: sum over pairs of the MPJPE, (..., H), mm.
        found: number of pairs of true and estimated people, (..., H).
        people: number of annotated people, (...).
        estimates: number of estimates, (...).
        frames: number of frames, (...).
    """

    correct: Floats
    defined: Floats
    error: Floats
    found: Floats
    people: Floats
    estimates: Floats
    frames: Floats

    @classmethod
    def of(cls, scores: ByRule, actors: Sequence[int]) -> ScoreSums:
        """Return the sums of each frame alone.

        Args:
            scores: scores of F frames by rule.
            actors: indices of the S actors whose PCP is averaged.
        """
        by_rule = [scores[rule] for rule in RULES]
        first = by_rule[0]  # who is there, and how many estimates, does not depend on the rule
        parts = np.stack([each.parts[:, list(actors)] for each in by_rule], axis=1)
        error = np.stack([np.where(each.found, each.error, 0.0) for each in by_rule])
        return cls(
            correct=(parts == Part.CORRECT).sum(axis=-1, dtype=float),
            defined=(parts != Part.UNDEFINED).sum(axis=-1, dtype=float),
            error=1000.0 * error.sum(axis=-1).T,
            found=np.stack([each.found.sum(axis=-1, dtype=float) for each in by_rule], axis=-1),
            people=first.present.sum(axis=-1, dtype=float),
            estimates=first.estimates.astype(float),
            frames=np.ones(len(first)),
        )

    def total(self) -> ScoreSums:
        """Return the sums over the first axis."""
        return ScoreSums(*(getattr(self, field.name).sum(axis=0) for field in fields(self)))

    def resampled(self, weights: Floats) -> ScoreSums:
        """Return the sums of R resamples of F frames, from :func:`~simharness.statistics.resampling.block_weights`."""
        return ScoreSums(*(resampled(getattr(self, field.name), weights) for field in fields(self)))

    def pcp(self, rule: HeadRule = DEFAULT_RULE) -> Floats:
        """Return PCP, percent (...), mean over the scored actors who are annotated in some frame."""
        at = RULES.index(rule)
        return _mean(100.0 * _ratio(self.correct[..., at, :], self.defined[..., at, :]))

    def pcp_actors(self, rule: HeadRule = DEFAULT_RULE) -> Floats:
        """Return PCP of each scored actor, percent (..., S)."""
        at = RULES.index(rule)
        return 100.0 * _ratio(self.correct[..., at, :], self.defined[..., at, :])

    def mpjpe(self, rule: HeadRule = DEFAULT_RULE) -> Floats:
        """Return the mean over pairs of the mean joint error, mm (...)."""
        at = RULES.index(rule)
        return _ratio(self.error[..., at], self.found[..., at])

    def recall(self, rule: HeadRule = DEFAULT_RULE) -> Floats:
        """Return the share of annotated people with a pair, 0 to 1 (...)."""
        return _ratio(self.found[..., RULES.index(rule)], self.people)

    def precision(self, rule: HeadRule = DEFAULT_RULE) -> Floats:
        """Return the share of estimates with a pair, 0 to 1 (...)."""
        return _ratio(self.found[..., RULES.index(rule)], self.estimates)

    def ghosts(self, rule: HeadRule = DEFAULT_RULE) -> Floats:
        """Return the number of estimates without a pair, per frame (...)."""
        return _ratio(self.estimates - self.found[..., RULES.index(rule)], self.frames)


def _ratio(numerator: Floats, denominator: Floats) -> Floats:
    """Return the ratio; NaN where the denominator is 0."""
    return np.where(denominator > 0, numerator / np.where(denominator > 0, denominator, 1.0), np.nan)


def _mean(values: Floats) -> Floats:
    """Return the mean over the last axis without NaN; NaN where all are NaN."""
    known = np.isfinite(values)
    return _ratio(np.where(known, values, 0.0).sum(axis=-1), known.sum(axis=-1).astype(float))
