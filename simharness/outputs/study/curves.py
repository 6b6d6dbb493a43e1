"""Robustness curves of a study: scores against its factors, and their breaking points.

On axes keys have plain names with units. Losses say where a study loses its score: along a factor, as numbers and as
a sentence, and by cause in the worst setting.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from mvpose.arrays import Floats
from mvpose.commands.progress import Reporter
from simharness.outputs import texts_of
from simharness.runtime.number_text import fixed, short
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.validation_messages import field_at
from simharness.scoring.catalogue import SCORES, ScoreInfo
from simharness.statistics.breaking_points import BreakingPoint
from simharness.statistics.intervals import Interval, mean_interval
from simharness.study.causes.cause_shares import Blame, blame
from simharness.study.factors import LOST, Factor, factor_breaking_points
from simharness.study.study_folder import Results


def panels(by_case: Mapping[str, Sequence[Factor]]) -> dict[str, dict[str, Factor]]:
    """Return the factors of :func:`factors_by_case` by key and then by case: the panels of one row of plots."""
    by_key: dict[str, dict[str, Factor]] = {}
    for case, swept in by_case.items():
        for factor in swept:
            by_key.setdefault(factor.key, {})[case] = factor
    return by_key


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


def curve_table(by_case: Mapping[str, Sequence[Factor]], variants: Sequence[str]) -> pl.DataFrame:
    """Return the points of all curves: a row for each case, factor, value, variant and score that applies there."""
    return pl.DataFrame(
        [
            (case, factor.key, str(value), variant, score, point.mean, point.low, point.high, point.n)
            for case, swept in by_case.items()
            for factor in swept
            for variant in variants
            for score in SCORES
            if score in factor.rows.columns
            for value, point in zip(factor.values, factor.line(variant, score), strict=True)
            if point.n
        ],
        schema=["case", "factor", "value", "variant", "score", "mean", "low", "high", "seeds"],
        orient="row",
    )


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
    """Return the axis label of a key: its name in ``data/axis_names.toml``, or itself, with the unit of its values."""
    unit = unit_of(key)
    name = texts_of("axis_names").get(key, key)
    return f"{name}, {unit}" if unit else name


def unit_of(key: str) -> str:
    """Return the unit in the scenario's description of a dotted key; empty where the description has none."""
    field = field_at(key.split("."), Scenario)  # None for keys that are not in a scenario, such as a profile's name
    description = "" if field is None else field.description or ""
    return next((unit for pattern, unit in _UNITS if re.search(rf"\b(?:{pattern})\b", description)), "")


_DIGITS = 3  # of a value of a factor
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
            point = factor_breaking_points(factor, [variant], score, -sign * LOST, relative=True)[0].point
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
    low, high = short(factor.values[0], _DIGITS), short(factor.values[-1], _DIGITS)
    if not points:
        who = "No variant loses" if len(found) > 1 else f"{found[0].variant} does not lose"
        return f"{who} {LOST:g} points of {info.title} between {low} and {high}"
    side = {each.variant: "above" if each.rising else "below" for each in found}
    spared = [each.variant for each in found if each.variant not in points]
    head = f"{LOST:g} points of {info.title} are lost "
    if len(found) == 1:
        ((variant, point),) = points.items()
        return f"{variant} loses {LOST:g} points of {info.title} {side[variant]} {short(point.value, _DIGITS)}"
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
    return ", ".join(f"{where} {short(value, _DIGITS)} ({', '.join(names)})" for where, value, names in groups)


def _ends(loss: Loss, info: ScoreInfo) -> str:
    unit = f" {info.unit}" if info.unit else ""
    one, other = (fixed(each.mean, info.digits) for each in (loss.at_best, loss.at_worst))
    best, worst = (short(each, _DIGITS) for each in (loss.best, loss.worst))
    return f"{info.title} of {loss.variant}: {one}{unit} at {best}, {other}{unit} at {worst}"


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
