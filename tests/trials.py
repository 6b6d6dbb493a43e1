"""Trials for tests, run up to the stage that a test needs."""

from __future__ import annotations

import contextlib

from simharness.trial.run_trial import run_trial


def simulated(scenario):
    """Return the true sequence and the detected frames of a scenario."""
    result = run_trial(scenario, until="detect")
    return result.simulation.sequence, list(result.detected.frames)


def measured(scenario, variants=None, *, blame=True):
    """Return the results of variants in a trial, by variant."""
    return run_trial(scenario, variants=variants, until="blame" if blame else "classify").results


class Recorder:
    """Reporter that records the stages and steps that it receives.

    Attributes:
        stages: name, total and steps finished earlier of each stage.
        steps: steps and failed steps of each report.
    """

    def __init__(self):
        self.stages = []
        self.steps = []

    @contextlib.contextmanager
    def stage(self, name, total, *, done=0):
        """Record a stage."""
        self.stages.append((name, total, done))
        yield lambda steps, *, failed=0: self.steps.append((steps, failed))
