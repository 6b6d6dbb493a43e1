"""What is kept of a study beside the code: its numbers with where they come from, a table to read, and its curves.

The tables and the page of a study are large and can be made again; a digest is small, in text, and says with what
command, seeds, code and libraries it was made.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from simharness.experiment.atomic import appearing
from simharness.report import study_plots, tables
from simharness.report.curves import Factor, breaking, factors
from simharness.report.markdown import duration, origin, table
from simharness.report.sheet import sheet
from simharness.report.study import THRESHOLDS
from simharness.scoring.catalogue import AP_MM, SCORES
from simharness.scoring.statistics import Interval, mean_interval
from simharness.study.provenance import PROVENANCE
from simharness.study.results import Results

HEADS = ("pcp", "recall", "precision", "mpjpe_mm", "map", "match_f1", "ghosts")
"""The scores of a digest's first table."""
PRINTED = (*(f"ap{limit}" for limit in AP_MM), "map", "recall", "mpjpe_mm", "pcp", "ghosts")
"""The scores of one variant at every value of a factor, in the form in which papers print Panoptic."""
SCORED = tuple(dict.fromkeys(HEADS + PRINTED))
"""The scores of a digest."""

_CURVES = (("pcp", "map"), ("recall", "ghosts"))  # as they stand in the picture
_STAGES = ("affinity", "matching", "reconstruction")


def write_digest(results: Results, folder: Path, *, thresholds: Mapping[str, float] = THRESHOLDS) -> None:
    """Write ``digest.json``, ``table.md`` and, of a study that sweeps something, ``curves.svg`` into a folder.

    Args:
        results: a study, all of whose trials finished.
        folder: appears whole, in the place of an older digest.
        thresholds: as of :func:`simharness.report.study.render_study`.

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

    Beside the keys of :data:`simharness.study.provenance.PROVENANCE`, of which ``seconds`` are those of all trials, one
    after the other: ``means`` of the variants and, where there are
    any, of ``cases`` by name; ``factors`` with the scores at every value; ``breaking`` points; ``failures`` in 100
    frames by kind and by stage, and the share of them that the right matching of the real detections would have mended;
    ``time_ms`` of each stage.
    """
    info, trials = results.info, results.trials
    names: list[str] = info["variants"]
    swept = factors(results)
    cases = [case for case in dict.fromkeys(trials["case"]) if case]
    return {
        "name": info["name"],
        "description": info["description"],
        **{key: info[key] for key in PROVENANCE},
        "seconds": round(float(trials["seconds"].sum()), 1),  # those of the run leave out trials that were there before
        "trials": info["trials"],
        "one_at_a_time": info["one_at_a_time"],
        "means": _means(trials, names),
        "cases": {case: _means(trials.filter(pl.col("case") == case), names) for case in cases},
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
        "failures": {variant: _failures(results, variant) for variant in names},
        "time_ms": {variant: _times(trials.filter(pl.col("variant") == variant)) for variant in names},
    }


def curves(results: Results, *, thresholds: Mapping[str, float] = THRESHOLDS) -> str:
    """The curves of a study, a picture of its own (SVG): for every factor PCP, mAP, recall and ghosts."""
    names = results.info["variants"]

    def plot(index: int, factor: Factor, score: str) -> str:
        return study_plots.curve(
            f"curve-{index}-{score}",
            factor=factor.key,
            values=factor.values,
            numeric=factor.numeric,
            lines={variant: factor.line(variant, score) for variant in names},
            score=SCORES[score],
            threshold=thresholds.get(score),
        )

    swept = list(enumerate(factors(results)))
    return sheet([[plot(index, factor, score) for score in row] for index, factor in swept for row in _CURVES])


def markdown(told: Mapping[str, Any]) -> str:
    """A digest as a text to read."""
    return "\n".join(_lines(told)) + "\n"


