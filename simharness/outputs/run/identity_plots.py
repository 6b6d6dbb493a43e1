"""Identities of a run through time, and their plots as SVG: a time line of each person, and tracks from above.

Columns of the report's tables for variants with identities are here as well.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes

from mvpose import COCO17, Estimate
from mvpose.arrays import Floats, Integers
from mvpose.report.palette import UNMATCHED, css, identity_color
from mvpose.report.recording_plots import BAR, draw_bar, half_step, label_ends, runs_of, thinned
from mvpose.report.svg_plots import FAINT, INK, Color, legend_above, svg_plot
from simharness.outputs.run.headline import Column, column_of
from simharness.scoring.tracking.identity_figures import DISTANCE
from simharness.scoring.tracking.identity_scores import ABSENT, MISSED, ClearMot, clear_mot, identity_scores
from simharness.scoring.tracking.tracked_frames import TrackedFrames, ids_of, roots, tracked_frames
from simharness.trial.run_folder import Record

_ROWS, _ROW = 3.4, (0.25, 0.55)  # height of all rows together, and least and greatest height of one, inches
_MOST_GHOST_ROWS = 8


@dataclass(frozen=True)
class Identities:
    """Identities of one variant."""

    time: Floats
    """Times of the frames, (T,), seconds."""
    frames: TrackedFrames
    """People and identities."""
    pairs: ClearMot
    """The pairs of both in each frame, by which switches are counted."""
    paths: Floats
    """Roots of the true people from above, (T, P, 2), metres; NaN where absent."""
    places: tuple[Floats, ...]
    """Roots of the estimates of each frame from above, (k, 2), metres."""
    colors: tuple[Color, ...]
    """Colour of each of the K identities: that of the person that it stands for, others after those; grey for an
    identity that never is a person's."""

    @property
    def ghosts(self) -> list[tuple[int, Integers]]:
        """Index of each identity that has estimates without a person, and the frames of these, ascending by time."""
        found: dict[int, list[int]] = {}
        for frame, (tracks, paired) in enumerate(zip(self.frames.tracks, self.pairs.track, strict=True)):
            for track in np.setdiff1d(tracks, paired).tolist():
                found.setdefault(track, []).append(frame)
        return [(track, np.array(frames)) for track, frames in found.items()]

    @property
    def stretches(self) -> list[tuple[int, Floats]]:
        """Paths from above in the order of identities: the index of an identity, and its places, (k, 2), metres.

        An identity has several where it is missing for some frames, or goes over to another person.
        """
        person = {
            (frame, track): people
            for frame, row in enumerate(self.pairs.track.tolist())
            for people, track in enumerate(row)
            if track >= 0
        }
        parts: dict[int, list[list[Floats]]] = {}
        last: dict[int, tuple[int, int]] = {}  # frame and person of each identity
        for frame, (tracks, places) in enumerate(zip(self.frames.tracks, self.places, strict=True)):
            for track, place in zip(tracks.tolist(), places, strict=True):
                before, whose = last.get(track, (-2, -1))
                now = person.get((frame, track), whose)
                if before < frame - 1 or now != whose >= 0:
                    parts.setdefault(track, []).append([])
                parts[track][-1].append(place)
                last[track] = (frame, now)
        return [(track, np.array(part)) for track in sorted(parts) for part in parts[track]]


def identities_of(truth: Floats, estimates: Sequence[Estimate], time: Floats) -> Identities | None:
    """Return the identities of a variant; None if it does not track people.

    Args:
        truth: true joints, (T, P, 17, 3), metres; NaN where a person is absent.
        estimates: estimates, T.
        time: times of the frames, (T,), seconds.
    """
    ids = ids_of(estimates)
    if ids is None:
        return None
    frames = tracked_frames(truth, [estimate.joints for estimate in estimates], ids, skeleton=COCO17)
    pairs = clear_mot(frames, distance=DISTANCE)
    return Identities(
        time=time,
        frames=frames,
        pairs=pairs,
        paths=roots(truth, COCO17)[..., 0, :2],
        places=tuple(roots(estimate.joints, COCO17)[:, 0, :2] for estimate in estimates),
        colors=_colors(frames, pairs),
    )


def _colors(frames: TrackedFrames, pairs: ClearMot) -> tuple[Color, ...]:
    index = np.full(len(frames.ids), -1)
    own = identity_scores(frames, distance=DISTANCE).track
    index[own[own >= 0]] = np.flatnonzero(own >= 0)
    spare = frames.people
    for track in dict.fromkeys(pairs.track[pairs.track >= 0].tolist()):  # in the order of time
        if index[track] < 0:
            index[track], spare = spare, spare + 1
    return tuple(css(UNMATCHED) if each < 0 else identity_color(each) for each in index.tolist())


