"""Comparison of a recording with its simulated twin: scores of variants in reality and in simulation.

The twin is a scenario with the cameras of the recording, similar people, and a detector fitted to that of the recording
(:mod:`simharness.reality.detector_fit`). Both are scored by the protocol of the recording.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mvpose.skeleton import HeadMapping
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.evaluation import ACTORS, evaluate
from simharness.reality.seed_evaluation import PcpInterval, evaluate_seeds, pcp_interval
from simharness.runtime.progress import Reporter, Silence
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.stages.estimators import estimators_of

TOLERANCE = 2.0
"""Largest accepted difference between a variant's PCP in simulation and in reality, points."""


@dataclass(frozen=True)
class TwinComparison:
    """Scores of variants on a recording and on its simulated twin.

    Attributes:
        name: name of the twin's scenario.
        detector: detector profile of the twin.
        frames: number of frames of the recording, and of each twin.
        seeds: seeds of the twins.
        head: mapping to the head of SHELF14.
        real: PCP on the recording by variant.
        simulated: PCP on the twins by variant.
        summaries: summaries of all scores, by "real" and "simulated", then by variant.
    """

    name: str
    detector: str
    frames: tuple[int, int]
    seeds: tuple[int, ...]
    head: HeadMapping
    real: Mapping[str, PcpInterval]
    simulated: Mapping[str, PcpInterval]
    summaries: Mapping[str, Mapping[str, Any]]

    @property
    def largest_difference(self) -> float:
        """Largest absolute difference between a variant's two scores, PCP points."""
        return max(abs(self.simulated[name].pcp - real.pcp) for name, real in self.real.items())

    @property
    def same_order(self) -> bool:
        """Whether simulation ranks no two variants opposite to reality.

        Variants whose scores in reality differ by at most 0.1 points have no rank.
        """
        names = list(self.real)
        for one in names:
            for other in names:
                clear = self.real[one].pcp > self.real[other].pcp + 0.1
                if clear and self.simulated[one].pcp < self.simulated[other].pcp:
                    return False
        return True

    def summary(self) -> dict[str, Any]:
        """Return all results, ready for JSON."""
        return {
            "name": self.name,
            "detector": self.detector,
            "frames": list(self.frames),
            "seeds": list(self.seeds),
            "head": self.head,
            "apart": self.largest_difference,
            "same_order": self.same_order,
            "pcp": {
                name: {"real": vars(self.real[name]), "simulated": vars(self.simulated[name])} for name in self.real
            },
            "summaries": self.summaries,
        }


def compare(
    recorded: AnnotatedRecording,
    scenario: Scenario,
    *,
    count: int,
    head: HeadMapping = "voxelpose",
    reporter: Reporter | None = None,
) -> TwinComparison:
    """Score variants on a recording and on simulated twins of it.

    Args:
        recorded: the recording.
        scenario: the twin, with the variants.
        count: number of twins: at the scenario's seed and the following ones, except where people do not fit.
        head: mapping to the head of SHELF14.
        reporter: receiver of progress.

    Raises:
        ValueError: twins cannot be built.
    """
    estimators = estimators_of(scenario.method)
    with (reporter or Silence()).stage("recording", 1):
        real = evaluate(recorded, estimators, head=head)
    twins = evaluate_seeds(scenario, count, head=head, reporter=reporter)
    return TwinComparison(
        name=scenario.name,
        detector=scenario.detector.name,
        frames=(len(recorded), scenario.frames),
        seeds=twins.seeds,
        head=head,
        real={name: pcp_interval([real.variants[name]], ACTORS, rate=scenario.rate) for name in estimators},
        simulated={name: twins.pcp(name) for name in estimators},
        summaries={
            "real": {name: real.variants[name].summary(actors=ACTORS) for name in estimators},
            "simulated": {name: twins.pooled(name).summary() for name in estimators},
        },
    )
