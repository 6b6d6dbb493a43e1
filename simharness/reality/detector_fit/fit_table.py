"""Tables of a measured detector for the terminal, every value with its interval; and a plot of its values."""

import io
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from rich.box import SIMPLE_HEAD
from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from mvpose.files.atomic_files import write_atomic
from mvpose.files.input_files import parse_toml
from mvpose.report.svg_plots import STYLE
from simharness.reality.detector_fit.annotation_fit import AnnotationFit
from simharness.reality.detector_fit.detector_measurement import MeasuredDetector, MeasuredValue, agreement
from simharness.reality.detector_fit.frame_sums import TERCILES
from simharness.scenario.sections.detector_section import BEARINGS, KINDS

_WIDE = 130  # columns of a terminal that has room for all intervals
_OCCLUSIONS = ("visible", "self_occluded", "occluded")


@cache
def _labels() -> Mapping[str, Any]:
    return parse_toml((Path(__file__).parent / "data" / "labels.toml").read_text(encoding="utf-8"))


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
    blocks += [_list(title, rows, measurement) for title, rows in _labels()["lists"].items()]
    console.print(Group(*(Padding(block, (0, 0, 1, 0)) for block in [*blocks, notes])))


def print_priors(inferred: MeasuredDetector, console: Console) -> None:
    """Print the parameters about which the recording says little."""
    keys = [key for key, each in inferred.values.items() if each.by_prior]
    shown = ", ".join(keys) or "none"
    text = f"Parameters that stay near the shipped profile, because the recording says little about them: {shown}.\n"
    console.print(text, style="dim", highlight=False)


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
    degrees = list(map(str, BEARINGS[::2]))
    title = "Joints of the face not reported, %, by bearing of the camera to their side, degrees"
    table = _table(title, "joint", *degrees)
    for kind in KINDS[:3]:
        values = [measurement[f"keypoints.face.{kind}.{index}"] for index in range(0, len(BEARINGS), 2)]
        table.add_row(kind, *(f"{100 * each.value:.0f}" if each.known else "–" for each in values))
    return table


def _sizes(measurement: MeasuredDetector) -> Table:
    table = _table("Limb joints by size of the person, %", "third", "not reported", "reported, not good")
    for third in TERCILES:
        table.add_row(third, *(_cell(measurement[f"size.{third}.{key}"], 1, scale=100) for key in ("drop", "wrong")))
    return table


def _list(title: str, rows: Mapping[str, str], measurement: MeasuredDetector) -> Table:
    table = _table(title, "", "measured")
    for key, label in rows.items():
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


_COLORS = ("#3b82c4", "#d9643a")
_DARK, _GREY, _PALE = "#1f2430", "#5d6574", "#c9ced6"
_STYLE: dict[Any, Any] = {
    **STYLE,
    **dict.fromkeys(("figure.facecolor", "axes.facecolor"), "white"),
    **dict.fromkeys(("text.color", "xtick.labelcolor"), _DARK),
    **dict.fromkeys(("axes.labelcolor", "ytick.labelcolor"), _GREY),
    **dict.fromkeys(("axes.edgecolor", "xtick.color", "ytick.color"), _PALE),
    **{"grid.color": "#e4e7ec", "font.size": 8.5, "axes.titlesize": 9.5, "axes.titlelocation": "left"},
}
_MIN_COUNT = 100  # joints, people or detections behind a value: with fewer, its interval is too wide to plot
_BINS = tuple(map(str, range(len(BEARINGS))))


def plot_comparison(measurements: Sequence[MeasuredDetector], path: str | Path) -> None:
    """Write a PNG with up to two measurements side by side, every value with its 95 % interval.

    Raises:
        ValueError: the file cannot be written.
    """
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(19, 10), layout="constrained", dpi=110)
        axes = figure.subplots(4, 4).ravel()
        for ax, (key, title, by, scale) in zip(axes, _labels()["plot"]["panels"], strict=False):
            kinds = KINDS if by == "kinds" else _BINS
            _draw(ax, measurements, [f"{key}.{kind}" for kind in kinds], scale=scale)
            ax.set_title(title)
            labels = [f"{each}°" * (each % 45 == 0) for each in BEARINGS] if kinds == _BINS else kinds
            ax.set_xticks(range(len(kinds)), labels, fontsize=7.5)
        others = _labels()["plot"]["others"]
        _draw(axes[-1], measurements, list(others))
        axes[-1].set_title("correlation, scores, people")
        axes[-1].set_xticks(range(len(others)), list(others.values()), fontsize=7)
        handles, names = axes[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper left", ncols=2, fontsize=10)
        figure.supxlabel(
            f"Bars: 95 % intervals, block bootstrap over time. Values of fewer than {_MIN_COUNT} joints are omitted.",
            fontsize=8.5,
        )
        try:
            FigureCanvasAgg(figure).print_png(content := io.BytesIO())
            write_atomic(Path(path), content.getvalue())
        except OSError as error:
            raise ValueError(f"--figure {path}: cannot be written: {error.strerror}") from None


def _draw(ax: Axes, measurements: Sequence[MeasuredDetector], keys: Sequence[str], *, scale: float = 1) -> None:
    """Draw the values of some keys, with their intervals, times ``scale``."""
    ax.set_axisbelow(True)
    ax.grid(axis="y")
    for index, (measurement, color) in enumerate(zip(measurements, _COLORS, strict=False)):
        measured = [measurement[key] for key in keys]
        values, low, high = (
            scale * np.array([getattr(each, end) if each.count >= _MIN_COUNT else np.nan for each in measured])
            for end in ("value", "low", "high")
        )
        at = np.arange(len(keys)) + 0.22 * (index - (len(measurements) - 1) / 2)
        ax.vlines(at, low, high, color=color, lw=3, alpha=0.45)
        ax.plot(at, values, "o", color=color, ms=4, label=f"{measurement.name}, {measurement.frames} frames")
    ax.set_xlim(-0.6, len(keys) - 0.4)
    ax.tick_params(axis="x", length=0)
    if "occluded" in keys[0] and "drop" not in keys[0]:
        ax.set_yscale("log")
        ax.yaxis.set_major_formatter("{x:g}")
    elif not keys[0].startswith("scores.joint") and all(
        measurement[key].low >= 0 for measurement in measurements for key in keys if measurement[key].known
    ):
        ax.set_ylim(bottom=0)
