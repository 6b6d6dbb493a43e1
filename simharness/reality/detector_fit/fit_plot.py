"""Plot of a fitted detector: real and simulated values side by side, by joint and class."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from mvpose.files.atomic_files import write_atomic
from simharness.reality.detector_fit.detector_measurement import MeasuredDetector
from simharness.scenario.sections.detector_section import BEARINGS, KINDS

_COLORS = ("#3b82c4", "#d9643a")
_STYLE: dict[Any, Any] = {
    "font.size": 8.5,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "text.color": "#1f2430",
    "axes.labelcolor": "#5d6574",
    "axes.edgecolor": "#c9ced6",
    "xtick.color": "#c9ced6",
    "ytick.color": "#c9ced6",
    "xtick.labelcolor": "#1f2430",
    "ytick.labelcolor": "#5d6574",
    "grid.color": "#e4e7ec",
    "grid.linewidth": 0.6,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}
_MIN_COUNT = 100  # joints, people or detections behind a value: with fewer, its interval is too wide to plot
_BINS = tuple(map(str, range(len(BEARINGS))))
_PANELS: tuple[tuple[str, str, tuple[str, ...], float], ...] = (
    ("keypoints.drop.visible", "not reported, of visible joints, %", KINDS, 100),
    ("keypoints.drop.self_occluded", "not reported, self-occluded, %", KINDS, 100),
    ("keypoints.drop.occluded", "not reported, occluded, %", KINDS, 100),
    ("keypoints.jitter", "jitter, of visible joints, %", KINDS, 100),
    ("keypoints.miss", "miss, of visible joints, %", KINDS, 100),
    ("keypoints.inversion", "inversion, %", KINDS, 100),
    ("keypoints.swap", "swap, %", KINDS, 100),
    ("keypoints.jitter_mean", "mean distance of jitters, % of the way from 1.14 to 2.35 units", KINDS, 100),
    ("keypoints.scatter", "scatter of good keypoints, units", KINDS, 1),
    ("keypoints.scatter_hidden", "factor of scatter, not visible", KINDS, 1),
    ("keypoints.self_occluded", "factor of misses and jitter, self-occluded", KINDS, 1),
    ("keypoints.occluded", "factor of misses and jitter, occluded", KINDS, 1),
    ("keypoints.face.ears", "ears not reported, by bearing of the camera to their side, %", _BINS, 100),
    ("keypoints.face.nose", "nose not reported, by bearing of the camera, %", _BINS, 100),
    ("scores.joint", "score, relative to elbows", KINDS, 1),
)
_REST: tuple[tuple[str, str], ...] = (
    ("correlation.life", "life, s"),
    ("correlation.views", "views"),
    ("correlation.gross_views", "gross,\nviews"),
    ("correlation.limb", "limb"),
    ("correlation.scatter_life", "scatter\nlife, s"),
    ("correlation.scatter_near", "scatter\nnear"),
    ("scores.good", "score\ngood"),
    ("scores.miss", "score\nmiss"),
    ("boxes.missed", "missed"),
    ("boxes.missed_hidden.4", "missed,\nhidden"),
    ("phantoms.rate", "false"),
)


def plot_comparison(measurements: Sequence[MeasuredDetector], path: str | Path) -> None:
    """Write a PNG with up to two measurements side by side, every value with its 95 % interval.

    Raises:
        ValueError: the file cannot be written.
    """
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(19, 10), layout="constrained", dpi=110)
        axes = figure.subplots(4, 4).ravel()
        for ax, (key, title, kinds, scale) in zip(axes, _PANELS, strict=False):
            _draw(ax, measurements, [f"{key}.{kind}" for kind in kinds], scale=scale)
            ax.set_title(title)
            labels = [f"{bearing}°" for bearing in BEARINGS] if kinds == _BINS else kinds
            ax.set_xticks(range(len(kinds)), labels, fontsize=7.5)
        _draw(axes[-1], measurements, [key for key, _ in _REST])
        axes[-1].set_title("correlation, scores, people")
        axes[-1].set_xticks(range(len(_REST)), [label for _, label in _REST], fontsize=7)
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
    if keys[0].startswith("scores.joint"):
        ax.set_ylim(0.7, 1.1)
    elif "occluded" in keys[0] and "drop" not in keys[0]:
        ax.set_yscale("log")
    elif all(measurement[key].low >= 0 for measurement in measurements for key in keys if measurement[key].known):
        ax.set_ylim(bottom=0)
