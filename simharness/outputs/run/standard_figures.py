"""Figures of the report of a run: error of each person over time, visibility in each camera."""

from __future__ import annotations

import numpy as np
import polars as pl

from mvpose.arrays import Bools, Floats
from mvpose.report.palette import line_color
from simharness.outputs.run import findings, plots
from simharness.outputs.run.figures import figure
from simharness.trial.run_folder import Record
from simharness.types.views import Visibility

_VISIBILITY_LABELS = {
    Visibility.VISIBLE: "visible",
    Visibility.SELF_OCCLUDED: "self-occluded",
    Visibility.OCCLUDED_BY_PERSON: "behind a person",
    Visibility.OCCLUDED_BY_CLUTTER: "behind clutter",
    Visibility.OUTSIDE: "outside",
}


@figure(
    "Error over time",
    "Mean joint error of each person, variant {variant}. "
    "Squares below the axis: frames in which the person was there and was not found.",
    finding=lambda record, variant: findings.of_people(person_errors(record.scores, variant), presence(record)),
)
def error_over_time(record: Record, variant: str) -> str | None:
    """Plot the mean joint error of each person over time; None without people."""
    errors = person_errors(record.scores, variant)
    colors = [line_color(person) for person in range(errors.shape[1])]
    return plots.error_over_time(record.time, errors, presence(record), colors=colors) if colors else None


@figure(
    "Visibility of the joints in each camera",
    "Share of all joints of all people in all frames, visible or by the cause of the occlusion.",
    finding=lambda record, variant: _visibility_finding(record),
)
def visibility(record: Record, variant: str) -> str | None:
    """Plot the visibility of the joints in each camera; None without people."""
    shares = _visibility_shares(record)
    names = [camera.name for camera in record.rig]
    return None if shares is None else plots.visibility_shares(names, shares, labels=list(_VISIBILITY_LABELS.values()))


def _visibility_finding(record: Record) -> str:
    shares = _visibility_shares(record)
    names = [camera.name for camera in record.rig]
    return "" if shares is None else findings.of_visibility(names, shares, list(_VISIBILITY_LABELS.values()))


def _visibility_shares(record: Record) -> Floats | None:
    """Return the share of the joints of each camera by label, (V, 5); None without people."""
    labels = np.stack([true.visibility for true in record.truth], axis=1)  # (V, T, P, J)
    labels = labels[:, presence(record)]  # absent people have no visibility
    if not labels.shape[1]:
        return None
    return np.stack([(labels == label).mean(axis=(1, 2)) for label in _VISIBILITY_LABELS], axis=1)


def presence(record: Record) -> Bools:
    """Return who is in the scene in every frame, (T, P)."""
    return np.stack([true.present for true in record.truth])


def person_errors(scores: pl.DataFrame, variant: str) -> Floats:
    """Return the mean joint error of every true person in every frame, (T, P) millimetres; NaN where not found."""
    rows = scores.filter(pl.col("variant") == variant).sort("frame")["errors_mm"].to_list()
    return np.array([[np.nan if error is None else error for error in row] for row in rows], float).reshape(
        len(rows), -1
    )
