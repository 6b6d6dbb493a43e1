"""What is kept of a study beside the code: its numbers with where they come from, a table to read, and its curves.

The tables and the page of a study are large and can be made again; a digest is small, in text, and says with what
command, seeds, code and libraries it was made.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from simharness.report.figures.svg_plots import plot_sheet
from simharness.report.study import plots, tables
from simharness.report.study.curves import Factor, breaking, cases_of, factors, factors_by_case, panels
from simharness.report.study.digest_text import HEADS, PRINTED, markdown
from simharness.report.study.failure_rates import failure_rates
from simharness.report.study.page import THRESHOLDS
from simharness.runtime.atomic_files import appearing
from simharness.scoring.catalogue import SCORES
from simharness.statistics.comparison import Interval, mean_interval
from simharness.study.result_folder import Results
from simharness.trial.provenance import PROVENANCE

SCORED = tuple(dict.fromkeys(HEADS + PRINTED))
"""The scores of a digest."""

_CURVES = (("pcp", "map"), ("recall", "ghosts"))  # as they stand in the picture
_ACROSS = 3  # panels of cases beside each other
_STAGES = ("affinity", "matching", "reconstruction")


def write_digest(results: Results, folder: Path, *, thresholds: Mapping[str, float] = THRESHOLDS) -> None:
    """Write ``digest.json``, ``table.md`` and, of a study that sweeps something, ``curves.svg`` into a folder.

    Args:
        results: a study, all of whose trials finished.
        folder: appears whole, in the place of an older digest.
        thresholds: as of :func:`simharness.report.study.page.render_study`.

    Raises:
        ValueError: trials failed, or the folder holds something else.
    """
    if results.info["failed"]:
        raise ValueError(
            f"{results.folder}: {len(results.info['failed'])} trials failed, and a digest of the others would not say "
            "so; run the study again"
        )
    if folder.exists() and not (folder / "digest.json").is_file():
        raise ValueError(f"{folder} is there and holds no digest: name another folder")
    told = digest(results, thresholds=thresholds)
    with appearing(folder) as partial:
        text = json.dumps(told, indent=1, ensure_ascii=False, allow_nan=False)
        (partial / "digest.json").write_text(text + "\n", encoding="utf-8")
        (partial / "table.md").write_text(markdown(told), encoding="utf-8")
        if told["factors"]:
            (partial / "curves.svg").write_text(curves(results, thresholds=thresholds), encoding="utf-8")


def digest(results: Results, *, thresholds: Mapping[str, float] = THRESHOLDS) -> dict[str, Any]:
    """The numbers of a study, JSON-ready; means with the ends of their 95 % intervals over seeds.

    Beside the keys of :data:`simharness.trial.provenance.PROVENANCE`, of which ``seconds`` are those of all trials, one
    after the other: ``means`` of the variants and, where there are
    any, of ``cases`` by name; ``factors`` with the scores at every value and with what these are means over;
    ``breaking`` points; ``by_case``, of a study with cases, the factors and breaking points of each by itself, where
    those above are of the means over all cases; ``failures`` as
    :func:`simharness.report.study.failure_rates.failure_rates` has them; ``time_ms`` of each stage.
    """
    info, trials = results.info, results.trials
    names: list[str] = info["variants"]
    cases = cases_of(results)
    return {
        "name": info["name"],
        "description": info["description"],
        **{key: info[key] for key in PROVENANCE},
        "seconds": round(float(trials["seconds"].sum()), 1),  # those of the run leave out trials that were there before
        "trials": info["trials"],
        "one_at_a_time": info["one_at_a_time"],
        "means": _means(trials, names),
        "cases": {case: _means(trials.filter(pl.col("case") == case), names) for case in cases},
        **_swept(factors(results), names, thresholds),
        "by_case": {case: _swept(factors(results, case), names, thresholds) for case in cases},
        "failures": {variant: failure_rates(results, variant) for variant in names},
        "time_ms": {variant: _times(trials.filter(pl.col("variant") == variant)) for variant in names},
    }


def curves(results: Results, *, thresholds: Mapping[str, float] = THRESHOLDS) -> str:
    """The curves of a study, a picture of its own (SVG): for every factor PCP, mAP, recall and ghosts.

    Of a study with cases every score has a row, or rows, of a panel for each case, on one scale.
    """
    names = results.info["variants"]

    def panels_of(index: int, by_case: Mapping[str, Factor], score: str) -> list[str]:
        lines = {case: {variant: factor.line(variant, score) for variant in names} for case, factor in by_case.items()}
        every = [line for each in lines.values() for line in each.values()]
        return [
            plots.curve(
                "-".join(filter(None, ("curve", str(index), score, case))),
                factor=factor.key,
                values=factor.values,
                numeric=factor.numeric,
                lines=lines[case],
                score=SCORES[score],
                threshold=thresholds.get(score),
                title=case,
                notes=_notes(factor),
                beside=every,
            )
            for case, factor in by_case.items()
        ]

    rows: list[list[str]] = []
    for index, by_case in enumerate(panels(factors_by_case(results)).values()):
        for pair in _CURVES:
            if "" in by_case:
                rows.append([plot for score in pair for plot in panels_of(index, by_case, score)])
            else:
                rows += [row for score in pair for row in _in_rows(panels_of(index, by_case, score))]
    return plot_sheet(rows)


def _in_rows(drawn: Sequence[str]) -> list[list[str]]:
    """Plots in as few rows as there must be, about as many in each."""
    count = -(-len(drawn) // _ACROSS)
    across = -(-len(drawn) // count)
    return [list(drawn[start : start + across]) for start in range(0, len(drawn), across)]


def _notes(factor: Factor) -> list[str]:
    """What is said below the axis of a factor: what goes with it, and what a mean is over."""
    along = (
        f"together with {', '.join(factor.along)}" if len(factor.along) < 3 else f"and {len(factor.along)} other keys"
    )
    return [text for text in (along if factor.along else "", plots.mean_over(factor.over)) if text]


def _swept(swept: Sequence[Factor], names: Sequence[str], thresholds: Mapping[str, float]) -> dict[str, Any]:
    """Factors with their scores, and where these break."""
    return {
        "factors": [_factor(factor, names) for factor in swept],
        "breaking": [
            {
                "factor": each.factor,
                "variant": each.variant,
                "score": score,
                "threshold": threshold,
                "worse_when": "greater" if each.rising else "less",
                "value": each.point.value,
                "low": each.point.low,
                "high": each.point.high,
                "why": each.point.why,
            }
            for score, threshold in thresholds.items()
            for factor in swept
            if factor.numeric
            for each in breaking(factor, names, score, threshold)
        ],
    }


def _means(trials: pl.DataFrame, names: Sequence[str]) -> dict[str, dict[str, Any]]:
    return {
        name: {
            score: _ends(mean_interval(list(tables.by_seed(trials.filter(pl.col("variant") == name), score).values())))
            for score in SCORED
        }
        for name in names
    }


def _factor(factor: Factor, names: Sequence[str]) -> dict[str, Any]:
    return {
        "key": factor.key,
        "along": list(factor.along),
        "over": {key: list(values) for key, values in factor.over.items()},
        "values": list(factor.values),
        "scores": {
            name: {score: [_ends(each) for each in factor.line(name, score)] for score in SCORED} for name in names
        },
    }


def _ends(interval: Interval) -> list[float | None] | None:
    """Mean, low and high; None without any, and None for ends that there are not."""
    if not interval.n:
        return None
    return [round(end, 4) if math.isfinite(end) else None for end in (interval.mean, interval.low, interval.high)]


def _times(mine: pl.DataFrame) -> dict[str, float]:
    """Means over trials of the medians over frames."""
    columns = {**{stage: f"time_{stage}_ms" for stage in _STAGES}, "total": "time_ms"}
    means = {stage: mine[column].mean() for stage, column in columns.items()}
    return {stage: round(float(mean), 3) for stage, mean in means.items() if isinstance(mean, int | float)}
