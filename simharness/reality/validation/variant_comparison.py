"""Scores of variants on all frames, and contrasts between variants, in reality and in twins."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats
from simharness.reality.validation.evidence import Compared, Evidence, Figure, rank_correlation
from simharness.reality.validation.passes import Unchanged
from simharness.reality.validation.score_sums import ScoreSums
from simharness.scoring.frame_scores import RULES, FrameScores, HeadRule
from simharness.scoring.joint_errors import pck
from simharness.scoring.pcp import GROUPS, Part

SCORES: Mapping[str, Callable[[ScoreSums, HeadRule], Floats]] = {
    "pcp": ScoreSums.pcp,
    "mpjpe_mm": ScoreSums.mpjpe,
    "recall": ScoreSums.recall,
    "precision": ScoreSums.precision,
    "ghosts_per_frame": ScoreSums.ghosts,
}
"""Scores of a variant by key: PCP in percent, recall and precision from 0 to 1."""

PCK_LIMIT = 0.1
"""Error within which a joint counts as correct in the joint difficulty, metres."""

_UNCHANGED = Unchanged()


def compare_variants(
    evidence: Evidence, variants: Sequence[str], rules: Sequence[HeadRule] = RULES
) -> dict[str, dict[str, dict[HeadRule, Compared]]]:
    """Return all scores by variant, key of :data:`SCORES` and rule for the head."""
    return {
        name: {
            key: {rule: evidence.compare(_figure(score, name, rule)) for rule in rules} for key, score in SCORES.items()
        }
        for name in variants
    }


def compare_contrasts(
    evidence: Evidence, variants: Sequence[str], rules: Sequence[HeadRule] = RULES
) -> dict[tuple[str, str], dict[HeadRule, Compared]]:
    """Return the PCP of one variant minus that of another, points, by pair of variants and rule for the head."""
    return {
        (one, other): {rule: evidence.compare(_contrast(one, other, rule)) for rule in rules}
        for one, other in itertools.combinations(variants, 2)
    }


def _figure(score: Callable[[ScoreSums, HeadRule], Floats], variant: str, rule: HeadRule) -> Figure:
    return lambda sums: score(sums[_UNCHANGED][variant], rule)


def _contrast(one: str, other: str, rule: HeadRule) -> Figure:
    return lambda sums: sums[_UNCHANGED][one].pcp(rule) - sums[_UNCHANGED][other].pcp(rule)


@dataclass(frozen=True)
class JointDifficulty:
    """Errors of each of the 14 joints of SHELF14, in reality and in twins.

    Attributes:
        real_mm, twin_mm: mean error of the joint over pairs of people, (14,), mm.
        real_pck, twin_pck: share of annotated joints with an error of at most 100 mm, (14,), percent.
    """

    real_mm: Floats
    twin_mm: Floats
    real_pck: Floats
    twin_pck: Floats

    @property
    def rank_correlation(self) -> float:
        """Spearman's correlation of the mean errors over joints."""
        return rank_correlation(self.real_mm, self.twin_mm).mean

    @property
    def rank_correlation_pck(self) -> float:
        """Spearman's correlation of the shares over joints."""
        return rank_correlation(self.real_pck, self.twin_pck).mean


def compare_joints(real: FrameScores, twins: Sequence[FrameScores]) -> JointDifficulty:
    """Compare the errors of joints of one variant."""
    of_twins = [_joint_errors(each) for each in twins]
    real_mm, real_pck = _joint_errors(real)
    twin_mm, twin_pck = (np.mean(each, axis=0) for each in zip(*of_twins, strict=True))
    return JointDifficulty(real_mm, twin_mm, real_pck, twin_pck)


def _joint_errors(scores: FrameScores) -> tuple[Floats, Floats]:
    """Return the mean error, mm, and the share within :data:`PCK_LIMIT`, percent, of each joint, (14,)."""
    errors = scores.errors.reshape(-1, scores.errors.shape[-1])
    missed = (scores.present & ~scores.found).ravel()
    counted = np.where(missed[:, None], np.inf, errors)
    mean = [1000.0 * column[np.isfinite(column)].mean() if np.isfinite(column).any() else np.nan for column in errors.T]
    return np.array(mean), np.array([pck(column, [PCK_LIMIT])[0] for column in counted.T])


def median_error(scores: FrameScores) -> float:
    """Return the median over pairs of the mean joint error, mm; NaN without a pair."""
    means = scores.error[scores.found]
    return float(1000.0 * np.median(means)) if len(means) else float("nan")


def pcp_of_parts(scores: FrameScores, actors: Sequence[int]) -> dict[str, float]:
    """Return the PCP of each group of parts, percent, mean over the actors; NaN where undefined."""
    parts = scores.parts[:, list(actors)]
    result = {}
    for group, index in GROUPS.items():
        chosen = parts[..., list(index)]
        defined = (chosen != Part.UNDEFINED).sum(axis=(0, 2))
        correct = (chosen == Part.CORRECT).sum(axis=(0, 2))
        share = correct[defined > 0] / defined[defined > 0]
        result[group] = float(100.0 * share.mean()) if len(share) else float("nan")
    return result
