"""The page of a study that a person reads: one HTML file with everything in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from markupsafe import Markup

from simharness.report.documents import fill_template
from simharness.report.run.plots import stage_times
from simharness.report.study import plots, tables
from simharness.report.study.curves import Factor, breaking, factors_by_case, grid, panels
from simharness.report.study.worst_frames import Shown, show, worst_frames
from simharness.runtime.atomic_files import write_whole
from simharness.scenario.sections.cameras import Cameras
from simharness.scoring.catalogue import SCORES
from simharness.study.result_folder import Results

THRESHOLDS: Mapping[str, float] = {"pcp": 90.0, "precision": 90.0}
"""The scores that must not pass a value, where nobody says otherwise: PCP does not see ghosts, precision does."""

CURVES = ("pcp", "recall", "mpjpe_mm", "ghosts")
"""The scores that have robustness curves."""

_STAGES = ("affinity", "matching", "reconstruction")
_MOST_ERRORS = 20  # of failed trials that are told one by one


def write_report(
    results: Results,
    out: Path | None = None,
    *,
    thresholds: Mapping[str, float] = THRESHOLDS,
    progress: Callable[[int], None] = lambda frames: None,
) -> Path:
    """Write the page of a study; the trials of its worst frames are run again for the pictures.

    Args:
        results: the study.
        out: the file; by default ``report.html`` in the study's folder. It appears when it is whole.
        thresholds: see :func:`render_study`.
        progress: told of each of the worst frames.

    Returns:
        The file.

    Raises:
        ValueError: a score that does not exist, a trial that cannot be built any more, or a place that cannot be
            written to.
    """
    out = results.folder / "report.html" if out is None else out
    check_thresholds(thresholds)
    if not out.parent.is_dir():  # better known before the work
        raise ValueError(f"{out}: cannot be written: there is no folder {out.parent}")
    shown = [picture for picture, _ in show(results, worst_frames(results), progress=progress)]
    page = render_study(results, shown=shown, thresholds=thresholds)
    try:
        write_whole(out, page.encode())
    except OSError as error:
        raise ValueError(f"{out}: cannot be written: {error.strerror}") from None
    return out


def check_thresholds(thresholds: Mapping[str, float]) -> None:
    """Refuse thresholds of scores that do not exist: a ValueError names those that do."""
    for score in thresholds:
        if score not in SCORES:
            raise ValueError(f"--threshold {score}: there is no such score; there are {', '.join(SCORES)}")


def render_study(results: Results, *, shown: Sequence[Shown] = (), thresholds: Mapping[str, float] = THRESHOLDS) -> str:
    """Make the page of a study.

    Args:
        results: the study.
        shown: its worst frames.
        thresholds: for each of these scores the values of every numeric factor at which it passes them are told.

    Returns:
        A self-contained HTML document.
    """
    info, trials = results.info, results.trials
    variants = [name for name in info["variants"] if name in set(trials["variant"])]
    swept = factors_by_case(results) if variants else {}
    seeds = trials["seed"].n_unique()
    return fill_template(
        "study.html",
        info=info,
        facts=_facts(results),
        variants=variants,
        seeds=seeds,
        failed=info["failed"],
        most_errors=_MOST_ERRORS,
        columns=tables.COLUMNS,
        headline=tables.headline(trials, variants),
        compared=tables.compared(trials, variants) if len(variants) > 1 and seeds > 1 else {},
        every=tables.every(trials, variants),
        cases=tables.cases(trials, variants),
        tabs=[SCORES[key] for key in CURVES],
        curves=[
            curve
            for index, by_case in enumerate(panels(swept).values())
            for curve in _curves(index, by_case, variants, thresholds)
        ],
        factors=len(panels(swept)),
        heats=_heats(swept, variants, one_at_a_time=info["one_at_a_time"]),
        threshold_told=any(score in thresholds for score in CURVES),
        breaking=_breaking(swept, variants, thresholds),
        failures=_failures(results, variants),
        shown=shown,
        times=_times(results, variants),
        folder=results.folder,
        machine=_machine(info["machine"]),
        study_file=_study_file(results.folder),
    )


def _facts(results: Results) -> list[tuple[str, str]]:
    info, trials = results.info, results.trials
    finished = info["trials"] - len(info["failed"])
    facts = [
        ("trials", f"{finished} of {info['trials']}" if info["failed"] else f"{finished}"),
        ("settings", f"{info['settings']}"),
        ("seeds", f"{len(info['seeds'])}"),
        ("variants", f"{len(info['variants'])}"),
    ]
    keys = [key for key in ("case", *info["factors"]) if key in trials.columns]
    one_of_each = trials.unique(keys, keep="first", maintain_order=True)["trial"]
    scenarios = [results.scenario_of(trial) for trial in one_of_each]
    if scenarios:
        facts += [
            ("frames", f"{results.frames.select('trial', 'frame').n_unique():,}"),
            ("people", _span([scenario.people.count for scenario in scenarios])),
            ("cameras", _join(_rig(scenario.cameras) for scenario in scenarios)),
            ("detector", _join("a pose head" if s.detector.onnx else s.detector.name for s in scenarios)),
        ]
    kept = f", {info['kept']} kept" if info["kept"] else ""
    return [*facts, ("took", f"{_duration(info['seconds'])}{kept}"), ("version", f"{info['code']}")]


def _rig(cameras: Cameras) -> str | int:
    if cameras.layout in ("preset", "file"):
        return cameras.preset or Path(cameras.file).name
    return len(cameras.positions) if cameras.layout == "free" else cameras.count


def _join(values: Any) -> str:
    """Different values, the numbers among them as their span."""
    different = list(dict.fromkeys(values))
    numbers = [value for value in different if isinstance(value, int)]
    words = [value for value in different if not isinstance(value, int)]
    return ", ".join([*([_span(numbers)] if numbers else []), *words[:3], *(["…"] if len(words) > 3 else [])])


def _span(numbers: Sequence[int]) -> str:
    return f"{min(numbers)}" if min(numbers) == max(numbers) else f"{min(numbers)} to {max(numbers)}"


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def _curves(
    index: int, by_case: Mapping[str, Factor], variants: Sequence[str], thresholds: Mapping[str, float]
) -> list[dict[str, Any]]:
    """The plots of a factor, of each case on one scale, and the numbers in them, by score."""
    told: list[dict[str, Any]] = [
        {
            "key": factor.key,
            "case": case,
            "along": factor.along,
            "over": plots.mean_over(factor.over),
            "plots": {},
            "numbers": {},
        }
        for case, factor in by_case.items()
    ]
    for score in CURVES:
        info = SCORES[score]
        lines = {case: {each: factor.line(each, score) for each in variants} for case, factor in by_case.items()}
        every = [line for each in lines.values() for line in each.values()]
        for each, (case, factor) in zip(told, by_case.items(), strict=True):
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
                (plots.short(value), [tables.cell(lines[case][variant][row], info) for variant in variants])
                for row, value in enumerate(factor.values)
            ]
    return told


def _heats(
    swept: Mapping[str, Sequence[Factor]], variants: Sequence[str], *, one_at_a_time: bool
) -> list[dict[str, Any]]:
    """A grid of two factors as heat maps by score, of the first two variants in each case; nothing of other studies."""
    if one_at_a_time or not swept or any(len(factors) != 2 for factors in swept.values()):
        return []
    shown = [(case, down, along, variant) for case, (down, along) in swept.items() for variant in variants[:2]]
    maps: list[dict[str, Any]] = [
        {"variant": variant, "case": case, "down": down.key, "along": along.key, "plots": {}}
        for case, down, along, variant in shown
    ]
    for score in CURVES:
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
    """Where every variant breaks: by factor a row for each case and score."""
    told = []
    for key, by_case in panels(swept).items():
        rows = []
        for case, factor in by_case.items():
            for score, threshold in thresholds.items() if factor.numeric else ():
                info = SCORES[score]
                found = {each.variant: each for each in breaking(factor, variants, score, threshold)}
                past = "under" if info.better == "higher" else "over"
                rows.append(
                    {
                        "case": case,
                        "broken": f"{info.title} {past} {threshold:g}{f' {info.unit}' if info.unit else ''}",
                        "cells": [tables.breaking_cell(found.get(variant)) for variant in variants],
                    }
                )
        if rows:
            told.append({"factor": key, "rows": rows})
    return told


def _failures(results: Results, variants: Sequence[str]) -> dict[str, Any]:
    """The plots of failures, and the table of kinds by stage for the first variant; nothing where nothing failed."""
    failures = results.failures
    if not len(failures):
        return {}
    frames = dict(results.frames["variant"].value_counts().iter_rows())
    kinds = tables.failure_amounts(failures, frames, variants, "kind")
    stages = tables.failure_amounts(failures, frames, variants, "stage")
    alone = tables.failure_amounts(failures.filter(pl.col("matching_alone")), frames, variants, "stage")
    main = failures.filter(pl.col("variant") == variants[0])
    asked = [stage for stage in plots.BLAME_COLORS if stage in set(main["stage"])]
    rows = []
    for kind in plots.KIND_COLORS:
        mine = main.filter(pl.col("kind") == kind)
        if len(mine):
            rows.append((kind.replace("_", " "), len(mine), [len(mine.filter(pl.col("stage") == s)) for s in asked]))
    return {
        "kinds": Markup(plots.failure_bars("failure-kinds", amounts=kinds, colors=plots.KIND_COLORS)),
        "stages": Markup(
            plots.failure_bars("failure-stages", amounts=stages, colors=plots.BLAME_COLORS, hatched=alone)
        ),
        "asked": asked,
        "foreign": "method" in set(failures["stage"]),
        "rows": rows,
        "total": len(failures),
    }


def _times(results: Results, variants: Sequence[str]) -> dict[str, Any]:
    """The plots of time, and quantiles of a frame's time for each variant."""
    stages: dict[str, dict[str, float]] = {}
    spread, rows = {}, []
    for variant in variants:
        mine = results.trials.filter(pl.col("variant") == variant)
        means = {stage: mine[f"time_{stage}_ms"].mean() for stage in _STAGES} | {"total": mine["time_ms"].mean()}
        stages[variant] = {stage: float(value) for stage, value in means.items() if isinstance(value, int | float)}
        times = results.frames.filter(pl.col("variant") == variant)["time_ms"].drop_nulls()
        spread[variant] = times.to_numpy()
        if len(times):
            rows.append((variant, [f"{times.quantile(share):.2f}" for share in (0.5, 0.9, 0.99, 1.0)]))
    return {
        "stages": Markup(stage_times(stages)),
        "spread": Markup(plots.time_distribution(spread)),
        "rows": rows,
    }


def _machine(machine: Any) -> str:
    """What is known of a machine, one line."""
    if isinstance(machine, Mapping):
        return ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in machine.items())
    return str(machine)


def _study_file(folder: Path) -> str:
    file = folder / "study.toml"
    return file.read_text(encoding="utf-8") if file.is_file() else ""
