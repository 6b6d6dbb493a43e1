"""Digest of a study, to be committed with the code: its numbers with their provenance, a table and the curves.

The result tables and the page of a study are large and can be made again. A digest is small, in text form, JSON and
Markdown, and records the command, the seeds, the code and the libraries.
"""

import json
import math
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import polars as pl

from mvpose.commands.output_files import write_text
from mvpose.commands.progress import duration
from mvpose.report.documents import fill_template
from mvpose.report.svg_plots import plot_sheet
from simharness.outputs import texts_of
from simharness.outputs.study import plots, tables
from simharness.outputs.study.curves import axis_label, panels
from simharness.outputs.study.plots import mean_over
from simharness.outputs.study.tables import OVER_TIME
from simharness.runtime.number_text import fixed, short
from simharness.scoring.catalogue import AP_MM, SCORES
from simharness.scoring.failure_classes import FailureKind
from simharness.scoring.stage_blame import Stage
from simharness.statistics.intervals import Interval, mean_interval
from simharness.study.factors import THRESHOLDS, Factor, cases_of, factor_breaking_points, factors, factors_by_case
from simharness.study.study_folder import Results
from simharness.trial.identity import PROVENANCE, provenance_sentence
from tools.study_digest.failure_rates import failure_rates

HEADS = ("pcp", "recall", "precision", "mpjpe_mm", "map", "match_f1", "ghosts")
"""Scores of the first table of a digest."""
PRINTED = (*(f"ap{limit}" for limit in AP_MM), "map", "recall", "mpjpe_mm", "pcp", "ghosts")
"""Scores of one variant at every value of a factor, in the order in which papers print them for Panoptic."""
HEADS_OVER_TIME = ("hota", "assa", "idf1", "pcp_tracked", "switches_per_minute", "fragmentations", "jerk_ratio")
"""Scores of the second table, of studies with a variant that tracks people."""
COMPARED = ("pcp", "map", "ghosts")
"""Scores of all variants at every value of a factor."""

SCORED = tuple(dict.fromkeys(HEADS + PRINTED))
_OVER_TIME = tuple(dict.fromkeys((*HEADS_OVER_TIME, *tables.OVER_TIME)))  # where a variant tracks people

_CURVES = (("pcp", "map"), ("recall", "ghosts"))  # two scores in each row of the picture
_MAX_COLUMNS = 3  # panels of cases in a row


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
        write_text(text, folder / name, option="FOLDER")


