"""Scenes of the simulator for a rig: captured and detected once, estimated by every subset of the cameras.

People walk, stand and reach in the volume, on an open floor without walls: walls hide nothing from cameras inside the
room. Frames are half a second apart, so that a short scene holds many poses. A scene is one job of a process, and its
result depends on its seed alone.

Their results are scores by condition, means over scenes, and paired losses.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mvpose import preset
from mvpose.arrays import Bools, Floats, Integers
from mvpose.estimators import Estimator
from mvpose.skeleton import coco17_to_shelf14
from simharness.planning.rehearsal_scene import (
    SceneFrame,
    SceneSettings,
    build_scene,
    has_objects,
    scenario_of,
    spread_over_volume,
)
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.runtime.frame_pool import map_jobs
from simharness.scenario.sections.cameras_section import FaultsSection
from simharness.scoring.frame_scores import score_frames
from simharness.scoring.matching import count_groups
from simharness.scoring.pcp import Part
from simharness.statistics.intervals import Interval, mean_interval
from simharness.trial.conditioned_trial import ConditionedTrial, estimate_frames
from simharness.trial.stages.build_trial import Trial, exposures_of
from simharness.trial.stages.detected_sequence import DetectedSequence
from simharness.world.scene.build import Scene


@dataclass(frozen=True)
class Condition:
    """What changes between two estimates of a scene."""

    cameras: tuple[int, ...]
    """Indices of the cameras, increasing."""
    fault: str = ""
    """Key of ``[faults]`` that is set: "rotation" (degrees), "translation" (m) or "clock_offset" (s); "": none."""
    level: float = 0.0
    """Its value."""


@dataclass(frozen=True)
class SceneScores:
    """Scores of one scene under one condition, of people inside the volume; NaN where nothing was scored."""

    pcp: float
    """Percent of correct parts."""
    recall: float
    """Percent of people found."""
    mpjpe_mm: float
    """Mean error of the people found, mm."""
    mixed: float
    """Percent of the matched groups of detections that hold two people."""


@dataclass(frozen=True)
class SceneResult:
    """Result of one scene."""

    seed: int
    """Its seed."""
    places: Floats
    """People on the floor of the world, (F, P, 2), metres."""
    inside: Bools
    """Who is inside the volume, (F, P)."""
    parts: Floats
    """Share of correct parts of each person by the cameras of the maps, without a fault, (F, P); NaN where
    undefined."""
    errors: Floats
    """Mean joint error of each person found, (F, P), metres; NaN where missed."""
    scores: Mapping[Condition, SceneScores]
    """Scores by condition."""


def interval_of(results: Sequence[SceneResult], condition: Condition, score: str) -> Interval:
    """Return the mean of a score over the scenes with its 95 % interval.

    Args:
        results: one for each seed.
        condition: the condition.
        score: name of a field of :class:`SceneScores`.
    """
    values = [getattr(each.scores[condition], score) for each in results]
    # A mixed group is one of hundreds in a scene, not an event that lasts for all of it.
    return mean_interval(values, unit="%" if score in ("pcp", "recall") else "mm")


def loss_of(results: Sequence[SceneResult], condition: Condition, base: Condition, score: str = "pcp") -> Interval:
    """Return the mean loss of a score from ``base`` to ``condition``, paired by scene, with its 95 % interval."""
    pairs = ((each.scores[base], each.scores[condition]) for each in results)
    return mean_interval([getattr(one, score) - getattr(other, score) for one, other in pairs])


_TAKES = 4  # of a scene, with other places of the people and other draws: building a scene takes most of the time


@dataclass(frozen=True)
class SceneBatch:
    """Scenes of the same settings."""

    settings: SceneSettings
    """What the scenes have in common."""
    conditions: tuple[Condition, ...]
    """Subsets of cameras and faults; the same scene and the same draws for all."""
    seeds: tuple[int, ...]
    """Seeds of the scenes."""


def simulate_scenes(
    batches: Sequence[SceneBatch], *, workers: int = 1, progress: Callable[[int], None] = lambda scenes: None
) -> list[list[SceneResult]]:
    """Simulate the scenes of batches, and score the method under every condition.

    Args:
        batches: the scenes; long ones should come first.
        workers: number of processes, which share all scenes; the results do not depend on it.
        progress: called with the number of finished scenes.

    Returns:
        Results of each batch in the order of its seeds. Scenes that cannot be built are left out, and a batch without
        the half of its scenes is empty.

    Raises:
        ValueError: the first batch is empty, because people or clutter do not fit.
        RunError: any other error.
    """
    jobs = [(batch, seed) for batch in batches for seed in batch.seeds]
    ranges = [(range(k, k + 1),) for k in range(len(jobs))]
    done = map_jobs(_Scenes(tuple(jobs)), ranges, workers=workers, progress=progress)
    results, start = [], 0
    for number, batch in enumerate(batches):
        made = done[start : start + len(batch.seeds)]
        start += len(batch.seeds)
        failed = [each for each in made if isinstance(each, str)]
        if 2 * len(failed) >= len(made) and number == 0:
            raise ValueError(failed[0])
        kept = [each for each in made if not isinstance(each, str)]
        results.append(kept if 2 * len(failed) < len(made) else [])
    return results


@dataclass(frozen=True)
class _Scenes:
    """Scenes by index; a function of :func:`simharness.runtime.frame_pool.map_jobs`."""

    jobs: tuple[tuple[SceneBatch, int], ...]

    def __call__(self, frames: range, /) -> SceneResult | str:
        """Return the result of the scene, or the reason why it cannot be built."""
        batch, seed = self.jobs[frames.start]
        return _run(batch.settings, batch.conditions, seed)


def _run(settings: SceneSettings, conditions: Sequence[Condition], seed: int) -> SceneResult | str:
    """Simulate one scene and score it under all conditions; return the reason where it cannot be built."""
    frame = SceneFrame.around(settings.setup.volume.outline)
    takes = _TAKES
    if has_objects(settings.setup.clutter):  # it stands where the people of the scene are not, so they cannot be moved
        takes, settings = 1, replace(settings, frames=_TAKES * settings.frames)
        frame = replace(frame, half=np.full(2, frame.half.max()))
    rig = frame.rig(settings.rig)
    whole = Condition(settings.whole or tuple(range(len(rig))))
    conditions = tuple(dict.fromkeys((whole, *conditions)))  # the maps are those of all cameras
    scenario = scenario_of(settings, frame, seed)
    try:
        built = build_scene(scenario, rig)
    except ValueError as error:
        return str(error)
    parts = [
        _take(settings, frame, spread_over_volume(built, settings, frame, take), conditions, seed * _TAKES + take)
        for take in range(takes)
    ]
    places = np.concatenate([each.places for each in parts])
    inside = settings.setup.volume.contains(places)
    scored = {each: _Scored.joined([part.scored[each] for part in parts]) for each in conditions}
    shown = scored[whole]
    return SceneResult(
        seed, places, inside, shown.correct, shown.error, {key: each.scores(inside) for key, each in scored.items()}
    )


class _Scored(NamedTuple):
    """Scores of F frames under one condition."""

    correct: Floats
    """Share of correct parts of each person, (F, P); NaN where undefined."""
    error: Floats
    """Mean joint error of each person found, (F, P), metres."""
    found: Bools
    """Who is found, (F, P)."""
    groups: Integers
    """Number of matched groups, (F,)."""
    mixed: Integers
    """Number of them that hold two people, (F,)."""

    @classmethod
    def joined(cls, parts: "Sequence[_Scored]") -> "_Scored":
        """Return the scores of the frames of several parts."""
        return cls(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def scores(self, inside: Bools) -> SceneScores:
        """Return the scores of the people inside the volume, (F, P)."""
        groups = int(self.groups.sum())
        return SceneScores(
            pcp=100.0 * _average(self.correct[inside]),
            recall=100.0 * _average(self.found[inside].astype(float)),
            mpjpe_mm=1000.0 * _average(self.error[inside]),
            mixed=100.0 * int(self.mixed.sum()) / groups if groups else float("nan"),
        )


@dataclass(frozen=True)
class _Take:
    """One take of a scene: where people are, (F, P, 2), metres, and the scores by condition."""

    places: Floats
    scored: Mapping[Condition, _Scored]


def _take(
    settings: SceneSettings, frame: SceneFrame, scene: Scene, conditions: Sequence[Condition], seed: int
) -> _Take:
    """Capture and detect one take, and estimate it under all conditions."""
    scenario = scenario_of(settings, frame, seed).model_copy(update={"detector": settings.setup.detector})
    exposures = exposures_of(scenario, frame.rig(settings.rig), scene.time)
    draws = ConditionedTrial(Trial(scenario, scene, exposures, {}, None))
    truth = coco17_to_shelf14(draws.sequence.joints, head=settings.head.mapping)
    pipeline, rule = preset(settings.variant), settings.head
    scored: dict[Condition, _Scored] = {}
    for condition in sorted(conditions, key=lambda each: (each.fault == "clock_offset", each.level)):
        faults = FaultsSection.model_validate({condition.fault: condition.level} if condition.fault else {})
        detected = draws.detected(scenario.model_copy(update={"faults": faults}))
        estimates, groups, mixed = _estimates(pipeline, detected, condition.cameras)
        scores = score_frames(truth, estimates, head=rule.mapping, filled=rule.filled)
        scored[condition] = _Scored(_share_correct(scores.parts), scores.error, scores.found, groups, mixed)
    hips = draws.sequence.joints[:, :, (11, 12), :2].mean(axis=2)
    return _Take(frame.to_world(hips), scored)


def _estimates(
    pipeline: Estimator, detected: DetectedSequence, cameras: tuple[int, ...]
) -> tuple[list[Floats], Integers, Integers]:
    """Return the joints of F frames by some cameras, F x (n, 17, 3), and the numbers of groups and mixed ones, (F,).

    One camera alone gives no joints in space.
    """
    size = len(detected.frames)
    groups, mixed = np.zeros(size, np.int64), np.zeros(size, np.int64)
    if len(cameras) < 2:
        return [np.zeros((0, 17, 3)) for _ in detected.frames], groups, mixed
    given = tuple(each.detections for each in detected.frames)
    recording = AnnotatedRecording(detected.rig, np.zeros((size, 0, 14, 3)), given, np.arange(size)).subset(cameras)
    estimates = estimate_frames(pipeline, recording.rig, recording.detections)
    for frame, (detections, estimate) in enumerate(zip(recording.detections, estimates, strict=True)):
        person = detected.frames[frame].truth.person[np.isin(given[frame].view, cameras)]
        counts = count_groups(detections.view, estimate.matching.labels_of(len(detections)), person)
        groups[frame], mixed[frame] = len(estimate.joints), counts.merged
    return [each.joints for each in estimates], groups, mixed


def _share_correct(parts: NDArray[np.int8]) -> Floats:
    """Return the share of correct parts of each person, (F, P), of states (F, P, 10); NaN without a defined one."""
    defined = (parts != Part.UNDEFINED).sum(axis=-1)
    return np.where(defined > 0, (parts == Part.CORRECT).sum(axis=-1) / np.maximum(defined, 1), np.nan)


def _mean(values: Floats) -> Floats:
    """Return the mean over the last axis without NaN; NaN where there is nothing else."""
    known = np.isfinite(values)
    return np.where(
        known.any(axis=-1), np.where(known, values, 0.0).sum(axis=-1) / np.maximum(known.sum(axis=-1), 1), np.nan
    )


def _average(values: Floats) -> float:
    return float(_mean(values.ravel()[None])[0])
