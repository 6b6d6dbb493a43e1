"""A recording beside its simulated twin: do variants of a method score in simulation what they score in reality?

The twin is a scenario with the recording's cameras and about its people, seen by a detector that was fitted to the
recording's (:mod:`simharness.detector.fitting`). Both are scored by the recording's protocol.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from mvpose import Pipeline
from mvpose.skeleton import SHELF14, HeadMapping
from simharness.datasets.evaluate import ACTORS, Evaluation, evaluate
from simharness.datasets.shelf import Shelf
from simharness.experiment.looking import look
from simharness.experiment.trial import prepare
from simharness.scenario.models import Scenario
from simharness.scoring.bootstrap import block_weights, interval, resampled
from simharness.scoring.pcp import Part
from simharness.scoring.summary import VariantScores

Floats = NDArray[np.float64]

TOLERANCE = 2.0
"""PCP points that a variant's score in simulation may be from its score in reality."""

WHOLE = 4
"""Cameras that must have all of a person's limb joints in their pictures for the person to be annotated: of the 510
annotated people of Shelf's test frames 504 are so."""

_SKIPPED = 3  # times as many seeds are tried, for people drawn at random may not fit about a thing
_LIMBS = 12  # joints of SHELF14, before those of the head
_RESAMPLES = 1000


@dataclass(frozen=True)
class Score:
    """A PCP, percent, with its 95 % interval."""

    pcp: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.pcp:.1f} ({self.low:.1f}–{self.high:.1f})"


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
        return max(abs(self.simulated[name].pcp - score.pcp) for name, score in self.real.items())

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
    progress: Callable[[int], None] = lambda runs: None,
) -> Comparison:
    """Score variants on a recording and on twins of it.

    Args:
        recorded: the recording.
        scenario: the twin, which names the variants.
        count: of twins: with the scenario's seed and those after it, but for those that do not fit.
        head: the head mapping.
        progress: is told of every recording and twin that is done.

    Raises:
        ValueError: twins cannot be built.
    """
    estimators = {name: Pipeline.preset(name) for name in scenario.method.variants}
    real = evaluate(recorded, estimators, head=head)
    progress(1)
    twins: dict[int, Evaluation] = {}
    for seed in itertools.count(scenario.seed):
        try:
            recording = record_twin(scenario.model_copy(update={"seed": seed}))
        except ValueError:
            if seed - scenario.seed >= _SKIPPED * count:
                raise
            continue
        twins[seed] = evaluate(recording, estimators, head=head)
        progress(1)
        if len(twins) == count:
            break
    everyone = range(scenario.people.count)
    scores = {name: [twin.variants[name] for twin in twins.values()] for name in estimators}
    pooled = {
        name: VariantScores(
            tuple(frame for twin in each for frame in twin.frames),
            tuple(timing for twin in each for timing in twin.timings),
        )
        for name, each in scores.items()
    }
    return Comparison(
        name=scenario.name,
        detector=scenario.detector.name,
        frames=(len(recorded), scenario.frames),
        seeds=tuple(twins),
        head=head,
        real={name: _score([real.variants[name]], ACTORS, scenario.rate) for name in estimators},
        simulated={
            name: _score([twin.variants[name] for twin in twins.values()], everyone, scenario.rate)
            for name in estimators
        },
        summaries={
            "real": {name: real.variants[name].summary(actors=ACTORS) for name in estimators},
            "simulated": {name: each.summary() for name, each in pooled.items()},
        },
    )


def record_twin(scenario: Scenario) -> Shelf:
    """A simulated recording in the form of the real one, annotated by the body's own landmarks: who is seen whole.

    Raises:
        ValueError: it cannot be built.
    """
    trial = prepare(scenario)
    sequence, answers = look(trial)
    rig, truth = trial.shots.believed, sequence.of_skeleton(SHELF14)
    seen = np.stack([camera.inside(camera.project(truth[..., :_LIMBS, :])).all(axis=-1) for camera in rig])
    truth[seen.sum(axis=0) < min(WHOLE, len(rig))] = np.nan
    return Shelf(
        rig=rig,
        truth=truth,
        detections=tuple(answer.detections for answer in answers),
        frames=np.arange(len(sequence)),
    )


def _score(recordings: Sequence[VariantScores], actors: Sequence[int], rate: float) -> Score:
    """The PCP of recordings, the mean over actors, with an interval by resampling blocks of their frames.

    Of several recordings the interval is by resampling those, for frames of one have a scene in common.
    """
    parts = [np.stack([frame.parts for frame in each.frames])[:, list(actors)] for each in recordings]
    sums = [np.stack([(each == Part.CORRECT).sum(axis=2), (each != Part.UNDEFINED).sum(axis=2)], -1) for each in parts]
    if len(sums) == 1:
        frames = sums[0]
        weights = block_weights(np.arange(len(frames)) / rate, resamples=_RESAMPLES)
    else:
        frames = np.stack([each.sum(axis=0) for each in sums])
        weights = block_weights(np.arange(len(frames)), block=1.0, resamples=_RESAMPLES)
    low, high = interval(_pcp(resampled(frames, weights)), blocks=len(frames) if len(sums) > 1 else None)
    return Score(float(_pcp(frames.sum(axis=0))), float(low), float(high))


def _pcp(counts: Floats) -> Floats:
    """Percent, (...), of right and counted parts (..., A, 2), a mean over those who are counted at all."""
    with np.errstate(invalid="ignore"):
        return np.asarray(100 * np.nanmean(counts[..., 0] / counts[..., 1], axis=-1))


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
    for column in ("real", "simulated", "apart", "real, mm", "simulated, mm"):
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
