"""Scores of variants, contrasts between variants, and what added errors cost them, in reality and in twins.

A comparison on subsets of the cameras of a rig has the PCP that a variant reaches with so many cameras.
"""

import itertools
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats
from simharness.reality.validation.evidence import Compared, Evidence, Figure, Sums, compared, ranked
from simharness.reality.validation.passes import (
    DEFAULT_RULE,
    CameraSubset,
    ScoreSums,
    Unchanged,
    mean_known,
    safe_ratio,
)
from simharness.reality.validation.treatments import KINDS, Treatment
from simharness.scoring.frame_scores import RULES, FrameScores, HeadRule
from simharness.scoring.pcp import GROUPS, Part
from simharness.statistics.intervals import Interval
from simharness.statistics.resampling import resampled
from simharness.types.random_streams import stream

SCORES: Mapping[str, Callable[[ScoreSums, HeadRule], Floats]] = {
    "pcp": ScoreSums.pcp,
    "mpjpe_mm": ScoreSums.mpjpe,
    "recall": ScoreSums.recall,
    "precision": ScoreSums.precision,
    "ghosts_per_frame": ScoreSums.ghosts,
}
"""Scores of a variant by key: PCP in percent, recall and precision from 0 to 1."""

_UNCHANGED = Unchanged()


def compare_variants(evidence: Evidence, variants: Sequence[str]) -> dict[str, dict[str, dict[HeadRule, Compared]]]:
    """Return all scores by variant, key of :data:`SCORES` and rule for the head."""
    return {
        name: {
            key: {rule: evidence.compare(_figure(score, name, rule)) for rule in RULES} for key, score in SCORES.items()
        }
        for name in variants
    }


def compare_contrasts(evidence: Evidence, variants: Sequence[str]) -> dict[tuple[str, str], dict[HeadRule, Compared]]:
    """Return the PCP of one variant minus that of another, points, by pair of variants and rule for the head."""
    return {
        (one, other): {rule: evidence.compare(_contrast(one, other, rule)) for rule in RULES}
        for one, other in itertools.combinations(variants, 2)
    }


def _figure(score: Callable[[ScoreSums, HeadRule], Floats], variant: str, rule: HeadRule) -> Figure:
    return lambda sums: score(sums[_UNCHANGED][variant], rule)


def _contrast(one: str, other: str, rule: HeadRule) -> Figure:
    return lambda sums: sums[_UNCHANGED][one].pcp(rule) - sums[_UNCHANGED][other].pcp(rule)


def compare_parts(
    real: FrameScores, twins: Sequence[FrameScores], actors: Sequence[int], weights: Floats
) -> dict[str, Compared]:
    """Compare the PCP of each group of parts, percent, mean over the actors; NaN where undefined.

    Args:
        real: scores of the recording of F frames.
        twins: scores of the twins.
        actors: indices of the S actors whose PCP is averaged.
        weights: bootstrap weights of the recording's frames, (R, F).
    """
    counts, *of_twins = (_part_counts(each, actors) for each in (real, *twins))
    values, drawn = _pcp_of_parts(counts.sum(axis=0)), _pcp_of_parts(resampled(counts, weights))
    simulated = np.array([_pcp_of_parts(each.sum(axis=0)) for each in of_twins])
    return {group: compared(float(values[k]), drawn[:, k], simulated[:, k].tolist()) for k, group in enumerate(GROUPS)}


def _part_counts(scores: FrameScores, actors: Sequence[int]) -> Floats:
    """Return the numbers of correct and of defined parts of each group, (F, 2, G, S)."""
    groups = [scores.parts[:, list(actors)][..., list(index)] for index in GROUPS.values()]
    return np.stack(
        [
            np.stack([counted.sum(axis=-1, dtype=float) for counted in of], axis=1)
            for of in ([each == Part.CORRECT for each in groups], [each != Part.UNDEFINED for each in groups])
        ],
        axis=1,
    )