def timeline(name: str, identities: Identities) -> str:
    """Plot the identity of each person over time: a row for each person, a bar for each stretch of one identity.

    A thin line is a person without an estimate, ticks one who is absent, a triangle an identity switch. Below are the
    estimates without a person.

    Args:
        name: name of the plot, unique on its page.
        identities: identities of a variant.
    """
    time, people = identities.time, identities.frames.people
    half = half_step(time)
    span = float(time[-1] - time[0]) + 2 * half
    rows, left_out = _ghost_rows(identities)
    below = 0.5 * len(rows) + (0.6 if rows else 0.0)
    row_height = min(max(_ROW[0], _ROWS / max(1.0, people + below)), _ROW[1])
    with svg_plot(name, size=(5.2, 0.95 + row_height * (people + below))) as (axes, written):
        for person in range(people):
            _row_of_person(axes, identities, person, half, span)
        for row, tracks in enumerate(rows):
            for track, frames in tracks:
                for start, end in _stretches(frames):
                    width = max(float(time[end] - time[start]) + 2 * half, 0.004 * span)
                    box = [(float(time[start]) - half, width)]
                    axes.broken_barh(box, (people + 0.1 + 0.5 * row, 0.28), color=identities.colors[track], lw=0)
        labels = [f"person {person}" for person in range(people)]
        ticks = [float(person) for person in range(people)]
        if rows:
            labels.append(f"ghosts (+{left_out})" if left_out else "ghosts")
            ticks.append(people + 0.24)
        axes.set(xlabel="time, s", yticks=ticks, yticklabels=labels)
        axes.set_xlim(float(time[0]) - half, float(time[-1]) + half)
        axes.set_ylim(people - 0.4 + below, -0.75)
        axes.tick_params(axis="y", length=0, labelcolor=INK)
        axes.spines["left"].set_visible(False)
        axes.grid(axis="x")
        _legend_of_states(axes, identities)
        legend_above(axes)
    return written[0]


def trajectories(name: str, identities: Identities) -> str:
    """Plot paths from above: thin lines are the true people, wide ones the estimates in the colour of their identity.

    Args:
        name: name of the plot, unique on its page.
        identities: identities of a variant.
    """
    with svg_plot(name, size=(5.2, 4.6)) as (axes, written):
        grey = css(UNMATCHED)
        ends: dict[int, Floats] = {}
        for track, places in identities.stretches:
            color = identities.colors[track]
            ghost = color == grey
            if len(places) == 1:
                axes.plot(*places[0], ".", ms=2.5, mew=0, color=color, alpha=0.6, zorder=2)
            else:
                width, order = (1.2, 2) if ghost else (3.0, 3)
                axes.plot(*thinned(places).T, color=color, lw=width, alpha=0.7, solid_capstyle="round", zorder=order)
            known = places[np.isfinite(places).all(axis=1)]
            if len(known) and not ghost:
                ends[track] = known[-1]
        for person in range(identities.frames.people):
            path = identities.paths[:, person]
            axes.plot(*thinned(path).T, color=INK, lw=0.7, zorder=4, label="true path" if person == 0 else None)
            there = path[np.isfinite(path).all(axis=1)]
            if len(there):
                axes.plot(*there[-1], ".", ms=3.5, mew=0, color=INK, zorder=6)
        frames, people = np.nonzero(identities.pairs.switched)
        if len(frames):
            at = identities.paths[frames, people]
            axes.plot(*at.T, "v", ms=5, color=INK, mew=0, zorder=6, label="switch")
        if grey in identities.colors:
            axes.plot([], [], color=grey, lw=1.2, label="ghost")
        axes.set(xlabel="x, m", ylabel="y, m")
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.08)
        axes.grid()
        axes.spines[:].set_visible(False)
        for track, place in ends.items():
            axes.plot(*place, "o", ms=5, color=identities.colors[track], mew=0, zorder=5)
        label_ends(axes, {str(identities.frames.ids[track]): place for track, place in ends.items()})
        legend_above(axes)
    return written[0]


