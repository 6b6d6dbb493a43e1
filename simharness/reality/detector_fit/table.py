"""A measured detector as tables in the terminal, every figure with its interval."""

from __future__ import annotations

from rich.box import SIMPLE_HEAD
from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from simharness.reality.detector_fit.fit import agreement
from simharness.reality.detector_fit.frame_sums import TERCILES
from simharness.reality.detector_fit.measure import Figure, Measurement
from simharness.scenario.sections.detector import KINDS

_SIGHTS = ("visible", "self_occluded", "occluded")
_OTHERS = {
    "What errors have to do with each other": (
        ("correlation.life", "mean life of an error, s"),
        ("correlation.views", "shared by all views"),
        ("correlation.limb", "shared within the limb"),
        ("correlation.scatter_life", "time in which scatter forgets, s"),
        ("correlation.scatter_views", "share of scatter that is one displacement in space"),
        ("keypoints.self_occluded", "times as many misses and jitter behind the own body"),
        ("keypoints.occluded", "times as many behind somebody else"),
        ("keypoints.stray", "share of misses anywhere on the box"),
    ),
    "Scores": (
        ("scores.good", "good"),
        ("scores.jitter", "jitter"),
        ("scores.miss", "miss"),
        ("scores.inversion", "inversion"),
        ("scores.swap", "swap"),
        ("scores.hidden", "times, not visible"),
        ("scores.deviation", "deviation, logit"),
        ("scores.overconfident", "over-confident misses"),
        ("scores.underconfident", "under-confident hits"),
    ),
    "People": (
        ("boxes.missed", "missed, share in a view"),
        ("boxes.missed_views", "of it shared by all views"),
        ("boxes.life", "mean life of that, s"),
        ("boxes.duplicates", "found twice, share"),
        ("phantoms.rate", "false at most, in a view and frame"),
        ("phantoms.life", "mean life of those, s"),
        ("phantoms.score", "score of their keypoints"),
        ("size.fragments", "fragments, in a view and frame"),
    ),
}


def print_measurement(measurement: Measurement, console: Console) -> None:
    """Print what was measured: classes and bias by kind of joint, drops by visibility, sizes, and the rest."""
    headline = Text.assemble(
        (measurement.name, "bold"),
        f"  {measurement.frames} frames, {measurement.people:.2f} people with known joints in each; "
        "95 % intervals by a block bootstrap over time",
    )
    notes = Text(
        "Shares are of what the classes to their left leave. Good: within 1.14 of OKS sigma x sqrt(area); jitter: up "
        "to 2.35; miss: beyond; inversions and swaps only where they can be told from both. The face has no truth: its "
        "drops and scores alone are measured. Visibility is told by capsules about the skeletons.",
        style="dim",
    )
    blocks: list[RenderableType] = [
        headline,
        _classes(measurement),
        _drops(measurement),
        _bias(measurement),
        _sizes(measurement),
    ]
    blocks += [_list(title, rows, measurement) for title, rows in _OTHERS.items()]
    console.print(Group(*(Padding(block, (0, 0, 1, 0)) for block in [*blocks, notes])))


def print_agreement(real: Measurement, simulated: Measurement, console: Console) -> None:
    """Print how many of the detector's dials a simulated twin gives back, and which it does not."""
    different, compared = agreement(real, simulated)
    table = _table(
        f"{simulated.name}: {compared - len(different)} of {compared} figures agree within both intervals", "figure"
    )
    for measurement in (real, simulated):
        table.add_column(measurement.name, justify="right", no_wrap=True)
    for key in different:
        table.add_row(key, *(_cell(measurement[key], 3) for measurement in (real, simulated)))
    console.print(table if different else table.title)


def _classes(measurement: Measurement) -> Table:
    classes = ("drop", "swap", "inversion", "miss", "jitter")
    table = _table("Classes of errors, %, and scatter of good keypoints, units", "joint", "n", *classes, "scatter")
    for kind in KINDS:
        cells = [_cell(measurement[f"share.{key}.{kind}"], 1, scale=100) for key in classes]
        n = measurement[f"share.drop.{kind}"].count
        table.add_row(kind, str(n), *cells, _cell(measurement[f"keypoints.scatter.{kind}"], 2))
    return table


def _drops(measurement: Measurement) -> Table:
    table = _table("Not reported, % of joints that are", "joint", *(each.replace("_", "-") for each in _SIGHTS))
    for kind in KINDS:
        table.add_row(kind, *(_cell(measurement[f"keypoints.drop.{sight}.{kind}"], 1, scale=100) for sight in _SIGHTS))
    return table


def _bias(measurement: Measurement) -> Table:
    ways = ("forward", "outward", "up")
    table = _table("Bias in the body's frame, mm, and factor of the score", "joint", *ways, "score")
    for kind in KINDS:
        cells = [_cell(measurement[f"bias.{way}.{kind}"], 0, scale=1000) for way in ways]
        table.add_row(kind, *cells, _cell(measurement[f"scores.joint.{kind}"], 2))
    return table


def _sizes(measurement: Measurement) -> Table:
    table = _table("Limb joints by size of the person, %", "third", "not reported", "reported, not good")
    for third in TERCILES:
        table.add_row(third, *(_cell(measurement[f"size.{third}.{key}"], 1, scale=100) for key in ("drop", "wrong")))
    return table


def _list(title: str, rows: tuple[tuple[str, str], ...], measurement: Measurement) -> Table:
    table = _table(title, "", "measured")
    for key, label in rows:
        table.add_row(label, _cell(measurement[key], 2))
    return table


def _table(title: str, first: str, *columns: str) -> Table:
    table = Table(
        title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, show_edge=False, pad_edge=False
    )
    table.add_column(first, min_width=9, no_wrap=True)
    for column in columns:
        table.add_column(column, justify="right", no_wrap=True)
    return table


def _cell(figure: Figure, digits: int, *, scale: float = 1.0) -> Text:
    """The value, and its interval in small."""
    if not figure.known:
        return Text("–", style="dim")
    # Adding zero turns what is rounded to minus zero into zero.
    value, low, high = (
        f"{round(scale * each, digits) + 0:.{digits}f}" for each in (figure.value, figure.low, figure.high)
    )
    return Text.assemble(value, (f"  {low}–{high}" if figure.low >= 0 else f"  {low} to {high}", "dim"))
