"""Findings of a run: one sentence above each figure that says what it shows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from mvpose.arrays import Bools, Floats

_FAR = 1.5  # times the error of the best: from there on the worst is named


def of_parts(scores: Mapping[str, Any], groups: Iterable[str]) -> str:
    """Return which group of body parts of a variant has the lowest PCP; empty without a score."""
    known = {group: scores["pcp_parts"][group] for group in groups if scores["pcp_parts"][group] is not None}
    if not known:
        return ""
    worst = min(known, key=lambda group: known[group])
    if known[worst] > 99.95:
        return "Every body part is placed correctly."
    return f"{worst.replace('_', ' ').capitalize()} are the hardest: {known[worst]:.1f} % of them are correct."


def of_joint_errors(errors: Mapping[str, Floats]) -> str:
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


def of_times(times: Mapping[str, Mapping[str, float]]) -> str:
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


def of_people(errors: Floats, present: Bools) -> str:
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


def of_visibility(cameras: Sequence[str], shares: Floats, labels: Sequence[str]) -> str:
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