def _row_of_person(axes: Axes, identities: Identities, person: int, half: float, span: float) -> None:
    time, states = identities.time, identities.pairs.track[:, person]
    for start, end in runs_of(states):
        first, last = float(time[start]) - half, float(time[end - 1]) + half
        state = int(states[start])
        if state == ABSENT:
            axes.plot([first, last], [person, person], color=FAINT, lw=5, dashes=(0.12, 1.1), dash_capstyle="butt")
        elif state == MISSED:
            axes.plot([first, last], [person, person], color=FAINT, lw=1, solid_capstyle="butt")
        else:
            color = identities.colors[state]
            label = str(identities.frames.ids[state])
            draw_bar(axes, person, (first, last), color=color, label=label, span=span)
    switched = time[identities.pairs.switched[:, person]] - half
    above = np.full(len(switched), person - BAR / 2 - 0.12)
    axes.plot(switched, above, "v", ms=4.5, color=INK, mew=0, zorder=5, clip_on=False)


def _legend_of_states(axes: Axes, identities: Identities) -> None:
    """Add the entries of the states that occur."""
    states, pairs = identities.pairs.track, identities.pairs
    if (states == MISSED).any():
        axes.plot([], [], color=FAINT, lw=1, label="missed")
    if (states == ABSENT).any():
        axes.plot([], [], color=FAINT, lw=5, dashes=(0.12, 1.1), dash_capstyle="butt", label="absent")
    if pairs.switched.any():
        axes.plot([], [], "v", ms=4.5, color=INK, mew=0, label="identity switch")


def _ghost_rows(identities: Identities) -> tuple[list[list[tuple[int, Integers]]], int]:
    """Arrange the tracks of ghosts in rows without overlaps; return the rows, and how many tracks found no place."""
    rows: list[list[tuple[int, Integers]]] = []
    left_out = 0
    for track, frames in identities.ghosts:
        free = [row for row in rows if row[-1][1][-1] < frames[0]]
        if free:
            free[0].append((track, frames))
        elif len(rows) < _MOST_GHOST_ROWS:
            rows.append([(track, frames)])
        else:
            left_out += 1
    return rows, left_out


def _stretches(frames: Integers) -> list[tuple[int, int]]:
    """Return the first and the last of each stretch of consecutive frames."""
    found = runs_of(frames - np.arange(len(frames)))
    return [(int(frames[start]), int(frames[end - 1])) for start, end in found]


def tracked_variants(record: Record) -> list[dict[str, str]]:
    """Return the ``variant``, the ``timeline`` and the ``trajectories`` of all variants that track people."""
    truth = np.stack([true.joints for true in record.truth])
    found = []
    for number, (variant, estimates) in enumerate(record.estimates.items()):
        identities = identities_of(truth, estimates, record.time)
        if identities is not None:
            drawn = {draw.__name__: draw(f"{draw.__name__}-{number}", identities) for draw in (timeline, trajectories)}
            found.append({"variant": variant, **{key: Markup(svg) for key, svg in drawn.items()}})
    return found


def _identity(key: str, scale: float = 1.0) -> Callable[[Mapping[str, Any]], float | None]:
    """Return a function that reads a figure of identities at the distance of the columns from a summary."""

    def value(scores: Mapping[str, Any]) -> float | None:
        at = scores["tracking"]["mean_joint"]
        figure = None if at is None else at[f"{DISTANCE:g}"][key]
        return None if figure is None else scale * figure

    return value


def _jerk(scores: Mapping[str, Any]) -> float | None:
    jerk = scores["tracking"]["jerk_m_s3"]
    return jerk["estimate"] / jerk["truth"] if jerk["truth"] else None


def has_identities(scores: Mapping[str, Any]) -> bool:
    """Return whether a variant gives identities, from its summary."""
    return (scores.get("tracking") or {}).get("mean_joint") is not None


IDENTITY_COLUMNS: tuple[Column, ...] = (
    *(column_of(key, _identity(key, 100.0)) for key in ("hota", "idf1")),
    *(column_of(key, _identity(key)) for key in ("id_switches", "switches_per_minute")),
)
"""Columns of the terminal, of variants with identities only."""

TRACKING_COLUMNS: tuple[Column, ...] = (
    *(column_of(key, _identity(key, 100.0)) for key in ("hota", "deta", "assa", "idf1", "mota")),
    *(column_of(key, _identity(key)) for key in ("id_switches", "fragmentations")),
    column_of("pcp_tracked", lambda scores: scores["tracking"]["pcp_tracked"]),
    column_of("velocity_mm_s", lambda scores: scores["tracking"]["velocity_mm_s"]),
    column_of("jerk_ratio", _jerk),
)
"""Columns of the table of variants."""
