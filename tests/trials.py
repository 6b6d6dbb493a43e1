"""Trials of tests: simulated as far as a test needs."""

from __future__ import annotations

from simharness.trial.run_trial import run_trial


def simulated(scenario):
    """Return the true sequence and the detected frames of a scenario."""
    result = run_trial(scenario, until="detect")
    return result.simulation.sequence, list(result.detected.frames)


def measured(scenario, variants=None, *, blame=True):
    """Return the results of variants in a trial, by variant."""
    return run_trial(scenario, variants=variants, until="blame" if blame else "classify").results