def _pcp_of_parts(counts: Floats) -> Floats:
    """Return the PCP of each group, percent (..., G), from the numbers of parts, (..., 2, G, S)."""
    return mean_known(100.0 * safe_ratio(counts[..., 0, :, :], counts[..., 1, :, :]))


@dataclass(frozen=True)
class DoseResponse:
    """What one treatment costs one variant; means over draws."""

    kind: str
    """Key of the treatment."""
    level: float
    """Its level."""
    variant: str
    """The variant."""
    pcp: Compared
    """PCP with the treatment, percent."""
    loss: Compared
    """PCP without the treatment minus PCP with it, points."""
    ghosts: Compared
    """Ghosts per frame with the treatment minus without."""
    recall: Compared
    """Recall without the treatment minus with it, 0 to 1."""
    mpjpe: Compared
    """MPJPE with the treatment minus without, mm."""
    losses: tuple[Compared, ...]
    """Loss of each of n draws."""

    @property
    def draws(self) -> Floats:
        """Loss of each draw, in reality and, mean over twins, in simulation, (2, n), points."""
        return np.array([[each.real.mean, each.twin.mean] for each in self.losses]).T

    @property
    def rank(self) -> Interval:
        """Spearman's correlation of the losses of reality and of twins over the draws; NaN for fewer than three."""
        return ranked(self.losses)


def compare_responses(evidence: Evidence, variants: Sequence[str]) -> list[DoseResponse]:
    """Compare reality and twins on all treatments of which the evidence has passes, and on no treatment."""
    given: dict[tuple[str, float], list[Treatment]] = {}
    for change in evidence.real:
        if isinstance(change, Treatment):
            given.setdefault((change.kind, change.level), []).append(change)
    order = list(KINDS)
    return [
        _response(evidence, treatments, variant)
        for _, treatments in sorted(given.items(), key=lambda item: (order.index(item[0][0]), item[0][1]))
        for variant in variants
    ]


def _response(evidence: Evidence, treatments: Sequence[Treatment], variant: str) -> DoseResponse:
    first = treatments[0]

    def change(score: Callable[[ScoreSums, HeadRule], Floats], sign: float) -> Compared:
        return evidence.compare(_mean([_change(each, variant, score, sign) for each in treatments]))

    return DoseResponse(
        kind=first.kind,
        level=first.level,
        variant=variant,
        pcp=evidence.compare(_mean([_treated(each, variant) for each in treatments])),
        loss=change(ScoreSums.pcp, -1.0),
        ghosts=change(ScoreSums.ghosts, 1.0),
        recall=change(ScoreSums.recall, -1.0),
        mpjpe=change(ScoreSums.mpjpe, 1.0),
        losses=tuple(evidence.compare(_change(each, variant, ScoreSums.pcp, -1.0)) for each in treatments),
    )


def _treated(treatment: Treatment, variant: str) -> Figure:
    return lambda sums: sums[treatment][variant].pcp(DEFAULT_RULE)


def _change(treatment: Treatment, variant: str, score: Callable[[ScoreSums, HeadRule], Floats], sign: float) -> Figure:
    """Return the figure of a score with the treatment minus without, times a sign."""
    return lambda sums: (
        sign * (score(sums[treatment][variant], DEFAULT_RULE) - score(sums[_UNCHANGED][variant], DEFAULT_RULE))
    )


def _mean(figures: Sequence[Figure]) -> Figure:
    return lambda sums: np.mean(np.stack([np.asarray(figure(sums), float) for figure in figures]), axis=0)


FILLED = RULES[2]
"""Default rule of subsets: with few cameras, missing ears would hide all other losses."""

MOST = 40
"""Largest number of subsets of a camera count that are tried; of more, so many are drawn."""


