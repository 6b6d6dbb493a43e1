"""The tables of a study: means over scenes with their intervals, variants beside each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from simharness.report.run.headline import NOTHING
from simharness.report.study.curves import Breaking
from simharness.scoring.catalogue import SCORES, ScoreInfo
from simharness.statistics.comparison import Interval, holm, mean_interval, paired

COLUMNS: tuple[ScoreInfo, ...] = tuple(
    SCORES[key] for key in ("pcp", "recall", "precision", "mpjpe_mm", "map", "match_f1", "ghosts", "time_ms")
)
"""The scores of the headline table."""

SURE = 0.05
"""Adjusted p under which a difference is shown as one."""

_OF_A_VARIANT = ("variant", "seconds", "scenario")  # columns that say nothing of the setting; scores do not, either
_OTHER = ", the other variant's"  # no column of a study is called so


@dataclass(frozen=True)
class Cell:
    """A number in a table: what it is, and what is said small below it."""

    text: str
    small: str = ""
    strong: bool = False


def by_seed(rows: pl.DataFrame, score: str) -> dict[int, float]:
    """A score at each seed: the mean over the settings; seeds to which it does not apply are left out.

    Settings at one seed have their people in common, so the seed is the scene that intervals are over.
    """
    means = rows.group_by("seed").agg(pl.col(score).mean()).drop_nulls(score).sort("seed")
    return dict(zip(means["seed"].to_list(), means[score].to_list(), strict=True))


def cell(interval: Interval, score: ScoreInfo) -> Cell:
    """A mean, its interval small below it."""
    if not interval.n:
        return Cell(NOTHING)
    return Cell(number(interval.mean, score), ends(interval, score))


def number(value: float, score: ScoreInfo) -> str:
    """A value of a score."""
    return f"{value:.{score.digits}f}" if np.isfinite(value) else NOTHING


def ends(interval: Interval, score: ScoreInfo) -> str:
    """The ends of an interval; nothing where there is none."""
    if not np.isfinite([interval.low, interval.high]).all():
        return ""
    return f"{interval.low:.{score.digits}f} to {interval.high:.{score.digits}f}"


def headline(trials: pl.DataFrame, variants: Sequence[str]) -> dict[str, list[Cell]]:
    """A row for each variant, a cell for each of :data:`COLUMNS`.

    A mean is over the settings where the score applies to that variant, which need not be those of another one: how
    two variants differ is what :func:`compared` says, not the difference of their means.
    """
    rows = {}
    for variant in variants:
        mine = trials.filter(pl.col("variant") == variant)
        rows[variant] = [cell(mean_interval(list(by_seed(mine, info.key).values())), info) for info in COLUMNS]
    return rows


def every(trials: pl.DataFrame, variants: Sequence[str]) -> list[tuple[ScoreInfo, list[Cell]]]:
    """Every score that applies to any variant: a row each, a cell for each variant.

    Means are over the settings where the score applies to that variant, as in :func:`headline`.
    """
    rows = []
    for info in SCORES.values():
        means = [
            mean_interval(list(by_seed(trials.filter(pl.col("variant") == variant), info.key).values()))
            for variant in variants
        ]
        if any(mean.n for mean in means):
            rows.append((info, [cell(mean, info) for mean in means]))
    return rows


def cases(trials: pl.DataFrame, variants: Sequence[str]) -> dict[str, dict[str, list[Cell]]]:
    """A headline table for each case; none where the study has no cases."""
    names = [name for name in dict.fromkeys(trials["case"]) if name]
    return {name: headline(trials.filter(pl.col("case") == name), variants) for name in names}


def compared(trials: pl.DataFrame, variants: Sequence[str]) -> dict[str, list[Cell]]:
    """How each further variant differs from the first: at each seed over the settings where both have the score.

    A difference is strong where Holm's adjusted p over all cells is under :data:`SURE`; time is left out, for other
    work on the machine shifts it.
    """
    found: list[tuple[str, ScoreInfo, Any]] = []
    first, *others = variants
    base = trials.filter(pl.col("variant") == first)
    where = [column for column in trials.columns if column not in (*SCORES, *_OF_A_VARIANT)]  # setting and seed
    for variant in others:
        mine = trials.filter(pl.col("variant") == variant)
        pairs = base.join(mine, on=where, suffix=_OTHER, nulls_equal=True, maintain_order="left")
        for info in COLUMNS:
            both = pairs.drop_nulls([info.key, f"{info.key}{_OTHER}"])
            before, after = by_seed(both, info.key), by_seed(both, f"{info.key}{_OTHER}")
            found.append((variant, info, paired(list(before.values()), list(after.values()))))
    tested = [each for each in found if each[1].key != "time_ms"]
    adjusted = dict(zip([(each[0], each[1].key) for each in tested], holm([each[2].p for each in tested]), strict=True))
    rows: dict[str, list[Cell]] = {variant: [] for variant in others}
    for variant, info, pair in found:
        if not pair.n:
            rows[variant].append(Cell(NOTHING))
            continue
        small = ""
        if np.isfinite(pair.low):
            small = f"{_signed(pair.low, info)} to {_signed(pair.high, info)}"
        sure = adjusted.get((variant, info.key), 1.0) < SURE
        rows[variant].append(Cell(_signed(pair.difference, info), small, sure))
    return rows


def _signed(value: float, score: ScoreInfo) -> str:
    """A difference with its sign; none where it rounds to nothing."""
    written = f"{value:+.{score.digits}f}"
    return written.replace("-", "−") if float(written) else written[1:]


def breaking_cell(found: Breaking | None) -> Cell:
    """Where a variant breaks, in words."""
    if found is None:
        return Cell(NOTHING)
    low, high = found.tried
    point = found.point
    side = "above" if found.rising else "below"
    small = ""
    if point.low is not None or point.high is not None:
        least = f"{_short(low)} or less" if point.low is None else _short(point.low)
        most = f"{_short(high)} or more" if point.high is None else _short(point.high)
        small = f"{least} to {most}"
    if point.why == "never":
        return Cell(f"not from {_short(low)} to {_short(high)}", small)
    if point.why == "at once":
        return Cell(f"already at {_short(low if found.rising else high)}", small)
    assert point.value is not None  # where it crosses
    return Cell(f"{side} {_short(point.value)}", small, strong=True)


def _short(value: float) -> str:
    return f"{value:.3g}"


def failure_amounts(
    failures: pl.DataFrame, frames: Mapping[str, int], variants: Sequence[str], column: str
) -> dict[str, dict[str, float]]:
    """Failures of each variant in 100 frames, by a column of the table of failures.

    Args:
        failures: of the study.
        frames: judged, of each variant.
        variants: in order.
        column: ``kind`` or ``stage``; null is "not looked into".
    """
    amounts: dict[str, dict[str, float]] = {}
    for variant in variants:
        mine = failures.filter(pl.col("variant") == variant)[column].fill_null("not looked into")
        counts = dict(mine.value_counts().iter_rows())
        amounts[variant] = {key: 100 * count / max(1, frames.get(variant, 0)) for key, count in counts.items()}
    return amounts
