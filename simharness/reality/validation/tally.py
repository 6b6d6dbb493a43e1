"""Sums of scores over frames, from which the figures of a recording, and of its bootstrap resamples, are computed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from mvpose.arrays import Floats
from simharness.reality.validation.frame_scores import RULES, FrameScores, HeadRule
from simharness.scoring.pcp import Part
from simharness.statistics.resampling import resampled

DEFAULT_RULE = RULES[0]


@dataclass(frozen=True)
class Tally:
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
    def of(cls, scores: FrameScores, actors: Sequence[int]) -> Tally:
        """Return the tally of each frame.

        Args:
            scores: scores of F frames.
            actors: indices of the S actors whose PCP is averaged.
        """
        parts = np.moveaxis(scores.parts[:, :, list(actors)], 0, 1)
        joints = np.isfinite(scores.errors)
        error = np.where(joints, scores.errors, 0.0).sum(axis=-1) / np.maximum(joints.sum(axis=-1), 1)
        return cls(
            correct=(parts == Part.CORRECT).sum(axis=-1, dtype=float),
            defined=(parts != Part.UNDEFINED).sum(axis=-1, dtype=float),
            error=1000.0 * error.sum(axis=-1).T,
            found=scores.found.sum(axis=-1, dtype=float).T,
            people=scores.present.sum(axis=-1, dtype=float),
            estimates=scores.estimates.astype(float),
            frames=np.ones(len(scores.estimates)),
        )

    def total(self) -> Tally:
        """Return the sums over the first axis."""
        return Tally(*(getattr(self, field.name).sum(axis=0) for field in fields(self)))

    def resampled(self, weights: Floats) -> Tally:
        """Return the sums of R resamples of F frames, from :func:`~simharness.statistics.resampling.block_weights`."""
        return Tally(*(resampled(getattr(self, field.name), weights) for field in fields(self)))

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
