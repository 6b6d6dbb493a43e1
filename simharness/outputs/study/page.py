"""Report of a study as one self-contained HTML file, and its plots and curves as files."""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from markupsafe import Markup

from mvpose.commands.progress import duration
from mvpose.files.atomic_files import atomic_folder, write_atomic
from mvpose.report.documents import fill_template
from mvpose.report.svg_plots import plots_as_pdf
from simharness.outputs import TEMPLATES
from simharness.outputs.blame_section import blame_section
from simharness.outputs.run.plots import stage_times
from simharness.outputs.study import plots, tables
from simharness.outputs.study.curves import curve_table, finding, grid, panels
from simharness.outputs.study.tables import failure_rows
from simharness.outputs.study.worst_frames import WorstFramePictures, show, worst_frames
from simharness.runtime.number_text import short
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.scoring.catalogue import SCORES
from simharness.study.causes.blame_text import read_blame
from simharness.study.causes.cause_shares import Blame
from simharness.study.factors import LOST, THRESHOLDS, Factor, factor_breaking_points, factors_by_case
from simharness.study.study_folder import Results

CURVES = ("pcp", "recall", "mpjpe_mm", "ghosts")
"""Scores with robustness curves, besides :data:`simharness.outputs.study.tables.OVER_TIME` where people are tracked."""

_MAX_ERRORS = 20  # failed trials in the list on the page


def write_report(
    results: Results,
    out: Path | None = None,
    *,
    thresholds: Mapping[str, float] = THRESHOLDS,
    progress: Callable[[int], None] = lambda frames: None,
    figures: Path | None = None,
) -> Path:
    """Write the page of a study. The trials of its worst frames are run again for the pictures.

    Args:
        results: the study.
        out: path of the page; by default ``report.html`` in the folder of the study. It is written in one step.
        thresholds: see :func:`render_study`.
        progress: called with 1 after each of the worst frames.
        figures: folder for its plots as PDF and the points of its curves as ``curves.csv``; None writes none.

    Returns:
        Path of the page.

    Raises:
        ValueError: a score does not exist, a trial cannot be built any more, or the page cannot be written.
    """
    out = results.folder / "report.html" if out is None else out
    check_thresholds(thresholds)
    if not out.parent.is_dir():  # checked before the long work
        raise ValueError(f"{out}: cannot be written: there is no folder {out.parent}")
    found = read_blame(results.folder)
    shown = [picture for picture, _ in show(results, worst_frames(results), progress=progress)]
    with contextlib.ExitStack() as stack:
        if figures is not None:
            folder = stack.enter_context(atomic_folder(figures, "simharness report"))
            stack.enter_context(plots_as_pdf(folder))
            curve_table(factors_by_case(results), results.info["variants"]).write_csv(folder / "curves.csv")
        page = render_study(results, shown=shown, thresholds=thresholds, found=found)
    try:
        write_atomic(out, page.encode())
    except OSError as error:
        raise ValueError(f"{out}: cannot be written: {error.strerror}") from None
    return out


def check_thresholds(thresholds: Mapping[str, float]) -> None:
    """Check that the scores of thresholds exist.

    Raises:
        ValueError: a score does not exist; the message lists all scores.
    """
    for score in thresholds:
        if score not in SCORES:
            raise ValueError(f"--threshold {score}: no such score; expected one of {', '.join(SCORES)}")


def render_study(
    results: Results,
    *,
    shown: Sequence[WorstFramePictures] = (),
    thresholds: Mapping[str, float] = THRESHOLDS,
    found: Blame | None = None,
) -> str:
    """Return the page of a study.

    Args:
        results: the study.
        shown: worst frames of the study.
        found: what cost the score; None where it was not examined.
        thresholds: thresholds by score; the page has the breaking points of every numeric factor for each of them.

    Returns:
        A self-contained HTML document.
    """
    info, trials = results.info, results.trials
    variants = [name for name in info["variants"] if name in set(trials["variant"])]
    swept = factors_by_case(results) if variants else {}
    seeds = trials["seed"].n_unique()
    study_file = results.folder / "study.toml"
    drawn = (*CURVES, *(tables.OVER_TIME if tables.tracks_people(trials) else ()))
    return fill_template(
        "study.html",
        folder=TEMPLATES,
        program="simharness",
        info=info,
        **_scenes(results),
        time=duration(info["seconds"]),
        variants=variants,
        seeds=seeds,
        condition=tables.condition(seeds) if seeds else "",
        failed=info["failed"],
        max_errors=_MAX_ERRORS,
        columns=tables.COLUMNS,
        headline=tables.headline(trials, variants),
        compared=tables.differences(trials, variants) if len(variants) > 1 and seeds > 1 else {},
        every=tables.all_scores(trials, variants),
        cases=tables.cases(trials, variants),
        tabs=[SCORES[key] for key in drawn],
        curves=[
            curve
            for index, by_case in enumerate(panels(swept).values())
            for curve in _curves(index, by_case, variants, thresholds, drawn)
        ],
        factors=len(panels(swept)),
        heats=_heats(swept, variants, drawn, one_at_a_time=info["one_at_a_time"]),
        threshold_drawn=any(score in thresholds for score in drawn),
        breaking=_breaking(swept, variants, thresholds),
        failures=failure_rows(results, variants),
        blame=found and blame_section(found),
        blame_hint=f"simharness report {results.folder} --blame 10",
        shown=shown,
        times=_times(results, variants),
        study_file=study_file.read_text(encoding="utf-8") if study_file.is_file() else "",
    )


