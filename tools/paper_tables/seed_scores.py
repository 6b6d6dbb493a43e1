"""Scores of a scenario at many seeds by the protocol of recorded data, for the twins in the paper's tables.

``python -m tools.paper_tables.seed_scores SCENARIO --seeds N --set KEY=VALUE --json FILE`` prints a table and writes a
file, which :mod:`tools.paper_tables` reads.
"""

import argparse
import itertools
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from rich.console import Console

from mvpose.arrays import Floats
from mvpose.commands.output_files import write_json
from mvpose.commands.progress import Reporter, Silence, reporter
from mvpose.skeleton import HeadMapping
from simharness.cli.score_tables import ScoreTable
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.annotation_errors import annotate_simulation
from simharness.reality.evaluation import Evaluation, score_estimates
from simharness.scenario.load import load
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.pcp import Part
from simharness.scoring.score_summary import VariantScores
from simharness.statistics.intervals import mean_interval
from simharness.statistics.resampling import block_weights, blocks, interval, resampled
from simharness.trial.identity import provenance
from simharness.trial.run_trial import TrialResult, run_trial
from tools.jackknife import pseudo_values

COMMAND = "tools.paper_tables.seed_scores"
"""Module that is run."""

_ATTEMPTS = 3  # seeds tried for each one requested, because randomly drawn people may not fit beside clutter
_RESAMPLES = 1000


@dataclass(frozen=True)
class PcpInterval:
    """PCP, percent, or a difference of PCP, points, with its 95 % interval.

    Attributes:
        pcp: value.
        low, high: ends of the interval; NaN where fewer than two seeds have the value.
    """

    pcp: float
    low: float
    high: float

    def summary(self) -> dict[str, float | None]:
        """Return the fields, ready for JSON: None for a value that is unknown."""
        return {key: value if np.isfinite(value) else None for key, value in vars(self).items()}

    def __str__(self) -> str:
        return f"{self.pcp:.1f} ({self.low:.1f}–{self.high:.1f})"


@dataclass(frozen=True)
class SeedEvaluation:
    """Scores of the variants of a scenario at several seeds."""

    scenario: Scenario
    """The scenario, with its first seed."""
    head: HeadMapping
    """Mapping to the head of SHELF14."""
    evaluations: Mapping[int, Evaluation]
    """Evaluations by seed."""

    @property
    def seeds(self) -> tuple[int, ...]:
        """Seeds, in the order of evaluation."""
        return tuple(self.evaluations)

    def variant_scores(self, name: str) -> list[VariantScores]:
        """Return the scores of a variant at each seed."""
        return [each.variants[name] for each in self.evaluations.values()]

    def pooled(self, name: str) -> VariantScores:
        """Return the scores of a variant in all frames of all seeds."""
        return VariantScores.pooled(self.variant_scores(name))

    def pcp(self, name: str, people: Sequence[int] | None = None) -> PcpInterval:
        """Return the PCP of a variant, mean over ``people`` (None: all)."""
        return pcp_interval(self.variant_scores(name), self._people(people), rate=self.scenario.rate)

    def difference(self, name: str, other: str, people: Sequence[int] | None = None) -> PcpInterval:
        """Return the PCP of a variant minus that of another on the same detections, points."""
        counts, other_counts = (_counts(self.variant_scores(each), self._people(people)) for each in (name, other))
        difference = _pcp(counts.sum(axis=0)) - _pcp(other_counts.sum(axis=0))
        over = mean_interval(pseudo_values(_pcp, counts) - pseudo_values(_pcp, other_counts))
        return PcpInterval(float(difference), over.low, over.high)

    def _people(self, people: Sequence[int] | None) -> Sequence[int]:
        return range(self.scenario.people.count) if people is None else people

    def summary(self) -> dict[str, Any]:
        """Return all results, ready for JSON."""
        first, *others = self.scenario.method.variants
        people = range(self.scenario.people.count)
        return {
            "name": self.scenario.name,
            "detector": self.scenario.detector.name,
            "appearance": self.scenario.appearance.source,
            "frames": self.scenario.frames,
            "seeds": list(self.seeds),
            "head": self.head,
            "pcp": {name: self.pcp(name).summary() for name in (first, *others)},
            "pcp_people": {
                name: [self.pcp(name, [person]).summary() for person in people] for name in (first, *others)
            },
            f"ahead_of_{first}": {name: self.difference(name, first).summary() for name in others},
            "summaries": {name: self.pooled(name).summary() for name in (first, *others)},
        }


def evaluate_seeds(
    scenario: Scenario, count: int, *, head: HeadMapping = "voxelpose", reporter: Reporter | None = None
) -> SeedEvaluation:
    """Run and score a scenario at ``count`` seeds: its seed and the following ones, except where people do not fit.

    Args:
        scenario: the scenario, with its variants.
        count: number of seeds.
        head: mapping to the head of SHELF14.
        reporter: receiver of progress, one step for each seed.

    Raises:
        ValueError: the scenario cannot be built, after three attempts for each requested seed.
    """
    done: dict[int, Evaluation] = {}
    with (reporter or Silence()).stage("seeds", count) as advance:
        for seed in itertools.count(scenario.seed):
            try:
                result = run_trial(scenario.model_copy(update={"seed": seed}), until="estimate")
            except ValueError:
                if seed - scenario.seed >= _ATTEMPTS * count:
                    raise
                continue
            done[seed] = score_estimates(annotate(result), result.estimates, head=head)
            advance(1)
            if len(done) == count:
                break
    return SeedEvaluation(scenario, head, done)


