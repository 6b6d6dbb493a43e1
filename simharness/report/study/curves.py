"""How scores go with what a study sweeps, and where they break."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import polars as pl

from mvpose.arrays import Floats
from simharness.scoring.catalogue import SCORES
from simharness.statistics.comparison import BreakingPoint, Interval, breaking_point, mean_interval
from simharness.study.result_folder import Results


@dataclass(frozen=True)
class Factor:
    """One swept key, and the trials that say what it does.

    Attributes:
        key: dotted.
        values: that were tried: ascending where they are numbers, else in the order of the study.
        numeric: whether they are numbers.
        rows: of the study's trials: of a grid all, of a sweep one at a time those that vary this key and the base.
        along: keys that change together with this one.
        over: what else differs among the trials of one value, so that a score is the mean over it: other keys of a
            grid, and ``case`` where those of several are together; with the values of each.
    """

    key: str
    values: tuple[Any, ...]
    numeric: bool
    rows: pl.DataFrame = field(repr=False)
    along: tuple[str, ...] = ()
    over: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)

    def table(self, variant: str, score: str) -> Floats:
        """A variant's score by seed and value, (n, k): the mean over everything else that varies; NaN where none."""
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
        """A variant's mean score at each value, with its interval over seeds."""
        return [mean_interval(column) for column in self.table(variant, score).T]


def cases_of(results: Results) -> tuple[str, ...]:
    """The names of a study's cases, in its order; none where it has no cases."""
    return tuple(case for case in dict.fromkeys(results.trials["case"]) if case)


def factors(results: Results, case: str | None = None) -> list[Factor]:
    """What a study sweeps, in its order.

    Keys that change together are one factor, of the first. Those of which only one value has finished are left out.

    Args:
        results: the study.
        case: whose trials count; None: those of all cases together, of which every score is then the mean.
    """
    trials = results.trials if case is None else results.trials.filter(pl.col("case") == case)
    keys = list(results.info["factors"])
    found: list[Factor] = []
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
        found.append(Factor(key, tuple(sorted(values) if numeric else values), numeric, rows, along))
    pooled = {"case": cases_of(results)} if case is None and len(cases_of(results)) > 1 else {}
    grid_of = {} if results.info["one_at_a_time"] else {each.key: each.values for each in found}
    return [replace(each, over={**_without(grid_of, each.key), **pooled}) for each in found]


def factors_by_case(results: Results) -> dict[str, list[Factor]]:
    """What a study sweeps, of every case by itself; of a study without cases one list, of ``""``."""
    return {case: factors(results, case) for case in cases_of(results) or ("",)}


def panels(by_case: Mapping[str, Sequence[Factor]]) -> dict[str, dict[str, Factor]]:
    """The factors of :func:`factors_by_case` by key and then by case: what stands beside each other."""
    found: dict[str, dict[str, Factor]] = {}
    for case, swept in by_case.items():
        for factor in swept:
            found.setdefault(factor.key, {})[case] = factor
    return found


def _without(values: Mapping[str, tuple[Any, ...]], key: str) -> dict[str, tuple[Any, ...]]:
    return {other: each for other, each in values.items() if other != key}


def _together(rows: pl.DataFrame, key: str, other: str) -> bool:
    """Whether two keys change together: to each value of one belongs one of the other."""
    pairs = set(zip(rows[key], rows[other], strict=True))
    return len(pairs) == len({one for one, _ in pairs}) == len({two for _, two in pairs})


def grid(first: Factor, second: Factor, variant: str, score: str) -> Floats | None:
    """A variant's mean score at every combination of two factors, (k1, k2); None where not all were tried."""
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
class Breaking:
    """Where one variant breaks along one factor.

    Attributes:
        factor: the key.
        variant: of the method.
        score: that falls.
        threshold: on it is still good.
        rising: whether the score gets worse as the factor grows; if not, as it shrinks.
        point: where; its ends are ascending values of the factor.
        tried: the lowest and the highest value.
    """

    factor: str
    variant: str
    score: str
    threshold: float
    rising: bool
    point: BreakingPoint
    tried: tuple[float, float]


def breaking(factor: Factor, variants: Sequence[str], score: str, threshold: float) -> list[Breaking]:
    """Where each variant's score passes its threshold along a factor of numbers.

    A factor may do harm as it grows (clutter) or as it shrinks (cameras): whichever end is worse says which. Variants
    without the score are left out.
    """
    better = SCORES[score].better
    found = []
    for variant in variants:
        table = factor.table(variant, score)
        if not np.isfinite(table).any():
            continue
        ends = [column[np.isfinite(column)].mean() for column in table.T if np.isfinite(column).any()]
        rising = ends[-1] == ends[0] or (ends[-1] < ends[0]) == (better == "higher")
        values = np.array(factor.values, float)
        if rising:
            point = breaking_point(values, table, threshold, better=better)
        else:
            mirrored = breaking_point(-values[::-1], table[:, ::-1], threshold, better=better)
            flipped = [None if end is None else 0.0 - end for end in (mirrored.value, mirrored.high, mirrored.low)]
            point = BreakingPoint(flipped[0], flipped[1], flipped[2], mirrored.why)
        tried = (float(values[0]), float(values[-1]))
        found.append(Breaking(factor.key, variant, score, threshold, rising, point, tried))
    return found