def _scenes(results: Results) -> dict[str, Any]:
    """Return the number of frames, and what differs between settings, for the facts of the page."""
    keys = [key for key in ("case", *results.info["factors"]) if key in results.trials.columns]
    one_of_each = results.trials.unique(keys, keep="first", maintain_order=True)["trial"]
    scenarios = [results.scenario_of(trial) for trial in one_of_each]
    return {
        "frames": results.frames.select("trial", "frame").n_unique() if scenarios else 0,
        "people": _join(scenario.people.count for scenario in scenarios),
        "cameras": _join(_rig(scenario.cameras) for scenario in scenarios),
        "detectors": _join(scenario.detector.label for scenario in scenarios),
    }


def _rig(cameras: CamerasSection) -> str | int:
    if cameras.layout in ("preset", "file"):
        return cameras.preset or Path(cameras.file).name
    return len(cameras.positions) if cameras.layout == "free" else cameras.count


def _join(values: Any) -> str:
    """Return the distinct values as text: numbers as their range, and up to three words."""
    different = list(dict.fromkeys(values))
    numbers = sorted(value for value in different if isinstance(value, int))
    words = [value for value in different if not isinstance(value, int)]
    span = [" to ".join(dict.fromkeys((f"{numbers[0]}", f"{numbers[-1]}")))] if numbers else []
    return ", ".join([*span, *words[:3], *(["…"] if len(words) > 3 else [])])


def _curves(
    index: int,
    by_case: Mapping[str, Factor],
    variants: Sequence[str],
    thresholds: Mapping[str, float],
    drawn: Sequence[str],
) -> list[dict[str, Any]]:
    """Return the plots of a factor and their numbers by score, for each case; all cases have one scale."""
    curves: list[dict[str, Any]] = [
        {
            "key": factor.key,
            "case": case,
            "along": factor.along,
            "over": plots.mean_over(factor.over),
            "plots": {},
            "findings": {score: finding(factor, variants, score) for score in drawn},
            "numbers": {},
        }
        for case, factor in by_case.items()
    ]
    for score in drawn:
        info = SCORES[score]
        lines = {case: {each: factor.line(each, score) for each in variants} for case, factor in by_case.items()}
        every = [line for each in lines.values() for line in each.values()]
        for each, (case, factor) in zip(curves, by_case.items(), strict=True):
            svg = plots.curve(
                "-".join(filter(None, ("curve", str(index), score, case))),
                factor=factor.key,
                values=factor.values,
                numeric=factor.numeric,
                lines=lines[case],
                score=info,
                threshold=thresholds.get(score),
                beside=every,
            )
            each["plots"][score] = Markup(svg)
            each["numbers"][score] = [
                (short(value), [tables.cell(lines[case][variant][row], info) for variant in variants])
                for row, value in enumerate(factor.values)
            ]
    return curves


def _heats(
    swept: Mapping[str, Sequence[Factor]], variants: Sequence[str], drawn: Sequence[str], *, one_at_a_time: bool
) -> list[dict[str, Any]]:
    """Return heat maps by score for a grid of two factors, for the first two variants in each case; else nothing."""
    if one_at_a_time or not swept or any(len(factors) != 2 for factors in swept.values()):
        return []
    shown = [(case, down, along, variant) for case, (down, along) in swept.items() for variant in variants[:2]]
    maps: list[dict[str, Any]] = [
        {"variant": variant, "case": case, "down": down.key, "along": along.key, "plots": {}}
        for case, down, along, variant in shown
    ]
    for score in drawn:
        means = [grid(down, along, variant, score) for _, down, along, variant in shown]
        whole = [each for each in means if each is not None]
        if len(whole) < len(means):
            return []
        known = np.concatenate([each[np.isfinite(each)] for each in whole])
        span = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
        for each, (case, down, along, variant), values in zip(maps, shown, whole, strict=True):
            svg = plots.heat_map(
                "-".join(filter(None, ("heat", variant, score, case))),
                down=(down.key, down.values),
                along=(along.key, along.values),
                means=values,
                score=SCORES[score],
                span=span,
            )
            each["plots"][score] = Markup(svg)
    return maps


def _breaking(
    swept: Mapping[str, Sequence[Factor]], variants: Sequence[str], thresholds: Mapping[str, float]
) -> list[dict[str, Any]]:
    """Return the table of breaking points: for each factor, a row for each case and score."""
    tables_by_factor = []
    for key, by_case in panels(swept).items():
        rows = []
        for case, factor in by_case.items():
            if factor.numeric:
                lost = factor_breaking_points(factor, variants, "pcp", -LOST, relative=True)
                points = {f"{LOST:g} points of PCP lost": lost} if lost else {}
                for score, threshold in thresholds.items():
                    condition = tables.broken(score, threshold)
                    points[condition] = factor_breaking_points(factor, variants, score, threshold)
                for condition, each in points.items():
                    found = {point.variant: point for point in each}
                    cells = [tables.breaking_cell(found.get(variant)) for variant in variants]
                    rows.append({"case": case, "broken": condition, "cells": cells})
        if rows:
            tables_by_factor.append({"factor": key, "rows": rows})
    return tables_by_factor


def _times(results: Results, variants: Sequence[str]) -> dict[str, Any]:
    """Return the plots of running time, and quantiles of the time per frame for each variant."""
    stages: dict[str, dict[str, float]] = {}
    spread, rows = {}, []
    for variant in variants:
        trials = results.trials.filter(pl.col("variant") == variant)
        stages[variant] = tables.stage_means(trials)
        times = results.frames.filter(pl.col("variant") == variant)["time_ms"].drop_nulls()
        spread[variant] = times.to_numpy()
        if len(times):
            rows.append((variant, [f"{times.quantile(share):.2f}" for share in (0.5, 0.9, 0.99, 1.0)]))
    return {"stages": Markup(stage_times(stages)), "spread": Markup(plots.time_distribution(spread)), "rows": rows}