def digest(results: Results, *, thresholds: Mapping[str, float] = THRESHOLDS) -> dict[str, Any]:
    """Return the numbers of a study, JSON-ready; means come with the ends of their 95 % intervals over seeds.

    Returns:
        The keys of :data:`simharness.trial.identity.PROVENANCE`, where ``seconds`` is the sum over all trials, and:
        ``means`` by variant, and ``cases`` with such means by case; ``factors`` with the scores at every value, and
        with the keys that these are means over; ``breaking`` points; ``by_case`` with factors and breaking points of
        each case separately, while the ones above pool all cases; ``failures``, see
        :func:`tools.study_digest.failure_rates.failure_rates`; ``time_ms`` of each stage.
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
        "time_ms": {
            variant: {
                stage: round(mean, 3)
                for stage, mean in tables.stage_means(trials.filter(pl.col("variant") == variant)).items()
            }
            for variant in names
        },
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


def markdown(digest: Mapping[str, Any]) -> str:
    """Return the text of a digest.

    Args:
        digest: from :func:`tools.study_digest.digest.digest`.
    """
    names, seeds = list(digest["means"]), digest["seeds"]
    parts = digest["by_case"] or {"": digest}
    kinds, stages = [str(kind) for kind in FailureKind], [str(stage) for stage in Stage]
    if not any("method" in failed["stages"] for failed in digest["failures"].values()):
        stages.remove("method")  # only user-defined estimators can have it
    described = (*HEADS, *HEADS_OVER_TIME) if "hota" in digest["means"][names[0]] else HEADS
    breaking: dict[tuple[str, ...], dict[str, str]] = {}
    for factor, case in product(digest["factors"], parts):
        for each in parts[case]["breaking"]:
            if each["factor"] == factor["key"]:
                row = (
                    f"`{each['factor']}`",
                    *([case] if case else []),
                    tables.broken(each["score"], each["threshold"]),
                )
                breaking.setdefault(row, {})[each["variant"]] = _broken(each, len(seeds))
    text = fill_template(
        "digest.md",
        folder=Path(__file__).parent,
        digest=digest,
        names=names,
        took=duration(digest["seconds"]),
        provenance=provenance_sentence(digest),
        condition=tables.condition(len(seeds)),
        cases={"": digest["means"], **digest["cases"]},
        heads=HEADS,
        heads_over_time=HEADS_OVER_TIME,
        described={SCORES[key].title: SCORES[key].about for key in described},
        factors={factor["key"]: _factor_parts(factor["key"], parts) for factor in digest["factors"]},
        compared=(*COMPARED, *OVER_TIME),
        printed=PRINTED,
        breaking=breaking,
        kinds={kind.replace("_", " "): SCORES[f"failures_{kind}"].about for kind in kinds},
        stages=stages,
        head=_head,
        short=short,
        interval=_interval,
        rate=_rate,
        alone=_alone,
    )
    return text + "\n"


def _factor_parts(key: str, parts: Mapping[str, Mapping[str, Any]]) -> tuple[str, dict[str, Mapping[str, Any]]]:
    """Return the axis of a factor, and its scores in each case by what they are against."""
    by_case = {}
    for case, part in parts.items():
        for factor in part["factors"]:
            if factor["key"] == key:
                along = ", ".join(f"`{other}`" for other in factor["along"])
                notes = [f"together with {along}"] if along else []
                notes += [mean_over(factor["over"])] if factor["over"] else []
                note = f" ({'; '.join(notes)})" if notes else ""
                by_case[f"`{key}`{f', case {case}' if case else ''}{note}"] = factor
    return f": {axis_label(key)}" if key in texts_of("axis_names") else "", by_case


def _rate(failed: Mapping[str, Any], column: str, key: str) -> str:
    if key not in failed[column]:
        return "0.0"
    low, high = failed["intervals"][column][key]
    return _with_ends(fixed(failed[column][key], 1), low, high, 1)


def _alone(failed: Mapping[str, Any]) -> str:
    if failed["matching_alone"] is None:
        return "–"
    low, high = failed["intervals"]["matching_alone"]
    return _with_ends(f"{fixed(failed['matching_alone'], 0)} %", low, high, 0)


def _with_ends(mean: str, low: float | None, high: float | None, digits: int) -> str:
    return mean if low is None or high is None else f"{mean} ({fixed(low, digits)} to {fixed(high, digits)})"


def _head(score: str) -> str:
    info = SCORES[score]
    return f"{info.title}, {info.unit}" if info.unit else info.title


def _interval(ends: Sequence[float | None] | None, score: str) -> str:
    """Return the text of the mean of a score and its interval."""
    mean, low, high = ends or (None, None, None)
    if mean is None:
        return "–"
    digits = SCORES[score].digits
    return _with_ends(fixed(mean, digits), low, high, digits)


def _broken(each: Mapping[str, Any], seeds: int) -> str:
    """Return the breaking point of a variant, with its interval where there are several seeds."""
    low, high = ("beyond" if end is None else f"{end:.3g}" for end in (each["low"], each["high"]))
    ends = f" ({low} to {high})" if seeds > 1 else ""
    if each["value"] is None:  # an interval that lies outside as well adds nothing
        outside = low == high == "beyond"
        return f"{'not within the range' if each['why'] == 'never' else 'at once'}{'' if outside else ends}"
    return f"{'above' if each['worse_when'] == 'greater' else 'below'} {each['value']:.3g}{ends}"
