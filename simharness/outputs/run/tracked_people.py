"""Section of the report of a run about people through time: columns of its table, plots of variants with identities."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from simharness.outputs.run.headline import Column
from simharness.outputs.run.identity_plots import identities_of, timeline, trajectories
from simharness.scoring.catalogue import SCORES
from simharness.scoring.tracking.identity_figures import DISTANCE
from simharness.trial.run_folder import Record


@dataclass(frozen=True)
class TrackedVariant:
    """Plots of a variant with identities."""

    variant: str
    timeline: Markup
    trajectories: Markup


def tracked_variants(record: Record) -> list[TrackedVariant]:
    """Return the plots of all variants that track people."""
    truth = np.stack([true.joints for true in record.truth])
    found = []
    for number, (variant, estimates) in enumerate(record.estimates.items()):
        identities = identities_of(truth, estimates, record.time)
        if identities is not None:
            drawn = (draw(f"{draw.__name__}-{number}", identities) for draw in (timeline, trajectories))
            found.append(TrackedVariant(variant, *map(Markup, drawn)))
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


def _column(key: str, value: Callable[[Mapping[str, Any]], float | None]) -> Column:
    info = SCORES[key]
    return Column(info.title, info.unit, info.about, value, info.digits)


IDENTITY_COLUMNS: tuple[Column, ...] = (
    *(_column(key, _identity(key, 100.0)) for key in ("hota", "idf1")),
    *(_column(key, _identity(key)) for key in ("id_switches", "switches_per_minute")),
)
"""Columns of the terminal, of variants with identities only."""

TRACKING_COLUMNS: tuple[Column, ...] = (
    *(_column(key, _identity(key, 100.0)) for key in ("hota", "deta", "assa", "idf1", "mota")),
    *(_column(key, _identity(key)) for key in ("id_switches", "fragmentations")),
    _column("pcp_tracked", lambda scores: scores["tracking"]["pcp_tracked"]),
    _column("velocity_mm_s", lambda scores: scores["tracking"]["velocity_mm_s"]),
    _column("jerk_ratio", _jerk),
)
"""Columns of the table of variants."""
