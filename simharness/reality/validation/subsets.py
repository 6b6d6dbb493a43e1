"""Subsets of the cameras of a rig, and the PCP that a variant reaches with so many cameras."""

import itertools
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats
from simharness.reality.validation.evidence import Compared, Evidence, Figure, Sums, rank_correlation
from simharness.reality.validation.passes import CameraSubset
from simharness.scoring.frame_scores import RULES, HeadRule
from simharness.statistics.intervals import Interval
from simharness.types.random_streams import stream

FILLED = RULES[2]
"""Default rule of subsets: with few cameras, missing ears would hide all other losses."""

MOST = 40
"""Largest number of subsets of a camera count that are tried; of more, so many are drawn."""


def camera_subsets(cameras: int, *, most: int = MOST, seed: int = 0) -> list[tuple[int, ...]]:
    """Return the subsets of two cameras and more, smallest first; of counts with many subsets, a random sample.

    Args:
        cameras: number of cameras of the rig.
        most: largest number of subsets of a count; the same subsets are drawn for the same number of cameras.
        seed: seed of the draws.
    """
    subsets: list[tuple[int, ...]] = []
    for count in range(2, cameras + 1):
        if math.comb(cameras, count) <= most:
            subsets += itertools.combinations(range(cameras), count)
            continue
        generator, drawn = stream(seed, "validation", "subsets", cameras, count), set[tuple[int, ...]]()
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
    """PCP with some of the cameras, in reality and in twins.

    Attributes:
        curves: PCP, percent, by number of cameras and variant; mean over the subsets.
        gains: PCP of ``full`` minus that of ``fast``, points, by number of cameras.
        sampled: camera counts of which only a sample of the subsets was tried.
        single: PCP of each subset by variant: the recording's and the mean of the twins'.
        ranks: Spearman's correlation of reality and twins over the pairs of cameras, by variant.
    """

    curves: Mapping[int, Mapping[str, Compared]]
    gains: Mapping[int, Compared]
    sampled: tuple[int, ...]
    single: Mapping[str, Mapping[tuple[int, ...], tuple[float, float]]]
    ranks: Mapping[str, Interval]

    def mean_difference(self, variant: str) -> float:
        """Return the mean over camera counts of the absolute difference between twins and reality, points."""
        return float(np.mean([abs(each[variant].difference) for each in self.curves.values()]))


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
    single: dict[str, dict[tuple[int, ...], tuple[float, float]]] = {}
    ranks: dict[str, Interval] = {}
    for name in variants:
        real, resamples, *twins = (
            subset_scores(each, name, rule=rule) for each in (evidence.real, evidence.resamples, *evidence.twins)
        )
        single[name] = {
            views: (float(pcp), float(np.mean([twin[views] for twin in twins]))) for views, pcp in real.items()
        }
        pairs = [views for views in real if len(views) == 2]
        ranks[name] = rank_correlation(
            *zip(*(single[name][views] for views in pairs), strict=True),
            resamples=np.stack([resamples[views] for views in pairs], axis=-1),
        )
    sampled = tuple(count for count, number in sorted(tried.items()) if number < math.comb(cameras, count))
    return SubsetComparison(curves, gains, sampled, single, ranks)


def _point(variant: str, count: int, rule: HeadRule) -> Figure:
    return lambda sums: subset_curve(sums, variant, rule=rule)[count]


def _difference(one: Figure, other: Figure) -> Figure:
    return lambda sums: np.asarray(one(sums)) - np.asarray(other(sums))
