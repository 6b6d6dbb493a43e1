"""One trial of a hunt: what fails in its frames, under which circumstances, and whether it does with fresh noise."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import threadpoolctl

from mvpose.arrays import Floats
from mvpose.commands.progress import Silence, Stages
from simharness.detector.viewing_conditions import hidden_shares, overlaps
from simharness.hunt.properties import Violation, plain_views
from simharness.hunt.shrinking import Judge, stage_of
from simharness.scenario.sections.scenario import Scenario
from simharness.study.stored_trial import StoredTrial, TrialOutput
from simharness.trial.run_trial import run_trial
from simharness.trial.stages.simulation import detect_trial
from simharness.types.recording import Recording
from simharness.types.truth import Truth

NOISES = 5
"""Number of fresh draws of the detector's errors with which a failure is tried again, on the same people and motion."""

BINS: Mapping[str, tuple[float, ...]] = {
    "views": (2.5, 3.5, 4.5),
    "distance": (0.6, 1.2),
    "overlap": (0.1, 0.4),
    "hidden": (0.1, 0.4),
}
"""Borders of the bins in which two failures count as near twins, by circumstance."""

CIRCUMSTANCES: Mapping[str, tuple[float, ...]] = {**BINS, "people": (1.5, 3.5, 6.5), "cameras": (3.5, 5.5)}
"""Borders of the bins of a person in a frame: those of failures, the people who are there, and the cameras."""


@dataclass(frozen=True)
class HuntFinding:
    """Property that is violated in a trial, for one person: the first frame of it."""

    violated: str
    """Name of the property."""
    person: int
    """Index of the person; -1 for nobody in particular."""
    frame: int
    """The frame."""
    failed: int
    """With how many of :data:`NOISES` fresh draws of noise the trial fails again for the person."""
    stage: str
    """Stage of the method to blame; "" where the property is no class of failures."""
    views: float
    """Cameras in whose pictures the person is in plain view; the mean over all people for nobody in particular."""
    distance: float
    """Distance of the hips from those of the nearest other person, metres; 100 without another one."""
    overlap: float
    """Intersection over union of the person's box with another one, the largest of all views."""
    hidden: float
    """Share of the joints that others or objects hide or the borders cut off, the mean over views."""

    @property
    def robust(self) -> bool:
        """Whether it fails again with most fresh draws of noise."""
        return 2 * self.failed > NOISES

    @property
    def cell(self) -> tuple[str, str, int, int, int, int]:
        """Property, stage and bin of each circumstance: failures of one cell are near twins."""
        views, distance, overlap, hidden = (
            int(np.digitize(getattr(self, key), borders)) for key, borders in BINS.items()
        )
        return self.violated, self.stage, views, distance, overlap, hidden


@dataclass(frozen=True)
class HuntOutput(TrialOutput):
    """What was found in a trial."""

    results: Mapping[str, Any] = field(default_factory=dict)
    findings: tuple[HuntFinding, ...] = ()
    """Violations by property and person."""
    sightings: tuple[tuple[int, ...], ...] = ()
    """Bins of :data:`CIRCUMSTANCES` of all people in all frames."""


def hunt_in_trial(
    scenario: Scenario, variants: Sequence[str], stored: StoredTrial | None = None, *, properties: Sequence[str]
) -> HuntOutput:
    """Return what is violated in the frames of a trial.

    Args:
        scenario: a resolved scenario at its seed.
        variants: the variant, and a rival if there is one.
        stored: not used.
        properties: names of the properties.

    Raises:
        ValueError: the scenario cannot be built.
    """
    result = run_trial(scenario, variants=variants, until="detect")
    judge = Judge(*(result.pipelines[name] for name in variants))
    first: dict[tuple[str, int], tuple[int, Violation]] = {}
    simulated, silent = result.simulation, Stages(Silence())
    assert simulated is not None
    with threadpoolctl.threadpool_limits(1):
        for frame, each in _violations(result.recording, judge, properties):
            first.setdefault((each.property, each.person), (frame, each))
        again = Counter[tuple[str, int]]()
        for noise in range(1, NOISES + 1) if first else ():
            fresh = scenario.model_copy(update={"seed": scenario.seed + 1_000_003 * noise})
            recording = detect_trial(replace(simulated, trial=replace(result.trial, scenario=fresh)), silent).recording
            found = _violations(recording, judge, list(dict.fromkeys(name for name, _ in first)))
            again.update({(each.property, each.person) for _, each in found})
        findings = []
        for (name, person), (frame, violation) in first.items():
            only, whole = slice(frame, frame + 1), result.recording
            alone = Recording(whole.time[only], whole.rig, whole.detections[only], whole.truth[only])
            stage = stage_of(alone, violation, judge.variant)
            about = circumstances(whole.truth[frame], person)
            findings.append(HuntFinding(name, person, frame, again[name, person], stage, **about))
    seen = tuple(each for truth in result.recording.truth for each in sightings(truth))
    return HuntOutput(findings=tuple(findings), sightings=seen)


def _violations(recording: Recording, judge: Judge, properties: Sequence[str]) -> Iterator[tuple[int, Violation]]:
    """Yield what is violated in the frames of a recording."""
    for frame, given in enumerate(zip(recording.detections, recording.truth, strict=True)):
        yield from ((frame, each) for each in judge.violations_of(recording.rig, *given, properties))


def circumstances(truth: Truth, person: int) -> dict[str, float]:
    """Return the circumstances of a person in a frame, those of :class:`HuntFinding`.

    Args:
        truth: the frame.
        person: index of the person; -1: means over all people present, the least distance and the largest overlap.
    """
    present = np.flatnonzero(truth.present)
    which = present if person < 0 else np.array([person])
    if not len(present):
        return {"views": 0.0, "distance": 100.0, "overlap": 0.0, "hidden": 0.0}
    hips: Floats = truth.joints[:, 11:13].mean(axis=1)
    apart = np.linalg.norm(hips[which, None] - hips[None, present], axis=-1)
    apart[which[:, None] == present] = 100.0
    found = {
        "views": plain_views(truth)[which].mean(),
        "distance": apart.min(),
        "overlap": overlaps(truth.boxes)[:, which].max(initial=0.0),
        "hidden": hidden_shares(truth.visibility)[:, which].mean(),
    }
    return {key: round(float(value), 3) for key, value in found.items()}


def sightings(truth: Truth) -> list[tuple[int, ...]]:
    """Return the bins of :data:`CIRCUMSTANCES` of each person who is present in a frame."""
    present, cameras = np.flatnonzero(truth.present).tolist(), len(truth.visibility)
    found = []
    for person in present:
        about = {**circumstances(truth, person), "people": len(present), "cameras": cameras}
        found.append(tuple(int(np.digitize(about[key], borders)) for key, borders in CIRCUMSTANCES.items()))
    return found
