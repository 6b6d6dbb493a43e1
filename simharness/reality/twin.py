"""A recording beside its simulated twin: do variants of a method score in simulation what they score in reality?

The twin is a scenario with the recording's cameras and about its people, seen by a detector that was fitted to the
recording's (:mod:`simharness.reality.detector_fit`). Both are scored by the recording's protocol.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from mvpose.skeleton import HeadMapping
from simharness.reality.evaluation import ACTORS, evaluate
from simharness.reality.seed_evaluation import Score, evaluate_seeds, score
from simharness.reality.shelf import Shelf
from simharness.runtime.progress import Reporter, Silence
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.stages.estimators import estimators_of

TOLERANCE = 2.0
"""PCP points that a variant's score in simulation may be from its score in reality."""


@dataclass(frozen=True)
class Comparison:
    """What variants of a method score on a recording and on its twin.

    Attributes:
        name: of the twin's scenario.
        detector: the profile that it is seen with.
        frames: how many of the recording, and of each twin.
        seeds: of the twins.
        head: how the head of SHELF14 was made.
        real: by variant.
        simulated: by variant.
        summaries: what else was scored, by "real" and "simulated" and by variant.
    """

    name: str
    detector: str
    frames: tuple[int, int]
    seeds: tuple[int, ...]
    head: HeadMapping
    real: Mapping[str, Score]
    simulated: Mapping[str, Score]
    summaries: Mapping[str, Mapping[str, Any]]

    @property
    def apart(self) -> float:
        """The most that a variant's two scores are apart, PCP points."""
        return max(abs(self.simulated[name].pcp - real.pcp) for name, real in self.real.items())

    @property
    def same_order(self) -> bool:
        """Whether no two variants are ranked one way in reality and the other way in simulation.

        Variants whose scores in reality are within a tenth of a point are ranked no way.
        """
        names = list(self.real)
        for one in names:
            for other in names:
                clear = self.real[one].pcp > self.real[other].pcp + 0.1
                if clear and self.simulated[one].pcp < self.simulated[other].pcp:
                    return False
        return True

    def summary(self) -> dict[str, Any]:
        """JSON-ready."""
        return {
            "name": self.name,
            "detector": self.detector,
            "frames": list(self.frames),
            "seeds": list(self.seeds),
            "head": self.head,
            "apart": self.apart,
            "same_order": self.same_order,
            "pcp": {
                name: {"real": vars(self.real[name]), "simulated": vars(self.simulated[name])} for name in self.real
            },
            "summaries": self.summaries,
        }


def compare(
    recorded: Shelf,
    scenario: Scenario,
    *,
    count: int,
    head: HeadMapping = "voxelpose",
    reporter: Reporter | None = None,
) -> Comparison:
    """Score variants on a recording and on twins of it.

    Args:
        recorded: the recording.
        scenario: the twin, which names the variants.
        count: of twins: with the scenario's seed and those after it, but for those that do not fit.
        head: the head mapping.
        reporter: receiver of progress.

    Raises:
        ValueError: twins cannot be built.
    """
    estimators = estimators_of(scenario.method)
    with (reporter or Silence()).stage("recording", 1):
        real = evaluate(recorded, estimators, head=head)
    twins = evaluate_seeds(scenario, count, head=head, reporter=reporter)
    return Comparison(
        name=scenario.name,
        detector=scenario.detector.name,
        frames=(len(recorded), scenario.frames),
        seeds=twins.seeds,
        head=head,
        real={name: score([real.variants[name]], ACTORS, rate=scenario.rate) for name in estimators},
        simulated={name: twins.score(name) for name in estimators},
        summaries={
            "real": {name: real.variants[name].summary(actors=ACTORS) for name in estimators},
            "simulated": {name: twins.pooled(name).summary() for name in estimators},
        },
    )


def print_comparison(comparison: Comparison, console: Console) -> None:
    """Print both tables side by side."""
    table = Table(
        title=f"{comparison.name}: PCP in reality and in simulation, with 95 % intervals; median MPJPE",
        title_justify="left",
        title_style="bold",
        box=SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
    )
    table.add_column("variant", no_wrap=True)
    for column in ("real", "simulated", "apart", "mm, real", "mm, sim."):
        table.add_column(column, justify="right", no_wrap=True)
    for name, real in comparison.real.items():
        simulated = comparison.simulated[name]
        errors = [comparison.summaries[which][name]["mpjpe_mm"]["median"] for which in ("real", "simulated")]
        table.add_row(
            name,
            str(real),
            str(simulated),
            f"{simulated.pcp - real.pcp:+.1f}",
            *("–" if error is None else f"{error:.1f}" for error in errors),
        )
    console.print(table)
    order = "the same" if comparison.same_order else "another"
    console.print(
        f"Detector {comparison.detector}, {len(comparison.seeds)} twins of {comparison.frames[1]} frames. At most "
        f"{comparison.apart:.1f} points apart (asked: {TOLERANCE:g}), {order} order.",
        style="dim",
        highlight=False,
    )
