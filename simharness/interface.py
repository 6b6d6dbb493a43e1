"""Python interface: load a scenario, simulate it, run a trial of it, score estimates, find what cost the score.

::

    import simharness
    from mvpose import Pipeline

    scenario = simharness.load_scenario("quickstart", overrides=["people.count=6", 'rendering.renderer="rays"'])
    recording = simharness.simulate(scenario)
    pipeline = Pipeline.preset("fast")
    estimates = [pipeline.estimate(recording.rig, detections) for detections in recording.detections]
    simharness.score(recording, estimates).scores["pcp"]
    simharness.blame(scenario, seeds=5).shares[0].cause

Studies and gates have interfaces of their own: :func:`simharness.study.study_run.run_study`,
:func:`simharness.testing.assert_robust`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from mvpose import Estimate
from simharness.scenario.load import load
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.assessment import Assessment, assess
from simharness.study.causes.cause_shares import Blame, blame
from simharness.trial.run_trial import TrialResult, run_trial
from simharness.types.recording import Recording

__all__ = ["Blame", "TrialResult", "blame", "load_scenario", "run_trial", "score", "simulate"]


def load_scenario(name: str | Path, *, overrides: Sequence[str] = (), seed: int | None = None) -> Scenario:
    """Load a scenario.

    Args:
        name: name of a shipped scenario, "quickstart", or the path of a scenario file.
        overrides: changed keys, "people.count=6", as ``--set`` takes them.
        seed: seed in place of the scenario's.

    Raises:
        ValueError: no such scenario, or mistakes in it; the message names them all.
    """
    return load(name, overrides=overrides, seed=seed)


def simulate(scenario: Scenario) -> Recording:
    """Simulate a scenario: people, cameras, pictures, detections. The result is audited.

    Returns:
        The recording: detections and truth of each frame, and the believed cameras.

    Raises:
        ValueError: the scenario cannot be built.
        RunError: any error after that.
    """
    return run_trial(scenario, until="detect").recording


def score(recording: Recording, estimates: Sequence[Estimate]) -> Assessment:
    """Score estimates of a recording.

    Args:
        recording: T frames.
        estimates: one for each frame, T; ``Estimate.of_joints(joints)`` makes one of joints (n, 17, 3) in metres.

    Returns:
        Scores by the keys of :data:`simharness.scoring.catalogue.SCORES`, and tables by frame and by person.

    Raises:
        ValueError: another number of estimates, or estimates that do not fit the detections.
    """
    return assess(recording, estimates)
