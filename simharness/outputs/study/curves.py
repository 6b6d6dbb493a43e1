"""Robustness curves of a study: scores against its factors, and their breaking points.

On axes keys have plain names with units. Losses say where a study loses its score: along a factor, as numbers and as
a sentence, and by cause in the worst setting.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import polars as pl
from pydantic import BaseModel

from mvpose.arrays import Floats
from mvpose.commands.progress import Reporter
from mvpose.files.input_files import parse_toml
from simharness.runtime.number_text import fixed
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.catalogue import SCORES, ScoreInfo
from simharness.statistics.breaking_points import BreakingPoint, breaking_point
from simharness.statistics.intervals import Interval, mean_interval
from simharness.study.causes.cause_shares import Blame, blame
from simharness.study.study_folder import Results


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


@cache
def axis_names() -> Mapping[str, str]:
    """Return the names of the keys that the studies of this project sweep."""
    return parse_toml((Path(__file__).parents[1] / "data" / "axis_names.toml").read_text(encoding="utf-8"))


_UNITS = (  # patterns in descriptions of keys, and the unit of each; the first match counts
    (r"degrees per minute", "degrees per minute"),
    (r"metres per minute", "m per minute"),
    (r"degrees", "degrees"),
    (r"metres", "m"),
    (r"seconds|^s(?=,)", "s"),
    (r"frames per second", "Hz"),
    (r"pixels|^px(?=,)", "px"),
    (r"newtons", "N"),
    (r"stops", "stops"),
    (r"relative", "relative"),
)


def axis_label(key: str) -> str:
    """Return the axis label of a key: its name in :func:`axis_names`, else itself, with the unit of its values."""
    unit = unit_of(key)
    name = axis_names().get(key, key)
    return f"{name}, {unit}" if unit else name


def unit_of(key: str) -> str:
    """Return the unit in the scenario's description of a dotted key; empty where the description has none."""
    description = _description(key)
    return next((unit for pattern, unit in _UNITS if re.search(rf"\b(?:{pattern})\b", description)), "")


def _description(key: str) -> str:
    """Return the description of a scenario key; empty for keys that are not in a scenario, such as a profile's name."""
    section: object = Scenario
    description = None
    for part in key.split("."):
        if not (isinstance(section, type) and issubclass(section, BaseModel)) or part not in section.model_fields:
            return ""
        field = section.model_fields[part]
        section, description = field.annotation, field.description
    return description or ""


LOST = 5.0
"""Points of a percentage whose loss is reported."""

_ALIKE = 0.02  # relative difference of breaking points that one number describes


@dataclass(frozen=True)
class Loss:
    """What a factor costs one variant.

    Attributes:
        variant: name of the variant.
        best, worst: values of the factor with the best and the worst mean score; of a numeric factor its two ends.
        at_best, at_worst: the scores there.
        point: value of a numeric factor at which :data:`LOST` points are lost against the best end, seed by seed; None
            for other factors, and for scores that are no percentages.
        rising: whether the score gets worse as the factor grows.
    """

    variant: str
    best: Any
    worst: Any
    at_best: Interval
    at_worst: Interval
    point: BreakingPoint | None
    rising: bool


def losses(factor: Factor, variants: Sequence[str], score: str) -> list[Loss]:
    """Return what a factor costs each variant; variants without the score at two values are left out."""
    info = SCORES[score]
    sign = 1.0 if info.better == "higher" else -1.0
    found = []
    for variant in variants:
        table = factor.table(variant, score)
        known = np.flatnonzero(np.isfinite(table).any(axis=0))
        if len(known) < 2:
            continue
        means = sign * np.array([table[np.isfinite(table[:, k]), k].mean() for k in known])
        if factor.numeric:
            rising = bool(means[-1] <= means[0])
            best, worst = (known[0], known[-1]) if rising else (known[-1], known[0])
        else:
            rising, best, worst = False, known[means.argmax()], known[means.argmin()]
        point = None
        if factor.numeric and info.unit == "%":
            change = sign * (table - table[:, [best]])
            _, point = breaking_along(np.array(factor.values, float), change, -LOST, better="higher", rising=rising)
        at_best, at_worst = (mean_interval(table[:, k], unit=info.unit) for k in (best, worst))
        found.append(Loss(variant, factor.values[best], factor.values[worst], at_best, at_worst, point, rising))
    return found


