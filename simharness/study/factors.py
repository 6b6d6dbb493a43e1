"""Factors of a study: swept keys with their trials, and the values at which scores break.

Refinement: of two swept values between which a score breaks, the value in the middle is added to the sweep.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import polars as pl

from mvpose.arrays import Floats
from simharness.scoring.catalogue import SCORES
from simharness.statistics.breaking_points import BreakingPoint, breaking_point
from simharness.statistics.intervals import Interval, mean_interval
from simharness.study.study_folder import Results

THRESHOLDS: Mapping[str, float] = {"pcp": 90.0, "precision": 90.0}
"""Default thresholds of the breaking points. Ghosts do not lower PCP; they lower precision."""

LOST = 5.0
"""Points of a percentage whose loss is reported."""

_NARROW = 0.25  # share of an interval below which a gap at its end is not refined


@dataclass(frozen=True)
class Factor:
    """A swept key with its trials."""

    key: str
    """Dotted key of the scenario."""
    values: tuple[Any, ...]
    """Swept values: ascending where they are numbers, else in the order of the study."""
    numeric: bool
    """Whether the values are numbers."""
    rows: pl.DataFrame = field(repr=False)
    """Trials of the study: all of a grid; of a one-at-a-time sweep, those that vary this key, and the base."""
    along: tuple[str, ...] = ()
    """Keys that change together with this one."""
    over: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    """Other keys that vary among the trials of one value, with their values: a score is the mean over them. These are
    the other factors of a grid, and ``case`` where several cases are pooled."""

    def table(self, variant: str, score: str) -> Floats:
        """Return the score of a variant by seed and value, (n, k): means over the other keys, NaN without data."""
        rows = self.rows.filter(pl.col("variant") == variant)
        seeds = {seed: row for row, seed in enumerate(rows["seed"].unique().sort())}
        columns = {value: column for column, value in enumerate(self.values)}
        sums, counts = np.zeros((len(seeds), len(columns))), np.zeros((len(seeds), len(columns)))
        for seed, value, number in zip(rows["seed"], rows[self.key], rows[score], strict=True):
            if number is not None and np.isfinite(number):
                sums[seeds[seed], columns[value]] += number
                counts[seeds[seed], columns[value]] += 1
        return np.divide(sums, counts, out=np.full_like(sums, np.nan), where=counts > 0)

    def line(self, variant: str, score: str) -> list[Interval]:
        """Return the mean score of a variant at each value, with its interval over seeds."""
        return [mean_interval(column, unit=SCORES[score].unit) for column in self.table(variant, score).T]


def cases_of(results: Results) -> tuple[str, ...]:
    """Return the names of a study's cases in the order of the study; empty without cases."""
    return tuple(case for case in dict.fromkeys(results.trials["case"]) if case)


def factors(results: Results, case: str | None = None) -> list[Factor]:
    """Return the factors of a study, in the order of the study.

    Keys that change together are one factor, under the first key. Keys with only one finished value are left out.

    Args:
        results: the study.
        case: case to take the trials from; None pools all cases, and scores are means over them.
    """
    trials = results.trials if case is None else results.trials.filter(pl.col("case") == case)
    keys = list(results.info["factors"])
    swept: list[Factor] = []
    taken: set[str] = set()
    for key in keys:
        rows = trials
        if results.info["one_at_a_time"]:
            rows = rows.filter(pl.col("varied").is_in([key, ""]))
        values = list(dict.fromkeys(rows[key]))
        if len(values) < 2 or key in taken:
            continue
        along = tuple(other for other in keys if other != key and _together(rows, key, other))
        taken.update(along)
        numeric = all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
        swept.append(Factor(key, tuple(sorted(values) if numeric else values), numeric, rows, along))
    pooled = {"case": cases_of(results)} if case is None and len(cases_of(results)) > 1 else {}
    grid_of = {} if results.info["one_at_a_time"] else {each.key: each.values for each in swept}
    others = {each.key: {key: values for key, values in grid_of.items() if key != each.key} for each in swept}
    return [replace(each, over={**others[each.key], **pooled}) for each in swept]


def factors_by_case(results: Results) -> dict[str, list[Factor]]:
    """Return the factors of each case separately; the factors of a study without cases are under ``""``."""
    return {case: factors(results, case) for case in cases_of(results) or ("",)}


def _together(rows: pl.DataFrame, key: str, other: str) -> bool:
    """Return whether two keys change together: each value of one always goes with the same value of the other."""
    pairs = set(zip(rows[key], rows[other], strict=True))
    return len(pairs) == len({one for one, _ in pairs}) == len({two for _, two in pairs})


