"""A scenario over many seeds, scored by the protocol of recorded data: what a variant of the method is worth there."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from mvpose.arrays import Floats
from mvpose.skeleton import SHELF14, HeadMapping
from simharness.reality.evaluation import Evaluation, score_estimates
from simharness.reality.shelf import Shelf
from simharness.runtime.progress import Reporter, Silence
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.pcp import Part
from simharness.scoring.summary import VariantScores
from simharness.statistics.bootstrap import block_weights, interval, resampled
from simharness.trial.run_trial import TrialResult, run_trial

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
class Seeds:
    """What the variants of a scenario scored at each of its seeds.

    Attributes:
        scenario: of which the seed is replaced.
        head: how the head of SHELF14 was made.
        evaluations: by seed.
    """

    scenario: Scenario
    head: HeadMapping
    evaluations: Mapping[int, Evaluation]

    @property
    def seeds(self) -> tuple[int, ...]:
        """The seeds."""
        return tuple(self.evaluations)

    def of_variant(self, name: str) -> list[VariantScores]:
        """Scores of one variant, one for each seed."""
        return [each.variants[name] for each in self.evaluations.values()]

    def pooled(self, name: str) -> VariantScores:
        """All frames of all seeds in one."""
        return VariantScores(
            tuple(frame for each in self.of_variant(name) for frame in each.frames),
            tuple(timing for each in self.of_variant(name) for timing in each.timings),
        )

    def score(self, name: str, people: Sequence[int] | None = None) -> Score:
        """PCP of a variant, the mean over people (all, where none are named)."""
        return score(self.of_variant(name), self._people(people), rate=self.scenario.rate)

    def ahead(self, name: str, other: str, people: Sequence[int] | None = None) -> Score:
        """By how many points of PCP a variant is ahead of another on the same detections."""
        mine, theirs = (_counts(self.of_variant(each), self._people(people)) for each in (name, other))
        weights = block_weights(np.arange(len(mine)), block=1.0, resamples=_RESAMPLES)
        low, high = interval(_pcp(resampled(mine, weights)) - _pcp(resampled(theirs, weights)), blocks=len(mine))
        return Score(float(_pcp(mine.sum(axis=0)) - _pcp(theirs.sum(axis=0))), float(low), float(high))

    def _people(self, people: Sequence[int] | None) -> Sequence[int]:
        return range(self.scenario.people.count) if people is None else people

    def summary(self) -> dict[str, Any]:
        """JSON-ready."""
        first, *others = self.scenario.method.variants
        everyone = range(self.scenario.people.count)
        return {
            "name": self.scenario.name,
            "detector": self.scenario.detector.name,
            "appearance": self.scenario.appearance.source,
            "frames": self.scenario.frames,
            "seeds": list(self.seeds),
            "head": self.head,
            "pcp": {name: vars(self.score(name)) for name in (first, *others)},
            "pcp_people": {
                name: [vars(self.score(name, [person])) for person in everyone] for name in (first, *others)
            },
            f"ahead_of_{first}": {name: vars(self.ahead(name, first)) for name in others},
            "summaries": {name: self.pooled(name).summary() for name in (first, *others)},
        }


def evaluate_seeds(
    scenario: Scenario,
    count: int,
    *,
    head: HeadMapping = "voxelpose",
    reporter: Reporter | None = None,
) -> Seeds:
    """Run a scenario at ``count`` seeds: its own and those after it, but for those at which people do not fit.

    Args:
        scenario: with its variants.
        count: of seeds.
        head: the head mapping.
        reporter: receiver of progress, a step a seed.

    Raises:
        ValueError: it cannot be built, at three times as many seeds as asked for.
    """
    done: dict[int, Evaluation] = {}
    with (reporter or Silence()).stage("seeds", count) as advance:
        for seed in itertools.count(scenario.seed):
            try:
                result = run_trial(scenario.model_copy(update={"seed": seed}), until="estimate")
            except ValueError:
                if seed - scenario.seed >= _SKIPPED * count:
                    raise
                continue
            done[seed] = score_estimates(annotated_recording(result), result.estimates, head=head)
            advance(1)
            if len(done) == count:
                break
    return Seeds(scenario, head, done)


def annotated_recording(result: TrialResult) -> Shelf:
    """Return a simulated trial in the form of a recording that people have annotated.

    A person is annotated, by the body's landmarks, where all cameras but one (at least two cameras) have the person's
    limbs whole in their pictures: this holds for 504 of the 510 people who are annotated in Shelf's test frames.

    Raises:
        ValueError: the trial was not simulated.
    """
    recording = result.recording
    assert result.simulation is not None
    rig, truth = recording.rig, result.simulation.sequence.of_skeleton(SHELF14)
    inside = np.stack([camera.inside(camera.project(truth[..., :_LIMBS, :])).all(axis=-1) for camera in rig])
    truth[inside.sum(axis=0) < max(2, len(rig) - 1)] = np.nan
    people = result.scenario.people.count
    return Shelf(rig, truth, recording.detections, np.arange(len(recording)), people=people)


def score(recordings: Sequence[VariantScores], people: Sequence[int], *, rate: float) -> Score:
    """The PCP of recordings, the mean over people, with an interval by resampling blocks of their frames.

    Of several recordings the interval is by resampling those, for frames of one have a scene in common.

    Args:
        recordings: of one variant.
        people: whose parts count.
        rate: frames a second.
    """
    if len(recordings) == 1:
        frames = _by_frame(recordings[0], people)
        weights, blocks = block_weights(np.arange(len(frames)) / rate, resamples=_RESAMPLES), None
    else:
        frames = _counts(recordings, people)
        weights, blocks = block_weights(np.arange(len(frames)), block=1.0, resamples=_RESAMPLES), len(frames)
    low, high = interval(_pcp(resampled(frames, weights)), blocks=blocks)
    return Score(float(_pcp(frames.sum(axis=0))), float(low), float(high))


def _counts(recordings: Sequence[VariantScores], people: Sequence[int]) -> Floats:
    """Right and counted parts of people in each recording, (n, A, 2)."""
    return np.stack([_by_frame(each, people).sum(axis=0) for each in recordings])


def _by_frame(recording: VariantScores, people: Sequence[int]) -> Floats:
    """Right and counted parts of people in each frame, (F, A, 2)."""
    parts = np.stack([frame.parts for frame in recording.frames])[:, list(people)]
    return np.stack([(parts == Part.CORRECT).sum(axis=2), (parts != Part.UNDEFINED).sum(axis=2)], axis=-1)


def _pcp(counts: Floats) -> Floats:
    """Percent, (...), of right and counted parts (..., A, 2), a mean over those who are counted at all."""
    with np.errstate(invalid="ignore"):
        share = counts[..., 0] / counts[..., 1]
        known = np.isfinite(share)
        return np.asarray(100 * np.where(known, share, 0.0).sum(axis=-1) / known.sum(axis=-1))


def print_seeds(result: Seeds, console: Console) -> None:
    """Print PCP by variant and person."""
    first, *others = result.scenario.method.variants
    table = Table(
        title=f"{result.scenario.name}: PCP over {len(result.seeds)} seeds, with 95 % intervals; beside {first} on the "
        "same detections; of each person",
        title_justify="left",
        title_style="bold",
        box=SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
    )
    table.add_column("variant", no_wrap=True)
    people = range(result.scenario.people.count)
    for column in ("everybody", f"beside {first}", *map(str, people)):
        table.add_column(column, justify="right", no_wrap=True)
    for name in (first, *others):
        ahead = "" if name == first else result.ahead(name, first)
        scores = [result.score(name, [person]) for person in people]
        table.add_row(name, str(result.score(name)), str(ahead), *(f"{each.pcp:.1f}" for each in scores))
    console.print(table)