def finding(factor: Factor, variants: Sequence[str], score: str) -> str:
    """Return what was found along a factor as a sentence without its full stop; empty without data."""
    info, found = SCORES[score], losses(factor, variants, score)
    if not found:
        return ""
    points = {each.variant: each.point for each in found if each.point is not None and each.point.value is not None}
    if found[0].point is None or (found[0].at_best.mean == found[0].at_worst.mean and not points):
        return _ends(found[0], info)
    low, high = short(factor.values[0]), short(factor.values[-1])
    if not points:
        who = "No variant loses" if len(found) > 1 else f"{found[0].variant} does not lose"
        return f"{who} {LOST:g} points of {info.title} between {low} and {high}"
    side = {each.variant: "above" if each.rising else "below" for each in found}
    spared = [each.variant for each in found if each.variant not in points]
    head = f"{LOST:g} points of {info.title} are lost "
    if len(found) == 1:
        (variant,) = points
        return f"{variant} loses {LOST:g} points of {info.title} {side[variant]} {short(points[variant].value)}"
    return head + _listed(points, side) + (f"; not by {', '.join(spared)}" if spared else "")


def _listed(points: Mapping[str, BreakingPoint], side: Mapping[str, str]) -> str:
    """Return breaking points with their variants; variants with nearly the same point have one number."""
    groups: list[tuple[str, float, list[str]]] = []
    for variant, point in points.items():
        value = float(point.value or 0.0)
        for where, other, names in groups:
            if where == side[variant] and abs(value - other) <= _ALIKE * max(abs(value), abs(other)):
                names.append(variant)
                break
        else:
            groups.append((side[variant], value, [variant]))
    return ", ".join(f"{where} {short(value)} ({', '.join(names)})" for where, value, names in groups)


def _ends(loss: Loss, info: ScoreInfo) -> str:
    unit = f" {info.unit}" if info.unit else ""
    one, other = (fixed(each.mean, info.digits) for each in (loss.at_best, loss.at_worst))
    return f"{info.title} of {loss.variant}: {one}{unit} at {short(loss.best)}, {other}{unit} at {short(loss.worst)}"


def short(value: Any) -> str:
    """Return the text of a value of a factor with at most three digits."""
    if value is None:
        return "–"
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def blame_study(results: Results, *, seeds: int, workers: int = 1, reporter: Reporter | None = None) -> Blame:
    """Return what cost the first variant its PCP in the setting of the lowest PCP.

    Args:
        results: the study.
        seeds: number of seeds, from the first of the study on.
        workers: processes that share the seeds.
        reporter: receiver of progress.

    Raises:
        ValueError: no trial finished, or the trial cannot be built any more.
        RunError: any other error.
    """
    variant = next((name for name in results.info["variants"] if name in set(results.trials["variant"])), None)
    rows = results.trials.filter((pl.col("variant") == variant) & pl.col("pcp").is_not_null())
    if not len(rows):
        raise ValueError(f"{results.folder}: no trial of this study finished, so that there is no score to explain")
    keys = [*(("case",) if any(rows["case"]) else ()), *results.info["factors"]]
    means = rows.group_by("case", *results.info["factors"], maintain_order=True).agg(
        pl.col("pcp").mean(), pl.col("trial").first(), pl.col("seed").min()
    )
    worst = means.row(means["pcp"].arg_min(), named=True)
    scenario = results.scenario_of(worst["trial"]).model_copy(update={"seed": worst["seed"]})
    setting = ", ".join(f"{key} {worst[key]}" for key in keys)
    return blame(scenario, variant=variant, seeds=seeds, setting=setting, workers=workers, reporter=reporter)
