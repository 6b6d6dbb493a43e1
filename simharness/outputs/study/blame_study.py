"""What cost a study its score: the blame of its worst setting."""

from __future__ import annotations

import polars as pl

from mvpose.commands.progress import Reporter
from simharness.study.causes.cause_shares import Blame, blame
from simharness.study.study_folder import Results


def blame_study(results: Results, *, seeds: int, workers: int = 1, reporter: Reporter | None = None) -> Blame:
    """Return what cost the first variant its PCP in the setting of the lowest PCP.

    Args:
        results: the study.
        seeds: number of seeds, from the first of the study on.
        workers: processes that share the seeds.
        reporter: receiver of progress.

    Raises:
        ValueError: no trial finished, or the trial cannot be built any more.
        RunError: any other error.
    """
    variant = next((name for name in results.info["variants"] if name in set(results.trials["variant"])), None)
    rows = results.trials.filter((pl.col("variant") == variant) & pl.col("pcp").is_not_null())
    if not len(rows):
        raise ValueError(f"{results.folder}: no trial of this study finished, so that there is no score to explain")
    keys = [*(("case",) if any(rows["case"]) else ()), *results.info["factors"]]
    means = rows.group_by("case", *results.info["factors"], maintain_order=True).agg(
        pl.col("pcp").mean(), pl.col("trial").first(), pl.col("seed").min()
    )
    worst = means.row(means["pcp"].arg_min(), named=True)
    scenario = results.scenario_of(worst["trial"]).model_copy(update={"seed": worst["seed"]})
    setting = ", ".join(f"{key} {worst[key]}" for key in keys)
    return blame(scenario, variant=variant, seeds=seeds, setting=setting, workers=workers, reporter=reporter)
