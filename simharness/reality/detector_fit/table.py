"""Tables of a measured detector for the terminal, every value with its interval."""

from __future__ import annotations

from rich.box import SIMPLE_HEAD
from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from simharness.reality.detector_fit.fit import agreement
from simharness.reality.detector_fit.frame_sums import TERCILES
from simharness.reality.detector_fit.measure import MeasuredValue, Measurement
from simharness.scenario.sections.detector import KINDS

_OCCLUSIONS = ("visible", "self_occluded", "occluded")
_OTHERS = {
    "Correlation of errors": (
        ("correlation.life", "mean life of an error, s"),
        ("correlation.views", "shared by all views"),
        ("correlation.limb", "shared within the limb"),
        ("correlation.scatter_life", "correlation time of scatter, s"),
        ("correlation.scatter_views", "share of scatter that views have in common"),
        ("keypoints.self_occluded", "factor of misses and jitter, self-occluded"),
        ("keypoints.occluded", "factor of misses and jitter, occluded"),
        ("keypoints.stray", "share of misses anywhere on the box"),
    ),
    "Scores": (
        ("scores.good", "good"),
        ("scores.jitter", "jitter"),
        ("scores.miss", "miss"),
        ("scores.inversion", "inversion"),
        ("scores.swap", "swap"),
        ("scores.hidden", "factor, not visible"),
        ("scores.deviation", "deviation, logit"),
        ("scores.overconfident", "overconfident misses, share"),
        ("scores.underconfident", "underconfident good keypoints, share"),
    ),
    "People": (
        ("boxes.missed", "missed, share in a view"),
        ("boxes.missed_views", "missed, shared by all views"),
        ("boxes.life", "mean life of a miss, s"),
        ("boxes.duplicates", "duplicates, share"),
        ("phantoms.rate", "false positives per view and frame, at most"),
        ("phantoms.life", "mean life of false positives, s"),
        ("phantoms.score", "score of their keypoints"),
        ("size.fragments", "fragments per view and frame"),
    ),
}


def print_measurement(measurement: Measurement, console: Console) -> None:
    """Print a measurement: classes and bias by kind of joint, drops by occlusion, sizes, and the other parameters."""
    headline = Text.assemble(
        (measurement.name, "bold"),
        f"  {measurement.frames} frames, {measurement.people:.2f} people with known joints in each; "
        "95 % intervals by a block bootstrap over time",
    )
    notes = Text(
        "Each share is of the joints that the classes to its left leave. Good: within 1.14 of OKS sigma x sqrt(area); "
        "jitter: up to 2.35; miss: beyond; inversions and swaps only where distinguishable from both. The face has "
        "no truth: only its drops and scores are measured. Visibility is estimated with capsules about the "
        "skeletons.",
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
    """Print how many of the detector's parameters its simulated twin reproduces, and the others."""
    different, compared = agreement(real, simulated)
    table = _table(
        f"{simulated.name}: {compared - len(different)} of {compared} parameters agree within both intervals",
        "parameter",
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
    table = _table("Not reported, % of joints by occlusion", "joint", *(each.replace("_", "-") for each in _OCCLUSIONS))
    for kind in KINDS:
        table.add_row(
            kind, *(_cell(measurement[f"keypoints.drop.{occlusion}.{kind}"], 1, scale=100) for occlusion in _OCCLUSIONS)
        )
    return table


def _bias(measurement: Measurement) -> Table:
    directions = ("forward", "outward", "up")
    table = _table("Bias in the body's frame, mm, and factor of the score", "joint", *directions, "score")
    for kind in KINDS:
        cells = [_cell(measurement[f"bias.{direction}.{kind}"], 0, scale=1000) for direction in directions]
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


def _cell(measured: MeasuredValue, digits: int, *, scale: float = 1.0) -> Text:
    """Return a cell with the value and its interval."""
    if not measured.known:
        return Text("–", style="dim")
    # Adding zero turns minus zero into zero.
    value, low, high = (
        f"{round(scale * each, digits) + 0:.{digits}f}" for each in (measured.value, measured.low, measured.high)
    )
    return Text.assemble(value, (f"  {low}–{high}" if measured.low >= 0 else f"  {low} to {high}", "dim"))
