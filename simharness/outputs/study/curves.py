"""Robustness curves of a study: scores against its factors, and their breaking points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import polars as pl

from mvpose.arrays import Floats
from simharness.scoring.catalogue import SCORES
from simharness.statistics.breaking_points import BreakingPoint, breaking_point
from simharness.statistics.intervals import Interval, mean_interval
from simharness.study.study_folder import Results


@dataclass(frozen=True)
class Factor:
    """A swept key with its trials.

    Attributes:
        key: dotted key of the scenario.
        values: swept values: ascending where they are numbers, else in the order of the study.
        numeric: whether the values are numbers.
        rows: trials of the study: all of a grid; of a one-at-a-time sweep, those that vary this key, and the base.
        along: keys that change together with this one.
        over: other keys that vary among the trials of one value, with their values: a score is the mean over them.
            These are the other factors of a grid, and ``case`` where several cases are pooled.
    """

    key: str
    values: tuple[Any, ...]
    numeric: bool
    rows: pl.DataFrame = field(repr=False)
    along: tuple[str, ...] = ()
    over: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)

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
    return [replace(each, over={**_without(grid_of, each.key), **pooled}) for each in swept]


def factors_by_case(results: Results) -> dict[str, list[Factor]]:
    """Return the factors of each case separately; the factors of a study without cases are under ``""``."""
    return {case: factors(results, case) for case in cases_of(results) or ("",)}


def panels(by_case: Mapping[str, Sequence[Factor]]) -> dict[str, dict[str, Factor]]:
    """Return the factors of :func:`factors_by_case` by key and then by case: the panels of one row of plots."""
    by_key: dict[str, dict[str, Factor]] = {}
    for case, swept in by_case.items():
        for factor in swept:
            by_key.setdefault(factor.key, {})[case] = factor
    return by_key


def _without(values: Mapping[str, tuple[Any, ...]], key: str) -> dict[str, tuple[Any, ...]]:
    return {other: each for other, each in values.items() if other != key}


def _together(rows: pl.DataFrame, key: str, other: str) -> bool:
    """Return whether two keys change together: each value of one always goes with the same value of the other."""
    pairs = set(zip(rows[key], rows[other], strict=True))
    return len(pairs) == len({one for one, _ in pairs}) == len({two for _, two in pairs})


def grid(first: Factor, second: Factor, variant: str, score: str) -> Floats | None:
    """Return the mean score of a variant at every combination of two factors, (k1, k2); None for an incomplete grid."""
    rows = first.rows.filter(pl.col("variant") == variant)
    cells: dict[tuple[Any, Any], list[float]] = {}
    for one, other, number in zip(rows[first.key], rows[second.key], rows[score], strict=True):
        cells.setdefault((one, other), []).extend([] if number is None else [number])
    if len(cells) < len(first.values) * len(second.values):
        return None
    return np.array(
        [[np.mean(cell) if (cell := cells[one, other]) else np.nan for other in second.values] for one in first.values]
    )


@dataclass(frozen=True)
class FactorBreakingPoint:
    """Breaking point of one variant along one factor.

    Attributes:
        factor: key of the factor.
        variant: name of the variant.
        score: key of the score.
        threshold: last value of the score that is still good.
        rising: whether the score gets worse as the factor grows; else it gets worse as the factor shrinks.
        point: value of the factor at the threshold; the ends of its interval are ascending.
        swept: lowest and highest value of the factor.
    """

    factor: str
    variant: str
    score: str
    threshold: float
    rising: bool
    point: BreakingPoint
    swept: tuple[float, float]


def breaking_along(
    values: Floats, table: Floats, threshold: float, *, better: Literal["higher", "lower"], rising: bool
) -> tuple[bool, BreakingPoint]:
    """Return ``rising``, and the value of a factor at which the mean of scores (n, k) passes a threshold.

    Args:
        values: values of the factor, (k,), ascending.
        table: scores by seed and value, (n, k).
        threshold: worst good value of the mean.
        better: direction of better scores.
        rising: whether the score gets worse as the factor grows; else as it shrinks.
    """
    if rising:
        return rising, breaking_point(values, table, threshold, better=better)
    mirrored = breaking_point(-values[::-1], table[:, ::-1], threshold, better=better)
    flipped = [None if end is None else 0.0 - end for end in (mirrored.value, mirrored.high, mirrored.low)]
    return rising, BreakingPoint(flipped[0], flipped[1], flipped[2], mirrored.why)


def factor_breaking_points(
    factor: Factor, variants: Sequence[str], score: str, threshold: float
) -> list[FactorBreakingPoint]:
    """Return the value of a numeric factor at which each variant's score passes the threshold.

    A factor may do harm as it grows (clutter) or as it shrinks (cameras); the end with the worse score decides.
    Variants without the score are left out.
    """
    better = SCORES[score].better
    points = []
    for variant in variants:
        table = factor.table(variant, score)
        if not np.isfinite(table).any():
            continue
        ends = [column[np.isfinite(column)].mean() for column in table.T if np.isfinite(column).any()]
        falls = ends[-1] == ends[0] or (ends[-1] < ends[0]) == (better == "higher")
        values = np.array(factor.values, float)
        rising, point = breaking_along(values, table, threshold, better=better, rising=bool(falls))
        swept = (float(values[0]), float(values[-1]))
        points.append(FactorBreakingPoint(factor.key, variant, score, threshold, rising, point, swept))
    return points
