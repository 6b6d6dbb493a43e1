"""Rates of the failures of a study, by kind and by the stage to blame, with intervals over seeds."""

from typing import Any

import numpy as np
import polars as pl

from mvpose.arrays import Floats
from simharness.outputs.study.tables import NOT_BLAMED
from simharness.statistics.intervals import mean_interval
from simharness.study.study_folder import Results
from tools.jackknife import pseudo_values

Ends = list[float | None]


def failure_rates(results: Results, variant: str) -> dict[str, Any]:
    """Return the failure rates of a variant, JSON-ready.

    Returns:
        ``kinds`` and ``stages``: failures per 100 frames by kind and by stage (:data:`NOT_BLAMED` for failures
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
        classes = failures.with_columns(pl.col(column).fill_null(NOT_BLAMED))
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
