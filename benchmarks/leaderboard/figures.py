"""Figures of the leaderboard: means with intervals, and differences from the best of ours."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import polars as pl

from benchmarks.leaderboard.entries import Entry
from mvpose.files.atomic_files import write_atomic
from simharness.outputs.study.tables import by_seed
from simharness.scoring.catalogue import SCORES
from simharness.statistics.intervals import mean_interval
from simharness.statistics.many_tests import holm
from simharness.statistics.paired_tests import paired

OVERALL = ("pcp", "precision", "recall", "mpjpe_mm", "ghosts", "time_ms")
"""Scores over all settings of a study."""

DIFFERENCE = "pcp minus best of ours"
"""Name of the difference of PCP, which has no score of its own."""

RIG_SCORES = ("ap25", "ap50", "ap100", "map", "mpjpe_mm", "pcp", "recall")
"""Scores of each rig, those of tables on Panoptic among them."""

HOME = "cmu0"
"""Rig that learned methods are trained on, with which the others are compared."""

CHANGE = " minus that of cmu0"
"""End of the name of a difference of a score from that with :data:`HOME`."""

ALL = "all"
"""Setting of a figure over all settings."""

SIGNIFICANT = 0.05
"""Adjusted p-value below which a difference is significant."""


@dataclass(frozen=True)
class Figure:
    """A number of a method."""

    method: str
    """Name of the entry."""
    setting: str
    """Case or value of the swept key, or :data:`ALL`."""
    score: str
    """Key of the score, or :data:`DIFFERENCE`."""
    value: float
    """Mean; NaN where it does not apply."""
    low: float
    """Lower end of the 95 % interval; NaN without one."""
    high: float
    """Upper end."""
    n: int
    """Number of seeds, or of blocks of frames."""
    p: float = math.nan
    """Adjusted p-value of a difference; NaN where it is not tested."""


def study_figures(
    trials: pl.DataFrame, entries: Sequence[Entry], key: str, scores: Sequence[str] = ("pcp",)
) -> list[Figure]:
    """Return the figures of a study: scores in each setting, scores over all settings, and differences of PCP.

    Intervals and pairs are over seeds, whose score is the mean over settings. P-values are adjusted by Holm's method.

    Args:
        trials: table of the trials of the study.
        entries: methods, in the order of the figures.
        key: column that tells settings apart.
        scores: scores of each setting.
    """
    rows = {entry.name: trials.filter(pl.col("variant") == entry.name) for entry in entries}
    settings = trials[key].unique(maintain_order=True).to_list()
    found = [
        _mean(name, str(setting), table.filter(pl.col(key) == setting), score)
        for name, table in rows.items()
        for setting in settings
        for score in scores
    ]
    found += [_mean(name, ALL, table, score) for name, table in rows.items() for score in OVERALL]
    base = rows[best_of_ours(found, entries)]
    reference = by_seed(base, "pcp")
    differences = {
        name: paired([reference.get(seed) for seed in others], list(others.values()))
        for name, table in rows.items()
        if table is not base and (others := by_seed(table, "pcp"))
    }
    adjusted = dict(zip(differences, holm([each.p for each in differences.values()]), strict=True))
    return found + [
        Figure(name, ALL, DIFFERENCE, each.difference, each.low, each.high, each.n, adjusted[name])
        for name, each in differences.items()
    ]


def rig_changes(trials: pl.DataFrame, entries: Sequence[Entry], key: str) -> list[Figure]:
    """Return what other rigs than :data:`HOME` change, paired by seed: mAP, MPJPE and PCP of each method.

    Args:
        trials: table of the trials of the study.
        entries: methods, in the order of the figures.
        key: column of the rig.
    """
    rigs = [rig for rig in trials[key].unique(maintain_order=True).to_list() if rig != HOME]
    found = []
    for entry in entries:
        table = trials.filter(pl.col("variant") == entry.name)
        for score in ("map", "mpjpe_mm", "pcp"):
            home = by_seed(table.filter(pl.col(key) == HOME), score)
            for rig in rigs:
                other = by_seed(table.filter(pl.col(key) == rig), score)
                each = paired([home.get(seed) for seed in other], list(other.values()))
                found.append(Figure(entry.name, rig, score + CHANGE, each.difference, each.low, each.high, each.n))
    return found


def best_of_ours(figures: Sequence[Figure], entries: Sequence[Entry]) -> str:
    """Return the name of ours with the highest PCP over all settings."""
    ours = {entry.name for entry in entries if entry.ours}
    known = [each for each in figures if each.method in ours and each.setting == ALL and each.score == "pcp"]
    return max(known, key=lambda each: each.value).method


def _mean(method: str, setting: str, rows: pl.DataFrame, score: str) -> Figure:
    mean = mean_interval(list(by_seed(rows, score).values()), unit=SCORES[score].unit)
    return Figure(method, setting, score, mean.mean, mean.low, mean.high, mean.n)


def write_csv(figures: Sequence[Figure], path: Path) -> None:
    """Write figures as a table with a row for each; missing numbers are empty."""
    text = io.StringIO()
    names = [field.name for field in fields(Figure)]
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    for figure in figures:
        values = asdict(figure).items()
        writer.writerow(
            {name: "" if isinstance(value, float) and math.isnan(value) else value for name, value in values}
        )
    write_atomic(path, text.getvalue().encode())


def by_method(figures: Sequence[Figure]) -> Mapping[str, Mapping[tuple[str, str], Figure]]:
    """Return figures by method, and then by setting and score."""
    found: dict[str, dict[tuple[str, str], Figure]] = {}
    for figure in figures:
        found.setdefault(figure.method, {})[figure.setting, figure.score] = figure
    return found
