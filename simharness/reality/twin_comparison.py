"""Comparison of a recording with its simulated twins: PCP of variants in reality and in simulation.

This is the short form of a validation (:mod:`simharness.reality.validation`), which compares much more.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mvpose import preset
from mvpose.commands.progress import Reporter, Silence
from mvpose.skeleton import HeadMapping
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.evaluation import evaluate
from simharness.reality.seed_evaluation import PcpInterval, pcp_interval
from simharness.scoring.score_summary import VariantScores

VARIANTS = ("full", "fast", "no-3dps", "no-matching")
"""Presets that are compared."""

TOLERANCE = 2.0
"""Largest accepted difference between a variant's PCP in simulation and in reality, points."""


@dataclass(frozen=True)
class TwinComparison:
    """Scores of variants on a recording and on its simulated twin.

    Attributes:
        name: name of the recording.
        frames: number of frames of the recording, and of each twin.
        seeds: seeds of the twins.
        head: mapping to the head of SHELF14.
        real: PCP on the recording by variant.
        simulated: PCP on the twins by variant.
        summaries: summaries of all scores, by "real" and "simulated", then by variant.
    """

    name: str
    frames: int
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
            "frames": self.frames,
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
    twins: Sequence[AnnotatedRecording],
    *,
    variants: Sequence[str] = VARIANTS,
    head: HeadMapping = "voxelpose",
    reporter: Reporter | None = None,
) -> TwinComparison:
    """Score variants on a recording and on simulated twins of it.

    Args:
        recorded: the recording.
        twins: its twins, of seeds 0, 1, ...
        variants: presets of the method.
        head: mapping to the head of SHELF14.
        reporter: receiver of progress.

    Raises:
        ValueError: no twins.
    """
    if not twins:
        raise ValueError(f"{recorded.name}: expected one or more twins to compare with, got none")
    estimators = {name: preset(name) for name in variants}
    scores: list[Mapping[str, VariantScores]] = []
    with (reporter or Silence()).stage("evaluate", 1 + len(twins)) as advance:
        for each in (recorded, *twins):
            scores.append(evaluate(each, estimators, head=head).variants)
            advance(1)
    real, simulated, actors = scores[0], scores[1:], recorded.scored
    pooled = {name: VariantScores.pooled([each[name] for each in simulated]) for name in variants}
    return TwinComparison(
        name=recorded.name,
        frames=len(recorded),
        seeds=tuple(range(len(twins))),
        head=head,
        real={name: pcp_interval([real[name]], actors, rate=recorded.rate) for name in variants},
        simulated={
            name: pcp_interval([each[name] for each in simulated], actors, rate=recorded.rate) for name in variants
        },
        summaries={
            "real": {name: real[name].summary(actors=actors) for name in variants},
            "simulated": {name: pooled[name].summary(actors=actors) for name in variants},
        },
    )
