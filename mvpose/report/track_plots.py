"""Parts of plots of people through time: runs, paths from above and their labels, bars of a time line."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.report.svg_plots import Color

BAR = 0.62
"""Height of a bar in a time line, rows."""

_MOST_POINTS = 400  # of a drawn path: more are not seen, and make pages large
_LETTER = 4.3  # width of a letter of a bar's label, px
_PLOT_WIDTH = 300.0  # of the axes, px


def runs_of(values: NDArray[np.generic]) -> Iterator[tuple[int, int]]:
    """Yield the first index and the index after the last of each run of equal values, (T,)."""
    bounds = [0, *(np.flatnonzero(values[1:] != values[:-1]) + 1).tolist(), len(values)]
    yield from itertools.pairwise(bounds) if len(values) else ()


def half_step(time: Floats) -> float:
    """Return half of the time between frames, (T,), seconds: how far a bar reaches to each side of a frame."""
    return 0.5 * float(np.median(np.diff(time))) if len(time) > 1 else 0.5


def draw_bar(axes: Axes, row: float, times: tuple[float, float], *, color: Color, label: str, span: float) -> None:
    """Draw a bar of a time line, with its label where there is room for it.

    Args:
        axes: plot with seconds in x and rows in y.
        row: middle of the bar.
        times: start and end, seconds.
        color: colour of the bar.
        label: text in the middle.
        span: length of the whole axis, seconds.
    """
    start, end = times
    axes.broken_barh([(start, end - start)], (row - BAR / 2, BAR), color=color, lw=0, zorder=3)
    if (end - start) / span * _PLOT_WIDTH > _LETTER * len(label) + 5:
        ink = "#fdfdfd" if np.dot(to_rgb(color), (0.299, 0.587, 0.114)) < 0.55 else "#16181c"
        middle = (start + end) / 2
        axes.text(middle, row, label, ha="center", va="center_baseline", fontsize=7, color=ink, zorder=4)


def thinned(path: Floats) -> Floats:
    """Return every n-th point of a path, (k, 2), and the last one."""
    step = max(1, math.ceil(len(path) / _MOST_POINTS))
    return path[np.unique([*range(0, len(path), step), len(path) - 1])] if len(path) else path


def label_ends(axes: Axes, ends: Mapping[str, Floats]) -> None:
    """Write each identity where its track ends, beside it where another label is in the way, or not at all."""
    low, high = np.array(axes.get_xlim()), np.array(axes.get_ylim())
    unit = max(float(high[1] - high[0]), float(low[1] - low[0])) / 270.0  # metres per px, nearly
    taken: list[tuple[float, float, float]] = []
    for text, place in ends.items():
        width = 5.0 * len(text)
        for right, up in ((6, 0), (-6 - width, 0), (-width / 2, 9), (-width / 2, -9), (6, 9), (6, -9)):
            x, y = float(place[0]) / unit + right, float(place[1]) / unit + up
            if all(abs(y - other) > 9 or x > end + 2 or x + width + 2 < start for start, end, other in taken):
                taken.append((x, x + width, y))
                axes.annotate(
                    text,
                    (float(place[0]), float(place[1])),
                    xytext=(right, up),
                    textcoords="offset points",
                    va="center",
                    fontsize=8,
                    zorder=7,
                )
                break
