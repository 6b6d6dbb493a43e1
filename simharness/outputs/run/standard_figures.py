"""Figures of the report of a run, and the sentences above its figures that say what they show."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl

from mvpose.arrays import Bools, Floats
from simharness.outputs.run import plots
from simharness.outputs.run.figures import figure
from simharness.outputs.run.pictures import rows_of
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
    finding=lambda record, variant: people_finding(person_errors(record.scores, variant), presence(record)),
)
def error_over_time(record: Record, variant: str) -> str | None:
    """Plot the mean joint error of each person over time; None without people."""
    errors = person_errors(record.scores, variant)
    return plots.error_over_time(record.time, errors, presence(record)) if errors.shape[1] else None


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
    return "" if shares is None else visibility_finding(names, shares, list(_VISIBILITY_LABELS.values()))


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
    rows = rows_of(scores, variant)["errors_mm"].to_list()
    return np.array(rows, float).reshape(len(rows), -1)  # None becomes NaN


_FAR = 1.5  # times the error of the best: from there on the worst is named


def parts_finding(scores: Mapping[str, Any], groups: Iterable[str]) -> str:
    """Return which group of body parts of a variant has the lowest PCP; empty without a score."""
    known = {group: scores["pcp_parts"][group] for group in groups if scores["pcp_parts"][group] is not None}
    if not known:
        return ""
    worst = min(known, key=lambda group: known[group])
    if known[worst] > 99.95:
        return "Every body part is placed correctly."
    return f"{worst.replace('_', ' ').capitalize()} are the hardest: {known[worst]:.1f} % of them are correct."


def joint_errors_finding(errors: Mapping[str, Floats]) -> str:
    """Return within which distance half of the joints of each variant lie; millimetres, NaN counts as infinite."""
    medians = {
        name: float(np.median(np.where(np.isnan(values), np.inf, values)))
        for name, values in errors.items()
        if len(values)
    }
    known = [f"{median:.0f} mm ({name})" for name, median in medians.items() if np.isfinite(median)]
    if not known:
        return ""
    return f"Half of all joints are within {' or '.join([', '.join(known[:-1]), known[-1]] if known[1:] else known)}."


def times_finding(times: Mapping[str, Mapping[str, float]]) -> str:
    """Return what the first variant needs, and which stage most of it; milliseconds by variant and stage."""
    name, stages = next(iter(times.items()), ("", {}))
    if "total" not in stages:
        return ""
    needed = f"{name} needs {stages['total']:.1f} ms for a frame"
    parts = {stage: time for stage, time in stages.items() if stage != "total"}
    if len(parts) < 2 or not sum(parts.values()):
        return f"{needed}."
    slowest = max(parts, key=lambda stage: parts[stage])
    return f"{needed}, {100 * parts[slowest] / sum(parts.values()):.0f} % of it for {slowest}."


def people_finding(errors: Floats, present: Bools) -> str:
    """Return who has the largest error over time.

    Args:
        errors: millimetres, (T, P); NaN where a person was not found.
        present: who is in the scene, (T, P); nobody looks for people who never are.
    """
    there = np.flatnonzero(present.any(axis=0))
    errors = errors[:, there]
    found = np.isfinite(errors)
    if errors.shape[1] < 2 or not found.any(axis=0).all():
        lost = [f"{person}" for person in there[~found.any(axis=0)].tolist()]
        return f"Never found: person {', '.join(lost)}." if lost else ""
    means = np.array([column[np.isfinite(column)].mean() for column in errors.T])
    worst, best = int(means.argmax()), int(means.argmin())
    if means[worst] < _FAR * means[best]:
        return f"No person stands out: means of {means[best]:.0f} to {means[worst]:.0f} mm."
    easiest = f"person {there[best]}, the easiest, {means[best]:.0f} mm"
    return f"Person {there[worst]} is the hardest: {means[worst]:.0f} mm on average; {easiest}."


def visibility_finding(cameras: Sequence[str], shares: Floats, labels: Sequence[str]) -> str:
    """Return which camera sees the fewest joints, and why.

    Args:
        cameras: names of the V cameras.
        shares: share of the joints by label, (V, L), the visible ones first.
        labels: L labels.
    """
    if len(cameras) < 2:
        return ""
    worst, best = int(shares[:, 0].argmin()), int(shares[:, 0].argmax())
    cause = labels[1 + int(shares[worst, 1:].argmax())]
    return (
        f"{cameras[worst]} sees the fewest joints, {100 * shares[worst, 0]:.0f} % (most others are {cause}); "
        f"{cameras[best]} sees {100 * shares[best, 0]:.0f} %."
    )