def camera_subsets(cameras: int, *, most: int = MOST) -> list[tuple[int, ...]]:
    """Return the subsets of two cameras and more, smallest first; of counts with many subsets, a random sample.

    Args:
        cameras: number of cameras of the rig.
        most: largest number of subsets of a count; the same subsets are drawn for the same number of cameras.
    """
    subsets: list[tuple[int, ...]] = []
    for count in range(2, cameras + 1):
        if math.comb(cameras, count) <= most:
            subsets += itertools.combinations(range(cameras), count)
            continue
        generator, drawn = stream(0, "validation", "subsets", cameras, count), set[tuple[int, ...]]()
        while len(drawn) < most:
            drawn.add(tuple(sorted(generator.permutation(cameras)[:count].tolist())))
        subsets += sorted(drawn)
    return subsets


def subset_scores(sums: Sums, variant: str, *, rule: HeadRule = FILLED) -> dict[tuple[int, ...], Floats]:
    """Return the PCP of a variant by subset, percent."""
    return {
        change.views: of_variant[variant].pcp(rule)
        for change, of_variant in sums.items()
        if isinstance(change, CameraSubset)
    }


def subset_curve(sums: Sums, variant: str, *, rule: HeadRule = FILLED) -> dict[int, Floats]:
    """Return the PCP of a variant by number of cameras, percent, mean over the subsets."""
    by_count: dict[int, list[Floats]] = {}
    for views, pcp in subset_scores(sums, variant, rule=rule).items():
        by_count.setdefault(len(views), []).append(pcp)
    return {count: np.mean(each, axis=0) for count, each in sorted(by_count.items())}


@dataclass(frozen=True)
class SubsetComparison:
    """PCP with some of the cameras, in reality and in twins."""

    curves: Mapping[int, Mapping[str, Compared]]
    """PCP, percent, by number of cameras and variant; mean over the subsets."""
    gains: Mapping[int, Compared]
    """PCP of ``full`` minus that of ``fast``, points, by number of cameras."""
    sampled: tuple[int, ...]
    """Camera counts of which only a sample of the subsets was tried."""
    single: Mapping[str, Mapping[tuple[int, ...], Compared]]
    """PCP of each subset by variant, percent."""
    ranks: Mapping[str, Interval]
    """Spearman's correlation of reality and twins over the pairs of cameras, by variant."""


def compare_subsets(
    evidence: Evidence, cameras: int, variants: Sequence[str], *, rule: HeadRule = FILLED
) -> SubsetComparison:
    """Compare reality and twins on all subsets of the cameras of which the evidence has passes.

    Args:
        evidence: sums by change, with those of :class:`~simharness.reality.validation.passes.CameraSubset`.
        cameras: number of cameras of the rig.
        variants: names of the variants.
        rule: rule for the head.
    """
    tried = Counter(len(change.views) for change in evidence.real if isinstance(change, CameraSubset))
    curves = {
        count: {name: evidence.compare(_point(name, count, rule)) for name in variants} for count in sorted(tried)
    }
    gains = {
        count: evidence.compare(_difference(_point("full", count, rule), _point("fast", count, rule)))
        for count in (sorted(tried) if {"full", "fast"} <= set(variants) else ())
    }
    single = {
        name: {
            change.views: evidence.compare(_of_subset(change, name, rule))
            for change in evidence.real
            if isinstance(change, CameraSubset)
        }
        for name in variants
    }
    ranks = {name: ranked([each for views, each in of.items() if len(views) == 2]) for name, of in single.items()}
    sampled = tuple(count for count, number in sorted(tried.items()) if number < math.comb(cameras, count))
    return SubsetComparison(curves, gains, sampled, single, ranks)


def _of_subset(change: CameraSubset, variant: str, rule: HeadRule) -> Figure:
    return lambda sums: sums[change][variant].pcp(rule)


def _point(variant: str, count: int, rule: HeadRule) -> Figure:
    return lambda sums: subset_curve(sums, variant, rule=rule)[count]


def _difference(one: Figure, other: Figure) -> Figure:
    return lambda sums: np.asarray(one(sums)) - np.asarray(other(sums))