def annotate(result: TrialResult) -> AnnotatedRecording:
    """Return a simulated trial as an annotated recording, with annotations like those of Shelf.

    A person is annotated, with the body's landmarks, if all limb joints are inside the pictures of all cameras except
    one (of at least two cameras). This holds for 504 of the 510 annotations in Shelf's test frames. The errors of the
    annotation are those of the scenario's section ``[annotation]``.

    Raises:
        ValueError: the trial was not simulated.
    """
    recording = result.recording
    assert result.simulation is not None
    scenario = result.scenario
    whole = scenario.model_copy(update={"annotation": scenario.annotation.model_copy(update={"people": "whole"})})
    truth = annotate_simulation(whole, result.simulation.sequence, recording.rig)
    return AnnotatedRecording(
        recording.rig,
        truth,
        recording.detections,
        np.arange(len(recording)),
        name=scenario.name,
        rate=scenario.rate,
        kind=scenario.detector.kind,
    )


def pcp_interval(recordings: Sequence[VariantScores], people: Sequence[int], *, rate: float) -> PcpInterval:
    """Return the PCP of a variant, mean over people, with its interval.

    The interval of one recording comes from resampling blocks of its frames. That of several recordings is over the
    recordings, because the frames of a recording share their scene: the interval of the mean of their pseudo-values.

    Args:
        recordings: scores of the variant in each recording.
        people: indices of the people that count.
        rate: frame rate, Hz.
    """
    if len(recordings) == 1:
        counts = _counts_by_frame(recordings[0], people)
        time = np.arange(len(counts)) / rate
        drawn = _pcp(resampled(counts, block_weights(time, resamples=_RESAMPLES)))
        low, high = (float(end) for end in interval(drawn, blocks=blocks(time)))
    else:
        counts = _counts(recordings, people)
        over = mean_interval(pseudo_values(_pcp, counts), unit="%")
        low, high = over.low, over.high
    pcp = float(_pcp(counts.sum(axis=0)))
    return PcpInterval(pcp, min(low, pcp), max(high, pcp))


def _counts(recordings: Sequence[VariantScores], people: Sequence[int]) -> Floats:
    """Count the correct and the defined parts of people in each recording, (n, A, 2)."""
    return np.stack([_counts_by_frame(each, people).sum(axis=0) for each in recordings])


def _counts_by_frame(recording: VariantScores, people: Sequence[int]) -> Floats:
    """Count the correct and the defined parts of people in each frame, (F, A, 2)."""
    parts = recording.frames.parts[:, list(people)]
    return np.stack([(parts == Part.CORRECT).sum(axis=2), (parts != Part.UNDEFINED).sum(axis=2)], axis=-1)


def _pcp(counts: Floats) -> Floats:
    """Return PCP, percent (...), from counts (..., A, 2), mean over the people with defined parts."""
    with np.errstate(invalid="ignore"):
        share = counts[..., 0] / counts[..., 1]
        known = np.isfinite(share)
        return np.asarray(100 * np.where(known, share, 0.0).sum(axis=-1) / known.sum(axis=-1))


def table(result: SeedEvaluation) -> ScoreTable:
    """Return the table of PCP by variant, of all people and of each person."""
    first, *others = result.scenario.method.variants
    people = range(result.scenario.people.count)
    rows = []
    for name in (first, *others):
        difference = "" if name == first else result.difference(name, first)
        scores = [result.pcp(name, [person]) for person in people]
        rows.append((name, str(result.pcp(name)), str(difference), *(f"{each.pcp:.1f}" for each in scores)))
    title = (
        f"{result.scenario.name}: PCP over {len(result.seeds)} seeds with 95 % intervals: of all people, minus "
        f"{first} on the same detections, and of each person"
    )
    return ScoreTable(title, ("variant",), ("all", f"minus {first}", *map(str, people)), rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return 2 where the scenario cannot be read or built."""
    words, start = list(sys.argv[1:] if arguments is None else arguments), perf_counter()
    parser = argparse.ArgumentParser(prog=f"python -m {COMMAND}", description="Score a scenario at many seeds.")
    parser.add_argument("scenario", help="scenario file, or the name of a shipped scenario")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="change a key of the scenario")
    parser.add_argument("--seeds", type=int, default=10, metavar="N", help="number of seeds (default: 10)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="file of all results")
    options = parser.parse_args(words)
    try:
        scenario = load(options.scenario, overrides=options.set)
        with reporter() as bars:
            result = evaluate_seeds(scenario, options.seeds, reporter=bars)
        if options.json is not None:
            made = provenance(
                command=shlex.join(["python", "-m", COMMAND, *words]),
                seeds=result.seeds,
                variants=scenario.method.variants,
                seconds=perf_counter() - start,
            )
            write_json({**made, **result.summary()}, options.json)
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    table(result).print_to(Console())
    return 0


if __name__ == "__main__":
    sys.exit(main())
