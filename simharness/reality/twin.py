"""Simulated twins of a recording: the same rig, people, poses and frames, a fitted detector and a fitted annotation.

A twin is a recording like the real one, to be scored by the same protocol. It holds nothing of the real detections but
what the fit has measured: parameters of the detector, who was where, and how the truth was annotated.

The comparison of PCP of variants in reality and in simulation is the short form of a validation
(:mod:`simharness.reality.validation`), which compares much more.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from mvpose import preset
from mvpose.commands.progress import Reporter, Silence
from mvpose.recording import People
from mvpose.skeleton import HeadMapping
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.annotation_errors import AnnotationModel
from simharness.reality.detector_fit.fit import DetectorFit
from simharness.reality.evaluation import evaluate
from simharness.reality.filmed_recording import FilmedRecording, cut_takes, film
from simharness.reality.seed_evaluation import PcpInterval, pcp_interval
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.scoring.score_summary import VariantScores

MOST_FILMS = 3
"""Largest number of films of a recording. More twins have the bodies of earlier ones, and detections of their own:
the bodies matter less than the draws of the detector, and filming takes longest."""


@dataclass(frozen=True)
class TwinModel:
    """Everything that a twin is made from."""

    recording: AnnotatedRecording
    """The real recording: its rig, its frames, and which actors are annotated in which of them."""
    people: People
    """Who is where in the recording."""
    detector: DetectorSection
    """Fitted detector."""
    annotation: AnnotationModel
    """Fitted annotation, relative to the joints as the detector finds them: the films show these."""
    films: tuple[FilmedRecording, ...] = ()
    """Re-enactments that exist already, of seeds 0, 1, ..."""

    @classmethod
    def of_fit(cls, recording: AnnotatedRecording, fitted: DetectorFit) -> Self:
        """Return the model of twins of a recording, with its own fit."""
        return cls(recording, fitted.people, fitted.profile, fitted.annotation.of_detected, fitted.films)


def simulate_twins(model: TwinModel, *, count: int, reporter: Reporter | None = None) -> list[AnnotatedRecording]:
    """Simulate twins of a recording.

    Args:
        model: what they are made from.
        count: number of twins; their seeds are 0, 1, ...
        reporter: receiver of progress.

    Raises:
        ValueError: nobody is long enough in the recording, or the scene cannot be built.
    """
    films, shown = list(model.films[:count]), min(count, MOST_FILMS)
    takes = len(cut_takes(model.recording, model.people))
    with (reporter or Silence()).stage("film twins", (shown - len(films)) * takes) as advance:
        for seed in range(len(films), shown):
            films.append(film(model.recording, model.people, seed=seed, advance=advance))
    return [detected_twin(model, films[seed % shown], seed=seed) for seed in range(count)]


def detected_twin(model: TwinModel, filmed: FilmedRecording, *, seed: int) -> AnnotatedRecording:
    """Return the twin of a recording from its film: detections and annotation are drawn from the seed."""
    recording = model.recording
    # Annotated heads are fitted to the detected face.
    joints = filmed.shown(model.people, recording.truth, model.detector)
    truth = model.annotation.annotate(joints, recording.time, seed=seed)
    truth[~np.isfinite(recording.truth)] = np.nan
    detections = tuple(filmed.detected(model.detector, seed=seed))
    return replace(recording, name=f"{recording.name} twin", truth=truth, detections=detections)


VARIANTS = ("full", "fast", "no-3dps", "no-matching")
"""Presets that are compared."""

TOLERANCE = 2.0
"""Largest accepted difference between a variant's PCP in simulation and in reality, points."""


@dataclass(frozen=True)
class TwinComparison:
    """Scores of variants on a recording and on its simulated twin."""

    name: str
    """Name of the recording."""
    frames: int
    """Number of frames of the recording, and of each twin."""
    seeds: tuple[int, ...]
    """Seeds of the twins."""
    head: HeadMapping
    """Mapping to the head of SHELF14."""
    real: Mapping[str, PcpInterval]
    """PCP on the recording by variant."""
    simulated: Mapping[str, PcpInterval]
    """PCP on the twins by variant."""
    summaries: Mapping[str, Mapping[str, Any]]
    """Summaries of all scores, by "real" and "simulated", then by variant."""

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
