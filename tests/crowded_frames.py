"""Frames of a small crowd before a detector with many errors, for tests of frozen frames."""

from functools import cache

import simharness
from simharness.trial.run_trial import run_trial

OVERRIDES = (
    "people.count=4",
    "people.spacing=0.5",
    "people.area=1.5",
    "duration=1.0",
    "cameras.count=4",
    "detector.profile=crowded",
    "detector.phantoms.rate=0.5",
    "rendering.renderer=rays",
)


@cache
def crowd(*more, seed=0):
    """Return the detected frames of a trial."""
    scenario = simharness.load_scenario("quickstart", overrides=[*OVERRIDES, *more], seed=seed)
    return run_trial(scenario, variants=["full"], until="detect").recording
