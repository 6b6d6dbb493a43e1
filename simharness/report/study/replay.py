"""A trial once more, for pictures: everything that its table of scores does not keep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose import Detections, Estimate
from simharness.pairing.pairing import pair
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.run_trial import run_trial
from simharness.trial.stages.build_trial import Trial
from simharness.types.truth import Truth


@dataclass(frozen=True)
class Replay:
    """What happened in a trial.

    Attributes:
        trial: built.
        variant: of the method.
        time: of the frames, (T,), seconds.
        truth: T frames.
        detections: T frames.
        estimates: what the variant said of them.
    """

    trial: Trial
    variant: str
    time: NDArray[np.float64]
    truth: tuple[Truth, ...]
    detections: tuple[Detections, ...]
    estimates: tuple[Estimate, ...]

    def owners(self, frame: int) -> NDArray[np.int64]:
        """The true person of each estimate of a frame, -1 of a ghost."""
        estimate = self.estimates[frame]
        partner = pair(self.truth[frame].joints, estimate.joints).estimate
        owner = np.full(len(estimate), -1)
        owner[partner[partner >= 0]] = np.flatnonzero(partner >= 0)
        return owner


def replay(scenario: Scenario, variant: str) -> Replay:
    """Run one variant on a scenario: the same scenario and code give the same again.

    Raises:
        ValueError: the scenario cannot be built any more: a file that it names is gone.
    """
    result = run_trial(scenario, variants=[variant], until="estimate")
    recording = result.recording
    return Replay(
        result.trial, variant, recording.time, recording.truth, recording.detections, result.estimates[variant]
    )
