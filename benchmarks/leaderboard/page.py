"""Page of the leaderboard: one HTML file from the figures."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

from markupsafe import Markup

from benchmarks.leaderboard.entries import Entry
from benchmarks.leaderboard.figures import (
    ALL,
    CHANGE,
    DIFFERENCE,
    OVERALL,
    RIG_SCORES,
    SIGNIFICANT,
    Figure,
    best_of_ours,
    by_method,
)
from benchmarks.leaderboard.views_plot import views_plot
from mvpose.report.documents import fill_template, program_version
from mvpose.report.tables import NOTHING, Cell, Table
from simharness.runtime.number_text import fixed, signed
from simharness.scoring.catalogue import SCORES
from simharness.statistics.intervals import Interval
from simharness.world.rigs.layouts import preset_rig

_PUBLISHED = Path(__file__).parent / "published_rigs.toml"
_TEMPLATES = Path(__file__).parent / "templates"

TITLES: Mapping[str, str] = {
    "conditions": "Fourteen conditions",
    "views": "Number of views",
    "rigs": "Other rigs of Panoptic",
    "shelf": "Real Shelf",
}
"""Headings of the parts."""


def render(parts: Mapping[str, Sequence[Figure]], entries: Sequence[Entry], skipped: Mapping[str, str]) -> str:
    """Return the page.

    Args:
        parts: figures by part, some of :data:`TITLES`.
        entries: methods that ran.
        skipped: methods and parts that did not run, with reasons.
    """
    return fill_template(
        "leaderboard.html",
        folder=_TEMPLATES,
        program="simharness",
        code=program_version(),
        name="Leaderboard",
        entries=entries,
        skipped=skipped,
        parts=[
            {
                "key": key,
                "title": TITLES[key],
                "best": best_of_ours(figures, entries),
                "overall": overall_table(figures, entries),
                "settings": [
                    (SCORES[score].title, setting_table(figures, entries, score))
                    for score in (("map", "mpjpe_mm", "ap25") if key == "rigs" else ("pcp",))
                ],
                "rigs": rig_table(figures, entries) if key == "rigs" else None,
                "published": tomllib.loads(_PUBLISHED.read_text(encoding="utf-8"))["figures"] if key == "rigs" else (),
                "plots": [Markup(plot) for plot in _plots(figures, entries)] if key == "views" else [],
                "seeds": max(each.n for each in figures),
            }
            for key, figures in parts.items()
        ],
    )


def overall_table(figures: Sequence[Figure], entries: Sequence[Entry]) -> Table:
    """Return scores over all settings: a row for each method, the one with the highest PCP first."""
    heads = [Cell(SCORES[key].title, SCORES[key].unit) for key in OVERALL]
    heads.insert(1, Cell("PCP minus the best of mvpose", "points"))
    found = by_method(figures)
    rows = []
    for entry in _ranked(figures, entries):
        cells = [cell_of(found[entry.name].get((ALL, key))) for key in OVERALL]
        cells.insert(1, cell_of(found[entry.name].get((ALL, DIFFERENCE))))
        rows.append((entry.name, tuple(cells)))
    return Table(tuple(heads), tuple(rows))


def setting_table(figures: Sequence[Figure], entries: Sequence[Entry], score: str = "pcp") -> Table:
    """Return a score by setting: a row for each method, in the order of the table over all settings.

    The best value of a setting is bold; the shade grows with the distance from it, fully at 20 points or millimetres.
    """
    found = by_method(figures)
    settings = list(dict.fromkeys(each.setting for each in figures if each.setting != ALL))
    sign = 1.0 if SCORES[score].better == "higher" else -1.0
    best = {
        setting: max(sign * each.value for each in figures if each.setting == setting and each.score == score)
        for setting in settings
    }
    rows = []
    for entry in _ranked(figures, entries):
        cells = []
        for setting in settings:
            figure = found[entry.name].get((setting, score))
            plain = cell_of(figure)
            behind = best[setting] - sign * figure.value if figure is not None else 0.0
            cells.append(Cell(plain.text, plain.small, min(1.0, max(0.0, behind / 20.0)), strong=behind == 0.0))
        rows.append((entry.name, tuple(cells)))
    return Table(tuple(Cell(setting.replace("_", " ")) for setting in settings), tuple(rows))


def rig_table(figures: Sequence[Figure], entries: Sequence[Entry]) -> Table:
    """Return the scores of the best of ours with each rig, and the differences from those with cmu0."""
    of = by_method(figures)[best_of_ours(figures, entries)]
    changes = ("map" + CHANGE, "mpjpe_mm" + CHANGE)
    heads = [Cell("cameras"), *(Cell(SCORES[key].title, SCORES[key].unit) for key in RIG_SCORES)]
    heads += [Cell("mAP minus that of cmu0", "points"), Cell("MPJPE minus that of cmu0", "mm")]
    rows = []
    for rig in dict.fromkeys(setting for setting, _ in of if setting != ALL):
        cells = [cell_of(of.get((rig, key))) for key in (*RIG_SCORES, *changes)]
        rows.append((rig, (Cell(str(len(preset_rig(rig)))), *cells)))
    return Table(tuple(heads), tuple(rows))


def rig_rows(figures: Sequence[Figure], entries: Sequence[Entry]) -> list[list[str]]:
    """Return the rows of the table of rigs on the terminal: AP25, mAP, MPJPE and differences, with intervals."""
    shown = [*(1 + RIG_SCORES.index(key) for key in ("ap25", "map", "mpjpe_mm")), -2, -1]
    return [
        [name, *("\n".join(filter(None, (cells[k].text, cells[k].small))) for k in shown)]
        for name, cells in rig_table(figures, entries).rows
    ]


def cell_of(figure: Figure | None) -> Cell:
    """Return the cell of a figure, with its interval in small letters; differences have signs."""
    if figure is None or math.isnan(figure.value):
        return Cell(NOTHING)
    if figure.score not in SCORES:
        texts = [signed(value, 1).replace("-", "−") for value in (figure.value, figure.low, figure.high)]
        outside = figure.low > 0 or figure.high < 0 if math.isnan(figure.p) else figure.p < SIGNIFICANT
        return Cell(texts[0], f"{texts[1]} to {texts[2]}", strong=outside)
    info = SCORES[figure.score]
    return Cell(*_interval(figure).texts(info.digits))


def _interval(figure: Figure) -> Interval:
    return Interval(figure.value, figure.low, figure.high, figure.n)


def _ranked(figures: Sequence[Figure], entries: Sequence[Entry]) -> list[Entry]:
    values = {each.method: each.value for each in figures if each.setting == ALL and each.score == "pcp"}
    return sorted((entry for entry in entries if entry.name in values), key=lambda entry: -values[entry.name])


def _plots(figures: Sequence[Figure], entries: Sequence[Entry]) -> list[str]:
    """Return PCP against the number of views: of ours, and of the others beside the best of ours."""
    found = by_method(figures)
    settings = list(dict.fromkeys(each.setting for each in figures if each.setting != ALL))
    best = best_of_ours(figures, entries)
    ours = [entry.name for entry in entries if entry.ours]
    others = [best, *(entry.name for entry in entries if not entry.ours)]
    views = [int(setting) for setting in settings]
    shown = list(dict.fromkeys(ours + others))
    lines = {name: [_interval(found[name][setting, "pcp"]) for setting in settings] for name in shown}
    means = [each.mean for line in lines.values() for each in line]
    return [
        views_plot(
            f"views-{title}",
            {name: lines[name] for name in names},
            views,
            title=title,
            colors={name: index for index, name in enumerate(names)},
            span=(min(means), max(means)),
        )
        for title, names in (("mvpose", ours), ("others", others))
    ]


def text_rows(figures: Sequence[Figure], entries: Sequence[Entry]) -> list[list[str]]:
    """Return the rows of the table on the terminal: method, PCP, difference, precision, recall, error and time."""
    found = by_method(figures)
    rows = []
    for entry in _ranked(figures, entries):
        cells = [entry.name]
        for key in ("pcp", DIFFERENCE, "precision", "recall", "mpjpe_mm", "time_ms"):
            figure = found[entry.name].get((ALL, key))
            shown = cell_of(figure)
            small = f"\n{shown.small}" if key in ("pcp", DIFFERENCE) and shown.small else ""
            cells.append(fixed(figure.value, 1) if figure and key == "time_ms" else shown.text + small)
        rows.append(cells)
    return rows
