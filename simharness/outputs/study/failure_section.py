"""Failures of a study: rates by kind and by the stage to blame, and what the page shows of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl

from mvpose.arrays import Floats
from simharness.outputs.study import tables
from simharness.scoring.failure_classes import DISPLACED, FailureKind
from simharness.statistics.intervals import mean_interval
from simharness.statistics.resampling import pseudo_values
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


Ends = list[float | None]


def failure_rates(results: Results, variant: str) -> dict[str, Any]:
    """Return the failure rates of a variant, JSON-ready.

    Returns:
        ``kinds`` and ``stages``: failures per 100 frames by kind and by stage (:data:`.tables.NOT_BLAMED` for failures
        whose stage was not determined). ``matching_alone``: share of the blamed failures, percent, that the true
        matching of the real detections repairs; None where no failure was blamed. ``intervals``: the same keys,
        each with the two ends of the 95 % interval over seeds; the ends are None for a single seed.
    """
    seed_of = results.trials.select("trial", "seed").unique()
    seeds = sorted(seed_of["seed"].unique())
    failures = results.failures.filter(pl.col("variant") == variant).join(seed_of, on="trial")
    frames = _by_seed(results.frames.filter(pl.col("variant") == variant).join(seed_of, on="trial"), seeds)
    rates: dict[str, Any] = {}
    ends: dict[str, Any] = {}
    for column in ("kind", "stage"):
        classes = failures.with_columns(pl.col(column).fill_null(tables.NOT_BLAMED))
        counts = {
            str(key): _by_seed(classes.filter(pl.col(column) == key), seeds) for key in sorted(set(classes[column]))
        }
        whole = max(1.0, float(frames.sum()))
        rates[f"{column}s"] = {key: round(100 * float(count.sum()) / whole, 3) for key, count in counts.items()}
        ends[f"{column}s"] = {key: _ends(count, frames) for key, count in counts.items()}
    blamed = failures.filter(pl.col("matching_alone").is_not_null())
    known, repaired = _by_seed(blamed, seeds), _by_seed(blamed.filter(pl.col("matching_alone")), seeds)
    rates["matching_alone"] = round(100 * float(repaired.sum()) / float(known.sum()), 1) if known.any() else None
    ends["matching_alone"] = _ends(repaired, known, share=True) if known.any() else None
    return {**rates, "intervals": ends}


def _by_seed(rows: pl.DataFrame, seeds: list[int]) -> Floats:
    """Return the number of rows of each seed, (n,)."""
    counts = dict(rows["seed"].value_counts().iter_rows())
    return np.array([counts.get(seed, 0) for seed in seeds], float)


def _ends(count: Floats, of: Floats, *, share: bool = False) -> Ends:
    """Return the interval of 100 count / of, both (n,) over seeds, from the seeds with of > 0.

    Args:
        count: number of failures.
        of: number of frames, or of failures among which ``count`` are counted.
        share: whether the ratio is at most 1.
    """
    count, of = count[of > 0], of[of > 0]
    if len(count) < 2:
        return [None, None]
    ratios = pseudo_values(lambda sums: sums[..., 0] / sums[..., 1], np.stack([count, of], axis=1))
    interval = mean_interval(100 * ratios, unit="%") if share else mean_interval(ratios, unit="per frame")
    factor = 1 if share else 100
    # The mean of pseudo-values differs from the ratio by its estimated bias.
    ratio = 100 / factor * count.sum() / of.sum()
    return [round(factor * float(end), 3) for end in (min(interval.low, ratio), max(interval.high, ratio))]
