"""Plots of people through time as SVG: paths from above, time lines of identities, views of each person."""

import itertools
import math
from collections.abc import Iterator, Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats, Integers
from mvpose.camera import Rig
from mvpose.recording import People
from mvpose.report.palette import identity_color
from mvpose.report.rig_plots import camera_from_above, fit_view, name_cameras
from mvpose.report.svg_plots import FAINT, INK, Color, legend_above, svg_plot

MOST_ROWS = 24
"""People with a row of their own in plots over time: those who are there for longest."""

_ROWS, _ROW = 2.4, (0.25, 0.55)  # height of all rows together, and least and greatest height of one, inches
_TALL = 1.16  # height over width of the plot from above
_MOST_POINTS = 500  # of a plot over time
_MARGIN = 0.6  # metres around cameras and people


BAR = 0.62
"""Height of a bar in a time line, rows."""

_PATH_POINTS = 400  # of a drawn path: more are not seen, and make pages large
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
    step = max(1, math.ceil(len(path) / _PATH_POINTS))
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


def places_of(people: People) -> Floats:
    """Return where each person stands from above, (T, n, 2), metres: the middle of the hips, else of all joints."""
    names = people.skeleton.joints
    hips = [names.index(joint) for joint in ("left_hip", "right_hip") if joint in names]
    with np.errstate(invalid="ignore"):
        middle = people.joints[:, :, hips, :2].mean(axis=2) if hips else np.full((*people.joints.shape[:2], 2), np.nan)
        count = people.present.sum(axis=2)[..., None]
        mean = np.nansum(people.joints[..., :2], axis=2) / np.where(count > 0, count, np.nan)
    return np.where(np.isfinite(middle), middle, mean)


def longest(people: People, count: int) -> Integers:
    """Return the rows of the ``count`` people who are there in the most frames, in the order of their rows."""
    frames = people.present.any(axis=2).sum(axis=0)
    return np.sort(np.argsort(-frames, kind="stable")[:count])


def paths_from_above(name: str, people: People, rig: Rig) -> str:
    """Plot the paths of all people from above, with the cameras and their fields of view.

    Args:
        name: name of the plot, unique on its page.
        people: n people, each in the colour of its row.
        rig: the cameras.
    """
    places = places_of(people)
    placed: Bools = np.logical_and.reduce(np.isfinite(places), axis=2)
    everywhere = np.vstack([rig.centers[:, :2], places.reshape(-1, 2)])
    everywhere = everywhere[np.isfinite(everywhere).all(axis=1)]
    low, high = everywhere.min(axis=0) - _MARGIN, everywhere.max(axis=0) + _MARGIN
    reach = 0.16 * float((high - low).max())
    with svg_plot(name, size=(5.2, 5.2 * _TALL)) as (axes, written):
        for camera in rig:
            camera_from_above(axes, camera, reach=reach)
        ends: dict[str, Floats] = {}
        for person in range(len(people)):
            color, known = identity_color(person), placed[:, person]
            for start, end in runs_of(known):
                if known[start]:
                    path = thinned(places[start:end, person])
                    axes.plot(*path.T, color=color, lw=2.2, alpha=0.75, solid_capstyle="round", zorder=3)
            if known.any():
                ends[str(people.ids[person])] = places[known, person][-1]
                axes.plot(*ends[str(people.ids[person])], "o", ms=5, color=color, mew=0, zorder=5)
        fit_view(axes, low, high, tall=_TALL)
        label_ends(axes, ends)
        name_cameras(axes, rig)
    return written[0]


def identities(people: People) -> str:
    """Plot when each person is there: a row for each identity, a bar for each stretch of frames."""
    rows, half = longest(people, MOST_ROWS), half_step(people.times)
    start, end = float(people.times[0]) - half, float(people.times[-1]) + half
    present: Bools = np.logical_or.reduce(people.present, axis=2)
    with svg_plot("identities", size=(5.2, _height(len(rows)))) as (axes, written):
        for row, person in enumerate(rows.tolist()):
            there = present[:, person]
            for first, last in runs_of(there):
                if there[first]:
                    times = float(people.times[first]) - half, float(people.times[last - 1]) + half
                    label, color = str(people.ids[person]), identity_color(person)
                    draw_bar(axes, row, times, color=color, label=label, span=end - start)
        _rows_of_people(axes, people, rows)
        axes.set(xlim=(start, end), xlabel="time, s")
    return written[0]


def views_over_time(people: People, frames: Integers, views: Integers, cameras: int) -> str:
    """Plot how many views show each person: a row for each, as high as the number of views.

    Times at which at most one view shows a person have the colour of the text.

    Args:
        people: n people.
        frames: frames that were counted, (F,).
        views: views of each person, (F, n); -1 where absent.
        cameras: number of cameras, the full height of a row.
    """
    rows = longest(people, MOST_ROWS)
    every = max(1, -(-len(frames) // _MOST_POINTS))
    times, views = people.times[frames[::every]], views[::every]
    half = half_step(times)
    with svg_plot("views-over-time", size=(5.2, _height(len(rows)))) as (axes, written):
        for row, person in enumerate(rows.tolist()):
            count = views[:, person]
            axes.plot([times[0] - half, times[-1] + half], [row + 0.42] * 2, color=FAINT, lw=0.5, zorder=2)
            for first, last in runs_of(np.where(count < 0, -1, count <= 1).astype(np.int64)):
                if count[first] < 0:
                    continue
                edges = np.append(times[first:last] - half, times[last - 1] + half)
                heights = 0.84 * np.maximum(count[first:last], 0.15) / cameras
                color = INK if count[first] <= 1 else identity_color(person)
                axes.stairs(row + 0.42 - heights, edges, baseline=row + 0.42, fill=True, color=color, lw=0, zorder=3)
        _rows_of_people(axes, people, rows)
        axes.set(xlim=(times[0] - half, times[-1] + half), xlabel="time, s")
        axes.plot([], [], "s", ms=6, color=INK, mew=0, label="one view or none")
        axes.plot([], [], "s", ms=6, color=FAINT, mew=0, label=f"full height of a row: all {cameras} views")
        legend_above(axes, columns=2)
    return written[0]


def _height(rows: int) -> float:
    return 0.8 + min(max(_ROW[0], _ROWS / max(1, rows)), _ROW[1]) * max(1, rows)


def _rows_of_people(axes: Axes, people: People, rows: Integers) -> None:
    axes.set_yticks(range(len(rows)), [f"person {people.ids[person]}" for person in rows.tolist()])
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.tick_params(axis="y", length=0, labelcolor=INK)
    axes.spines["left"].set_visible(False)
    axes.grid(axis="x")
