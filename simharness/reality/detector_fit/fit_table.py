"""Tables of a measured detector for the terminal, every value with its interval."""

from __future__ import annotations

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from simharness.reality.annotation_errors import AnnotationFit
from simharness.reality.detector_fit.detector_measurement import MeasuredDetector, MeasuredValue, agreement
from simharness.reality.detector_fit.frame_sums import TERCILES
from simharness.scenario.sections.detector_section import BEARINGS, KINDS

_WIDE = 130  # columns of a terminal that has room for all intervals
_OCCLUSIONS = ("visible", "self_occluded", "occluded")
_OTHERS = {
    "Correlation of errors": (
        ("correlation.life", "mean life of an error, s"),
        ("correlation.views", "shared by all views"),
        ("correlation.gross_views", "gross errors, shared by all views"),
        ("correlation.limb", "shared within the limb"),
        ("correlation.scatter_life", "correlation time of scatter, s"),
        ("correlation.scatter_noise", "share of scatter drawn anew in each frame"),
        ("correlation.scatter_near", "correlation of the scatter of neighbouring joints"),
        ("correlation.scatter_views", "share of scatter that views have in common"),
        ("keypoints.border", "reach beyond the border of the image, units"),
        ("keypoints.stray.elbows", "share of misses of limbs anywhere on the box"),
    ),
    "Scores": (
        ("scores.good", "good"),
        ("scores.jitter", "jitter"),
        ("scores.miss", "miss"),
        ("scores.inversion", "inversion"),
        ("scores.swap", "swap"),
        ("scores.hidden.good", "factor of good ones, not visible"),
        ("scores.hidden.miss", "factor of misses, not visible"),
        ("scores.deviation", "deviation, logit"),
        ("scores.overconfident", "overconfident misses, share"),
        ("scores.underconfident", "underconfident good keypoints, share"),
    ),
    "People": (
        ("boxes.missed", "missed, share in a view"),
        ("boxes.missed_hidden.2", "missed with half of the joints hidden, share"),
        ("boxes.missed_hidden.4", "missed with all joints hidden, share"),
        ("boxes.missed_views", "missed, shared by all views"),
        ("boxes.life", "mean life of a miss, s"),
        ("boxes.duplicates", "duplicates, share"),
        ("phantoms.rate", "false positives per view and frame, at most"),
        ("phantoms.life", "mean life of false positives, s"),
        ("phantoms.score", "score of their keypoints"),
        ("size.fragments", "fragments per view and frame"),
    ),
}


def print_measurement(measurement: MeasuredDetector, console: Console) -> None:
    """Print a measurement: classes and bias by kind of joint, drops by occlusion, sizes, and the other parameters."""
    headline = Text.assemble(
        (measurement.name, "bold"),
        f"  {measurement.frames} frames, {measurement.people:.2f} people with known joints in each; "
        "95 % intervals by a block bootstrap over time",
    )
    notes = Text(
        "Each share is of the joints that the classes to its left leave. Good: within 1.14 of OKS sigma x sqrt(area); "
        "jitter: up to 2.35 (at: mean, % of the way between); miss: beyond; inversions and swaps only where "
        "distinguishable from both. Errors are measured against the consensus of the other views; what all views share "
        "cannot be seen. Visibility is that of bodies that re-enact the people.",
        style="dim",
    )
    blocks: list[RenderableType] = [
        headline,
        _classes(measurement, intervals=console.width >= _WIDE),
        _drops(measurement),
        _hidden(measurement),
        _face(measurement),
        _sizes(measurement),
    ]
    blocks += [_list(title, rows, measurement) for title, rows in _OTHERS.items()]
    console.print(Group(*(Padding(block, (0, 0, 1, 0)) for block in [*blocks, notes])))


