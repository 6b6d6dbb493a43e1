"""Variants with repair: what a scenario may say, and that they get the whole trial."""

import pytest
from trials import measured

from simharness.scenario.load import load, load_study
from simharness.study.study_folder import plan
from simharness.trial.stages.estimators import estimators_of

WALK = (
    "duration=6.0", "rate=12.5", "faults.rotation=2.0", 'people.activities=["walk"]', "people.count=3",
    'rendering.renderer="rays"', "clutter.boxes=0", "clutter.shelves=0",
)  # fmt: skip


@pytest.mark.slow
def test_repair_wins_back_what_a_wrong_calibration_costs():
    scenario = load("quickstart", overrides=[*WALK, 'variants=["fast", "fast+repair"]'])
    results = measured(scenario, ["fast", "fast+repair"], blame=False)
    without, repaired = (results[name].scores["pcp"] for name in ("fast", "fast+repair"))
    assert without < 90.0
    assert repaired > 95.0


def test_the_suffix_is_for_presets():
    scenario = load("quickstart", overrides=['variants=["track+repair", "full"]'])
    assert list(estimators_of(scenario.method)) == ["track+repair", "full"]
    with pytest.raises(ValueError, match="unknown variant 'ful\\+repair'"):
        load_study("quickstart", variants=["ful+repair"])


def test_a_preset_that_needs_descriptors_needs_them_with_repair_as_well():
    with pytest.raises(ValueError, match=r"appearance\+repair needs descriptors"):
        load_study("quickstart", variants=["appearance+repair"])


def test_the_lag_counts_for_trackers_with_repair():
    entries = [
        plan(load_study("quickstart", variants=["track+repair", "full+repair"], overrides=[f"method.lag={lag}"]))[0]
        for lag in (0.0, 0.2)
    ]
    assert entries[0].entries["track+repair"] != entries[1].entries["track+repair"]
    assert entries[0].entries["full+repair"] == entries[1].entries["full+repair"]
