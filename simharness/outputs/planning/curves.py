"""Curves of a rehearsal: numbers of people, numbers of cameras, and errors of calibration and clocks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from mvpose.report.svg_plots import FAINT, legend_above, svg_plot
from simharness.planning.rehearsal import Rehearsal
from simharness.planning.tolerance import CLIFF, Tolerance
from simharness.statistics.intervals import Interval

LAYER = "#8a63c9"
"""Colour of the fast layer."""

SIMULATION = "#3b82c4"
"""Colour of the simulation."""

_WIDE = (4.9, 2.9)
_SMALL = (3.5, 2.6)
_FLOOR = 5.0  # PCP: axes begin at a multiple of this


def crowd_curve(rehearsal: Rehearsal, *, name: str) -> str:
    """Plot PCP against the number of people: the fast layer as a line, simulation as points with intervals."""
    crowds = rehearsal.crowds
    with svg_plot(name, size=_WIDE) as (axes, written):
        axes.plot(
            [each.people for each in crowds],
            [each.layer_pcp for each in crowds],
            "--",
            color=LAYER,
            lw=1.5,
            label="fast layer",
        )
        known = [(each.people, each.pcp) for each in crowds if each.pcp is not None]
        _points(axes, [number for number, _ in known], [pcp for _, pcp in known], "simulation")
        axes.axhline(rehearsal.target.pcp, color=FAINT, lw=0.9, ls=":")
        values = [each.layer_pcp for each in crowds] + [_low(pcp) for _, pcp in known]
        axes.set(xlabel="people in the volume", ylabel="PCP, %", ylim=(_bottom(values), 101))
        axes.set_xticks([each.people for each in crowds])
        axes.grid(axis="y")
        legend_above(axes, columns=2)
    return written[0]


def matching_curve(rehearsal: Rehearsal, *, name: str) -> str:
    """Plot the simulated percentage of matches that take two people for one, against the number of people."""
    known = [(each.people, each.mixed) for each in rehearsal.crowds if each.mixed is not None]
    with svg_plot(name, size=_WIDE) as (axes, written):
        _points(axes, [number for number, _ in known], [mixed for _, mixed in known], "simulation")
        top = max([5.0, *(each.high for _, each in known if np.isfinite(each.high))])
        axes.set(xlabel="people in the volume", ylabel="matches of two people, %", ylim=(0, 1.05 * top))
        axes.set_xticks([each.people for each in rehearsal.crowds])
        axes.grid(axis="y")
    return written[0]


def tolerance_curve(tolerance: Tolerance, base: Interval, *, name: str, bottom: float) -> str:
    """Plot PCP against the size of one kind of error, with the level at which it has lost five points."""
    with svg_plot(name, size=_SMALL) as (axes, written):
        _points(axes, [0.0, *tolerance.fault.levels], [base, *tolerance.pcp], "", line=True)
        axes.axhline(base.mean - CLIFF, color=FAINT, lw=0.9, ls=":")
        if tolerance.cliff is not None:
            axes.axvline(tolerance.cliff, color="#d9643a", lw=1.3)
        unit = tolerance.fault.unit
        axes.set(xlabel=f"standard deviation, {unit}", ylabel="PCP, %", ylim=(bottom, 101))
        axes.grid(axis="y")
    return written[0]


def tolerance_bottom(rehearsal: Rehearsal) -> float:
    """Return the lower end of the axes of all tolerances, which they share so that they can be compared."""
    return _bottom([_low(pcp) for each in rehearsal.tolerances for pcp in each.pcp])


def subset_curve(rehearsal: Rehearsal, *, name: str) -> str:
    """Plot the simulated PCP of all sets of cameras against their number, with the best of each number as a line."""
    sets = {names: each for names, each in rehearsal.subsets.items() if np.isfinite(each.pcp.mean)}
    counts = sorted({len(names) for names in sets})
    with svg_plot(name, size=_WIDE) as (axes, written):
        axes.plot(
            [len(names) for names in sets],
            [each.pcp.mean for each in sets.values()],
            "o",
            color=SIMULATION,
            ms=4.5,
            alpha=0.45,
            mew=0,
            label="a set of cameras",
        )
        best = [max(each.pcp.mean for names, each in sets.items() if len(names) == count) for count in counts]
        axes.plot(counts, best, "-", color=SIMULATION, lw=1.5, label="the best of its size")
        axes.axhline(rehearsal.target.pcp, color=FAINT, lw=0.9, ls=":")
        axes.set(xlabel="cameras", ylabel="PCP, %", ylim=(_bottom([each.pcp.mean for each in sets.values()]), 101))
        axes.set_xticks(counts)
        axes.grid(axis="y")
        legend_above(axes, columns=2)
    return written[0]


def _points(axes: Axes, at: Sequence[float], values: Sequence[Interval], label: str, *, line: bool = False) -> None:
    """Draw means with their intervals."""
    means = np.array([each.mean for each in values])
    ends = np.array([[each.low, each.high] for each in values]).reshape(-1, 2)
    ends = np.where(np.isfinite(ends), ends, means[:, None])
    for x, (low, high) in zip(at, ends, strict=True):
        axes.plot([x, x], [low, high], color=SIMULATION, lw=1.2, alpha=0.7)
    axes.plot(at, means, "o-" if line else "o", color=SIMULATION, lw=1.4, ms=4.6, mew=0, label=label or None)


def _low(value: Interval) -> float:
    return value.low if np.isfinite(value.low) else value.mean


def _bottom(values: list[float]) -> float:
    known = [each for each in values if np.isfinite(each)]
    return max(0.0, _FLOOR * (np.floor(min(known, default=95.0) / _FLOOR) - 0.2))