@dataclass(frozen=True)
class FactorBreakingPoint:
    """Breaking point of one variant along one factor."""

    factor: str
    """Key of the factor."""
    variant: str
    """Name of the variant."""
    score: str
    """Key of the score."""
    threshold: float
    """Last value of the score that is still good."""
    rising: bool
    """Whether the score gets worse as the factor grows; else it gets worse as the factor shrinks."""
    point: BreakingPoint
    """Value of the factor at the threshold; the ends of its interval are ascending."""
    swept: tuple[float, float]
    """Lowest and highest value of the factor."""


def factor_breaking_points(
    factor: Factor, variants: Sequence[str], score: str, threshold: float, *, relative: bool = False
) -> list[FactorBreakingPoint]:
    """Return the value of a numeric factor at which each variant's score passes the threshold.

    A factor may do harm as it grows (clutter) or as it shrinks (cameras); the end with the worse score decides.
    Variants without the score are left out. With ``relative`` the threshold is one of changes against the better end,
    seed by seed.
    """
    better = SCORES[score].better
    points = []
    for variant in variants:
        table = factor.table(variant, score)
        if not np.isfinite(table).any():
            continue
        known = np.flatnonzero(np.isfinite(table).any(axis=0))
        first, last = (float(np.nanmean(table[:, k])) for k in known[[0, -1]])
        falls = first == last or (last < first) == (better == "higher")
        if relative:
            table = table - table[:, [known[0] if falls else known[-1]]]
        values = np.array(factor.values, float)
        if falls:
            point = breaking_point(values, table, threshold, better=better)
        else:
            mirrored = breaking_point(-values[::-1], table[:, ::-1], threshold, better=better)
            ends = [None if end is None else 0.0 - end for end in (mirrored.value, mirrored.high, mirrored.low)]
            point = BreakingPoint(ends[0], ends[1], ends[2], mirrored.why)
        swept = (float(values[0]), float(values[-1]))
        points.append(FactorBreakingPoint(factor.key, variant, score, threshold, bool(falls), point, swept))
    return points


def refined_values(results: Results, left: Mapping[str, int]) -> dict[str, tuple[float, ...]]:
    """Return the values to add to the sweep: the middles of the gaps that make breaking points uncertain, by key.

    Between integers there may be none. The gaps of most variants, scores and cases come first, then the widest.

    Args:
        results: the study so far.
        left: number of values that may be added to each key.
    """
    gaps: dict[str, Counter[tuple[float, float]]] = {}
    for case in cases_of(results) or (None,):
        for factor in factors(results, case):
            if not factor.numeric or factor.along:
                continue
            wanted = [*((score, threshold, False) for score, threshold in THRESHOLDS.items()), ("pcp", -LOST, True)]
            for score, threshold, relative in wanted:
                variants = results.info["variants"]
                for each in factor_breaking_points(factor, variants, score, threshold, relative=relative):
                    gap = _gap(factor.values, each.point)
                    gaps.setdefault(factor.key, Counter()).update([gap] if gap else [])
    added = {}
    for key, counted in gaps.items():
        whole = all(isinstance(end, int) for gap in counted for end in gap)
        order = sorted(counted, key=lambda gap: (-counted[gap], gap[0] - gap[1], gap))
        middles = [(low + high) // 2 if whole else float(f"{(low + high) / 2:.12g}") for low, high in order]
        new = [middle for middle, gap in zip(middles, order, strict=True) if middle not in gap]
        added[key] = tuple(sorted(new[: left.get(key, 0)]))
    return {key: values for key, values in added.items() if values}


def _gap(values: Sequence[float], point: BreakingPoint) -> tuple[float, float] | None:
    """Return the wider one of the outer two gaps between swept values in the interval of a breaking point.

    None where there is no break, or where both are narrow: then the interval comes from the seeds.
    """
    if point.value is None:
        return None
    inside = [each for each in values if point.low is None or each >= point.low]
    inside = [each for each in inside if point.high is None or each <= point.high]
    outer = [(inside[0], inside[1])] if point.low is not None and len(inside) > 1 else []
    outer += [(inside[-2], inside[-1])] if point.high is not None and len(inside) > 1 else []
    low, high = max(outer, key=lambda gap: gap[1] - gap[0], default=(0.0, 0.0))
    return (low, high) if high - low > _NARROW * (inside[-1] - inside[0]) else None