def print_annotation(fitted: AnnotationFit, console: Console) -> None:
    """Print the errors of the truth: shift and random part of each actor, and what all actors share."""
    annotation = fitted.annotation
    table = _table("Truth against the consensus, mm", "actor", "shift", "random, per axis")
    for actor, (shift, deviation) in enumerate(zip(annotation.shift, annotation.deviation, strict=True)):
        table.add_row(
            str(actor), f"{1000 * np.linalg.norm(shift, axis=-1).mean():.0f}", f"{1000 * deviation.mean():.0f}"
        )
    console.print(table)
    hips = 1000 * fitted.bias[KINDS.index("hips")]
    console.print(
        f"The random part has a memory of {annotation.life:.2g} s. Shared by all actors, and so the detector's: hips "
        f"{hips[2]:.0f} mm up.\n",
        style="dim",
        highlight=False,
    )


def print_agreement(real: MeasuredDetector, simulated: MeasuredDetector, console: Console) -> None:
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


def _classes(measurement: MeasuredDetector, *, intervals: bool) -> Table:
    """Return the table of error classes; in narrow terminals without intervals, which are in the JSON."""
    classes = ("drop", "swap", "inversion", "miss", "jitter")
    title = "Classes of errors, %, and scatter of good keypoints, units"
    table = _table(title, "joint", "n", *classes, "jitter at", "scatter")
    for kind in KINDS:
        cells = [_cell(measurement[f"share.{key}.{kind}"], 1, scale=100, interval=intervals) for key in classes]
        n = measurement[f"share.drop.{kind}"].count
        scatter = _cell(measurement[f"keypoints.scatter.{kind}"], 2, interval=intervals)
        way = _cell(measurement[f"keypoints.jitter_mean.{kind}"], 0, scale=100, interval=intervals)
        table.add_row(kind, str(n), *cells, way, scatter)
    return table


def _drops(measurement: MeasuredDetector) -> Table:
    table = _table("Not reported, % of joints by occlusion", "joint", *(each.replace("_", "-") for each in _OCCLUSIONS))
    for kind in KINDS:
        table.add_row(
            kind, *(_cell(measurement[f"keypoints.drop.{occlusion}.{kind}"], 1, scale=100) for occlusion in _OCCLUSIONS)
        )
    return table


def _hidden(measurement: MeasuredDetector) -> Table:
    """Return the table of factors of hidden joints by their kind."""
    columns = {"self_occluded": "errors, self-occluded", "occluded": "errors, occluded", "scatter_hidden": "scatter"}
    table = _table("Factors on misses, jitter and scatter of joints that are not visible", "joint", *columns.values())
    for kind in KINDS:
        table.add_row(kind, *(_cell(measurement[f"keypoints.{key}.{kind}"], 1) for key in columns))
    return table


def _face(measurement: MeasuredDetector) -> Table:
    degrees = list(map(str, BEARINGS))
    title = "Joints of the face not reported, %, by bearing of the camera to their side, degrees"
    table = _table(title, "joint", *degrees)
    for kind in KINDS[:3]:
        values = [measurement[f"keypoints.face.{kind}.{index}"] for index in range(len(BEARINGS))]
        table.add_row(kind, *(f"{100 * each.value:.0f}" if each.known else "–" for each in values))
    return table


def _sizes(measurement: MeasuredDetector) -> Table:
    table = _table("Limb joints by size of the person, %", "third", "not reported", "reported, not good")
    for third in TERCILES:
        table.add_row(third, *(_cell(measurement[f"size.{third}.{key}"], 1, scale=100) for key in ("drop", "wrong")))
    return table


def _list(title: str, rows: tuple[tuple[str, str], ...], measurement: MeasuredDetector) -> Table:
    table = _table(title, "", "measured")
    for key, label in rows:
        if key in measurement.values:  # parameters differ with the kind of the detector
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


def _cell(measured: MeasuredValue, digits: int, *, scale: float = 1.0, interval: bool = True) -> Text:
    """Return a cell with the value, and its interval."""
    if not measured.known:
        return Text("–", style="dim")
    # Adding zero turns minus zero into zero.
    value, low, high = (
        f"{round(scale * each, digits) + 0:.{digits}f}" for each in (measured.value, measured.low, measured.high)
    )
    if not interval:
        return Text(value)
    return Text.assemble(value, (f"  {low}–{high}" if measured.low >= 0 else f"  {low} to {high}", "dim"))