def _lines(told: Mapping[str, Any]) -> Iterator[str]:
    names = list(told["means"])
    seeds, took = told["seeds"], duration(told["seconds"])
    yield f"# {told['name']}"
    yield f"\n{told['description']}. {told['trials']} trials, seeds {min(seeds)} to {max(seeds)}, {took} of one core."
    yield f"\n    {told['command']}"
    yield f"\n{origin(told)}"
    yield "\nMeans over seeds, each the mean over its settings, with 95 % intervals over seeds.\n"
    heads = [_head(key) for key in HEADS]
    for case, means in {"": told["means"], **told["cases"]}.items():
        if case:
            yield f"\nCase {case}:\n"
        yield from table(["variant", *heads], [[name, *(_said(means[name][k], k) for k in HEADS)] for name in names])
    for factor in told["factors"]:
        along = f" (with {', '.join(factor['along'])})" if factor["along"] else ""
        yield f"\nPCP, %, against `{factor['key']}`{along}:\n"
        rows = [
            [study_plots.short(value), *(_said(factor["scores"][name]["pcp"][row], "pcp") for name in names)]
            for row, value in enumerate(factor["values"])
        ]
        yield from table([factor["key"], *names], rows)
        first = names[0]
        yield f"\n`{first}`, all scores, against `{factor['key']}`{along}:\n"
        rows = [
            [study_plots.short(value), *(_mean(factor["scores"][first][key][row], key) for key in PRINTED)]
            for row, value in enumerate(factor["values"])
        ]
        yield from table([factor["key"], *(_head(key) for key in PRINTED)], rows)
    if told["breaking"]:
        yield "\nBreaking points: where the mean passes the threshold.\n"
        rows = [
            [
                f"`{each['factor']}`",
                each["variant"],
                f"{SCORES[each['score']].title} {each['threshold']:g}",
                _broken(each),
            ]
            for each in told["breaking"]
        ]
        yield from table(["factor", "variant", "score", "at"], rows)
    yield "\nFailures in 100 frames, and the share that right matching of the real detections would mend.\n"
    kinds, stages = list(study_plots.KIND_COLORS), list(study_plots.BLAME_COLORS)
    if not any("method" in failed["stages"] for failed in told["failures"].values()):
        stages.remove("method")  # which only methods from elsewhere are blamed as
    rows = [
        [
            name,
            *(f"{failed['kinds'].get(kind, 0):.1f}" for kind in kinds),
            *(f"{failed['stages'].get(stage, 0):.1f}" for stage in stages),
            "–" if failed["matching_alone"] is None else f"{failed['matching_alone']:.0f} %",
        ]
        for name, failed in told["failures"].items()
    ]
    heads = [kind.replace("_", " ") for kind in kinds]
    yield from table(["variant", *heads, *(f"by {stage}" for stage in stages), "matching alone"], rows)


def _head(score: str) -> str:
    info = SCORES[score]
    return f"{info.title}, {info.unit}" if info.unit else info.title


def _mean(ends: Sequence[float] | None, score: str) -> str:
    return "–" if ends is None else f"{ends[0]:.{SCORES[score].digits}f}"


def _said(ends: Sequence[float] | None, score: str) -> str:
    """A mean and its interval."""
    if ends is None:
        return "–"
    digits = SCORES[score].digits
    mean, low, high = (None if end is None else f"{end:.{digits}f}" for end in ends)
    return f"{mean}" if low is None else f"{mean} ({low} to {high})"


def _broken(each: Mapping[str, Any]) -> str:
    if each["why"] == "never":
        return "not within the range"
    if each["why"] == "at once":
        return "at once"
    low, high = ("beyond" if end is None else f"{end:.3g}" for end in (each["low"], each["high"]))
    return f"{each['worse_when']} than {each['value']:.3g} ({low} to {high})"


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


def _failures(results: Results, variant: str) -> dict[str, Any]:
    frames = {variant: len(results.frames.filter(pl.col("variant") == variant))}
    mine = results.failures.filter(pl.col("variant") == variant)
    known = mine["matching_alone"].drop_nulls()
    return {
        **{
            f"{column}s": {
                key: round(amount, 3)
                for key, amount in sorted(tables.failure_amounts(mine, frames, [variant], column)[variant].items())
            }
            for column in ("kind", "stage")
        },
        "matching_alone": round(100 * float(known.sum()) / len(known), 1) if len(known) else None,
    }


def _times(mine: pl.DataFrame) -> dict[str, float]:
    """Means over trials of the medians over frames."""
    columns = {**{stage: f"time_{stage}_ms" for stage in _STAGES}, "total": "time_ms"}
    means = {stage: mine[column].mean() for stage, column in columns.items()}
    return {stage: round(float(mean), 3) for stage, mean in means.items() if isinstance(mean, int | float)}
