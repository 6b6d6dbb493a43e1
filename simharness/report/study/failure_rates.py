"""How often a variant fails, by kind and by the stage that owns it, with intervals over seeds."""

from __future__ import annotations

from typing import Any

import numpy as np
import polars as pl

from mvpose.arrays import Floats
from simharness.statistics.bootstrap import block_weights, interval, resampled
from simharness.study.result_folder import Results

Ends = list[float | None]

_RESAMPLES = 2000


def failure_rates(results: Results, variant: str) -> dict[str, Any]:
    """Failures of a variant, JSON-ready.

    Returns:
        ``kinds`` and ``stages``: failures in 100 frames by kind and by stage ("not looked into" where nobody asked).
        ``matching_alone``: the share of those looked into, percent, that true matching of the real detections mends;
        None where it was asked of none. ``intervals``: the same keys, with the ends of the 95 % interval over seeds in
        the place of a number; ends are None of one seed.
    """
    seed_of = results.trials.select("trial", "seed").unique()
    seeds = sorted(seed_of["seed"].unique())
    mine = results.failures.filter(pl.col("variant") == variant).join(seed_of, on="trial")
    frames = _by_seed(results.frames.filter(pl.col("variant") == variant).join(seed_of, on="trial"), seeds)
    told: dict[str, Any] = {}
    ends: dict[str, Any] = {}
    for column in ("kind", "stage"):
        classes = mine.with_columns(pl.col(column).fill_null("not looked into"))
        counts = {
            str(key): _by_seed(classes.filter(pl.col(column) == key), seeds) for key in sorted(set(classes[column]))
        }
        whole = max(1.0, float(frames.sum()))
        told[f"{column}s"] = {key: round(100 * float(count.sum()) / whole, 3) for key, count in counts.items()}
        ends[f"{column}s"] = {key: _ends(count, frames) for key, count in counts.items()}
    asked = mine.filter(pl.col("matching_alone").is_not_null())
    known, mended = _by_seed(asked, seeds), _by_seed(asked.filter(pl.col("matching_alone")), seeds)
    told["matching_alone"] = round(100 * float(mended.sum()) / float(known.sum()), 1) if known.any() else None
    ends["matching_alone"] = _ends(mended, known) if known.any() else None
    return {**told, "intervals": ends}


def _by_seed(rows: pl.DataFrame, seeds: list[int]) -> Floats:
    """How many rows each seed has, (n,)."""
    counts = dict(rows["seed"].value_counts().iter_rows())
    return np.array([counts.get(seed, 0) for seed in seeds], float)


def _ends(count: Floats, of: Floats) -> Ends:
    """The interval of 100 count / of, both (n,) over seeds, by resampling seeds; resamples of nothing are left out."""
    if len(count) < 2:
        return [None, None]
    weights = block_weights(np.arange(len(count)), resamples=_RESAMPLES)
    counts, whole = resampled(count, weights), resampled(of, weights)
    rates = np.divide(100 * counts, whole, out=np.full_like(counts, np.nan), where=whole > 0)
    return [round(float(end), 3) for end in interval(rates, blocks=len(count))]
