"""Replay of a trial for pictures: scene, detections and estimates, which tables of scores do not hold."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose import Detections, Estimate
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.pairing import pair
from simharness.trial.run_folder import Record
from simharness.trial.run_trial import run_trial
from simharness.trial.stages.build_trial import Trial, build_trial
from simharness.types.truth import Truth


@dataclass(frozen=True)
class Replay:
    """Scene, truth, detections and estimates of one variant in a trial.

    Attributes:
        trial: the built scenario.
        variant: variant of the method.
        time: time of each frame, (T,), seconds.
        truth: truth of each frame, T.
        detections: detections of each frame, T.
        estimates: estimates of the variant for each frame, T.
    """

    trial: Trial
    variant: str
    time: NDArray[np.float64]
    truth: tuple[Truth, ...]
    detections: tuple[Detections, ...]
    estimates: tuple[Estimate, ...]

    def owners(self, frame: int) -> NDArray[np.int64]:
        """Return the true person of each estimate of a frame, (n,), -1 for a ghost."""
        estimate = self.estimates[frame]
        partner = pair(self.truth[frame].joints, estimate.joints).estimate
        owner = np.full(len(estimate), -1)
        owner[partner[partner >= 0]] = np.flatnonzero(partner >= 0)
        return owner


def replay(scenario: Scenario, variant: str) -> Replay:
    """Run one variant on a scenario again; the same scenario and code give the same result.

    Raises:
        ValueError: the scenario cannot be built any more, for example because a file that it names is missing.
    """
    result = run_trial(scenario, variants=[variant], until="estimate")
    recording = result.recording
    return Replay(
        result.trial, variant, recording.time, recording.truth, recording.detections, result.estimates[variant]
    )


def replay_run(record: Record) -> Replay:
    """Restore the worst variant of a stored run, the one with the lowest PCP. Only the scene is built again.

    Args:
        record: from :func:`simharness.trial.run_folder.read_run`.

    Raises:
        ValueError: the scenario cannot be built any more, for example because a file that it names is missing.
    """
    pcp = {name: scores["pcp"] for name, scores in record.summary["variants"].items()}
    variant = min(record.estimates, key=lambda name: math.inf if pcp[name] is None else pcp[name])
    trial = build_trial(record.scenario)
    return Replay(trial, variant, record.time, record.truth, record.detections, record.estimates[variant])
