"""Studies in which a variant failed in some trials."""

import dataclasses

import polars as pl
import pytest
from made_study import make_study

from simharness.outputs.study.page import render_study
from simharness.outputs.study.tables import differences
from simharness.outputs.study.worst_frames import worst_frames


def lacking(results, variant, trials):
    """Return the study in which a variant failed in some trials."""
    failed = [
        {"trial": trial, "case": "", "factors": {}, "seed": 0, "variants": [variant], "error": f"{variant}: boom"}
        for trial in trials
    ]
    gone = (pl.col("variant") == variant) & pl.col("trial").is_in(trials)
    kept = {name: getattr(results, name).filter(~gone) for name in ("trials", "frames", "people", "failures")}
    return dataclasses.replace(results, info={**results.info, "failed": failed}, **kept)


@pytest.mark.parametrize("variant", ["full", "fast"])
def test_a_difference_is_over_the_trials_that_both_have(tmp_path, variant):
    # PCP grows by 5 per camera and is lower by 4 for "fast" in every trial, so the difference is 4 in all subsets.
    results = make_study(tmp_path, factors={"cameras.count": [2, 3, 5]}, seeds=4)
    hard = results.trials.filter(pl.col("cameras.count") == 5, pl.col("seed") < 3)["trial"].unique().to_list()
    (cells,) = differences(lacking(results, variant, hard).trials, ("full", "fast")).values()
    assert cells[0].text == "−4.0"


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["full", "fast"])
@pytest.mark.parametrize("share", [0.1, 0.9, 1.0])
def test_the_page_is_made_from_the_trials_that_finished(tmp_path, variant, share):
    factors = {"cameras.count": [2, 3, 5], "people.count": [1, 2]}
    results = make_study(tmp_path, factors=factors, seeds=3)
    trials = results.trials["trial"].unique(maintain_order=True).to_list()
    results = lacking(results, variant, trials[: max(1, round(share * len(trials)))])
    page = render_study(results)
    assert f"{variant}: boom" in page
    assert len(worst_frames(results)) > 0
