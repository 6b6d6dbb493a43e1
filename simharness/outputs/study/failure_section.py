"""Failures on the page of a study: what counts as one, the worst kinds first, and how often each occurs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import polars as pl

from simharness.outputs.study import tables
from simharness.scoring.failure_classes import DISPLACED, FailureKind
from simharness.study.study_folder import Results

MEANING: Mapping[FailureKind, str] = {
    FailureKind.MISSED: "no estimate within 500 mm",
    FailureKind.GHOST: "an estimate where no person is",
    FailureKind.MERGED: "one estimate of several people's detections",
    FailureKind.SPLIT: "two estimates of one person",
    FailureKind.SWAPPED_LIMB: "a joint where its other side, or another person's, is",
    FailureKind.DISPLACED_JOINT: f"a joint off by more than {1000 * DISPLACED:.0f} mm, or not estimated although seen",
}
"""Meaning of every kind, the worst first: whole people, then mixed people, then joints."""

_JOINTS = (FailureKind.SWAPPED_LIMB, FailureKind.DISPLACED_JOINT)


def failure_section(results: Results, variants: Sequence[str]) -> dict[str, Any]:
    """Return what the page shows of the failures, for its template; empty without failures."""
    failures = results.failures
    if not len(failures):
        return {}
    frames = dict(results.frames["variant"].value_counts().iter_rows())
    kinds = tables.failures_per_100_frames(failures, frames, variants, "kind")
    most = max(rate for variant in variants for rate in (*kinds[variant].values(), 0.0)) or 1.0
    people = dict(results.people["variant"].value_counts().iter_rows())
    rows = [
        {
            "kind": str(kind).replace("_", " "),
            "meaning": meaning,
            "rates": [(rate := kinds[variant].get(str(kind), 0.0), rate / most) for variant in variants],
        }
        for kind, meaning in MEANING.items()
        if any(kinds[variant].get(str(kind)) for variant in variants)
    ]
    return {
        "rows": rows,
        "all": [f"{sum(kinds[variant].values()):.1f}" for variant in variants],
        "wrong": [_wrong_people(failures, people, variant) for variant in variants],
        "typical": _typical(failures, variants[0]),
    }


def _wrong_people(failures: pl.DataFrame, people: Mapping[str, int], variant: str) -> str:
    """Return the share of all people in all frames who are wrong, with its unit."""
    wrong = len(failures.filter((pl.col("variant") == variant) & (pl.col("kind") != str(FailureKind.GHOST))))
    return f"{100 * wrong / people[variant]:.1f} %" if people.get(variant) else "–"


def _typical(failures: pl.DataFrame, variant: str) -> str:
    """Return how many joints are wrong where only joints are, in a sentence; empty where that never happens."""
    of_joints = failures.filter((pl.col("variant") == variant) & pl.col("kind").is_in([str(kind) for kind in _JOINTS]))
    if not len(of_joints):
        return ""
    share = 100 * len(of_joints) / len(failures.filter(pl.col("variant") == variant))
    count = int(of_joints["joints"].list.len().median() or 0)  # type: ignore[arg-type]
    joints = "1 wrong joint" if count == 1 else f"{count} wrong joints"
    return f"{share:.0f} % of the failures of {variant} are people with {joints} of 17 (median) and all others right"
