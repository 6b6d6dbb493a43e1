"""Digest of a study, to be committed with the code: its numbers with their provenance, a table and the curves.

The result tables and the page of a study are large and can be made again. A digest is small, in text form, and records
the command, the seeds, the code and the libraries.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from mvpose.commands.output_files import write_text
from mvpose.report.svg_plots import plot_sheet
from simharness.outputs.study import plots, tables
from simharness.outputs.study.curves import Factor, cases_of, factor_breaking_points, factors, factors_by_case, panels
from simharness.outputs.study.digest_text import HEADS, HEADS_OVER_TIME, PRINTED, markdown
from simharness.outputs.study.failure_section import failure_rates
from simharness.outputs.study.page import THRESHOLDS
from simharness.scoring.catalogue import SCORES
from simharness.statistics.intervals import Interval, mean_interval
from simharness.study.study_folder import Results
from simharness.trial.identity import PROVENANCE

SCORED = tuple(dict.fromkeys(HEADS + PRINTED))
_OVER_TIME = tuple(dict.fromkeys((*HEADS_OVER_TIME, *tables.OVER_TIME)))  # where a variant tracks people

_CURVES = (("pcp", "map"), ("recall", "ghosts"))  # two scores in each row of the picture
_MAX_COLUMNS = 3  # panels of cases in a row
_STAGES = ("affinity", "matching", "reconstruction")


def write_digest(results: Results, folder: Path, *, thresholds: Mapping[str, float] = THRESHOLDS) -> None:
    """Write ``digest.json``, ``table.md`` and, for a study with factors, ``curves.svg`` into a folder.

    Args:
        results: a study whose trials all finished.
        folder: a new folder, or one with an older digest, whose files are replaced.
        thresholds: as in :func:`simharness.outputs.study.page.render_study`.

    Raises:
        ValueError: trials failed, or the folder holds something else.
    """
    if results.info["failed"]:
        raise ValueError(
            f"{results.folder}: {len(results.info['failed'])} trials failed, and a digest would leave them out; run "
            "the study again"
        )
    if folder.exists() and not (folder / "digest.json").is_file():
        raise ValueError(f"{folder} exists and holds no digest; name another folder")
    numbers = digest(results, thresholds=thresholds)
    files = {"table.md": markdown(numbers)}
    if numbers["factors"]:
        files["curves.svg"] = curves(results, thresholds=thresholds)
    files["digest.json"] = json.dumps(numbers, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    for name, text in files.items():  # without a manifest, because people keep these few files with their code
        write_text(text, folder / name, option="--digest")


def digest(results: Results, *, thresholds: Mapping[str, float] = THRESHOLDS) -> dict[str, Any]:
    """Return the numbers of a study, JSON-ready; means come with the ends of their 95 % intervals over seeds.

    Returns:
        The keys of :data:`simharness.trial.identity.PROVENANCE`, where ``seconds`` is the sum over all trials, and:
        ``means`` by variant, and ``cases`` with such means by case; ``factors`` with the scores at every value, and
        with the keys that these are means over; ``breaking`` points; ``by_case`` with factors and breaking points of
        each case separately, while the ones above pool all cases; ``failures``, see
        :func:`simharness.outputs.study.failure_section.failure_rates`; ``time_ms`` of each stage.
    """
    info, trials = results.info, results.trials
    names: list[str] = info["variants"]
    cases = cases_of(results)
    scored = (*SCORED, *(_OVER_TIME if tables.tracks_people(trials) else ()))
    return {
        "name": info["name"],
        "description": info["description"],
        **{key: info[key] for key in PROVENANCE},
        "seconds": round(float(trials["seconds"].sum()), 1),  # the run's time leaves out trials of earlier runs
        "trials": info["trials"],
        "one_at_a_time": info["one_at_a_time"],
        "means": _means(trials, names, scored),
        "cases": {case: _means(trials.filter(pl.col("case") == case), names, scored) for case in cases},
        **_swept(factors(results), names, thresholds, scored),
        "by_case": {case: _swept(factors(results, case), names, thresholds, scored) for case in cases},
        "failures": {variant: failure_rates(results, variant) for variant in names},
        "time_ms": {variant: _times(trials.filter(pl.col("variant") == variant)) for variant in names},
    }


def curves(results: Results, *, thresholds: Mapping[str, float] = THRESHOLDS) -> str:
    """Return the curves of a study as one SVG file: PCP, mAP, recall and ghosts against every factor.

    In a study with cases every score has its own rows, with a panel for each case, all on one scale.
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
    """Return plots in as few rows as possible, about as many in each."""
    count = -(-len(drawn) // _MAX_COLUMNS)
    across = -(-len(drawn) // count)
    return [list(drawn[start : start + across]) for start in range(0, len(drawn), across)]


def _notes(factor: Factor) -> list[str]:
    """Return the notes below the axis of a factor: keys that change with it, and keys that means are over."""
    along = (
        f"together with {', '.join(factor.along)}" if len(factor.along) < 3 else f"and {len(factor.along)} other keys"
    )
    return [text for text in (along if factor.along else "", plots.mean_over(factor.over)) if text]


def _swept(
    swept: Sequence[Factor], names: Sequence[str], thresholds: Mapping[str, float], scored: Sequence[str]
) -> dict[str, Any]:
    """Return factors with their scores, and the breaking points."""
    return {
        "factors": [_factor(factor, names, scored) for factor in swept],
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
            for each in factor_breaking_points(factor, names, score, threshold)
        ],
    }


def _means(trials: pl.DataFrame, names: Sequence[str], scored: Sequence[str]) -> dict[str, dict[str, Any]]:
    return {
        name: {
            score: _ends(
                mean_interval(
                    list(tables.by_seed(trials.filter(pl.col("variant") == name), score).values()),
                    unit=SCORES[score].unit,
                )
            )
            for score in scored
        }
        for name in names
    }


def _factor(factor: Factor, names: Sequence[str], scored: Sequence[str]) -> dict[str, Any]:
    return {
        "key": factor.key,
        "along": list(factor.along),
        "over": {key: list(values) for key, values in factor.over.items()},
        "values": list(factor.values),
        "scores": {
            name: {score: [_ends(each) for each in factor.line(name, score)] for score in scored} for name in names
        },
    }


def _ends(interval: Interval) -> list[float | None] | None:
    """Return mean, low and high; None without data, and None for ends that do not exist."""
    if not interval.n:
        return None
    return [round(end, 4) if math.isfinite(end) else None for end in (interval.mean, interval.low, interval.high)]


def _times(trials: pl.DataFrame) -> dict[str, float]:
    """Return the time of each stage, ms: means over trials of the medians over frames."""
    columns = {**{stage: f"time_{stage}_ms" for stage in _STAGES}, "total": "time_ms"}
    means = {stage: trials[column].mean() for stage, column in columns.items()}
    return {stage: round(float(mean), 3) for stage, mean in means.items() if isinstance(mean, int | float)}
