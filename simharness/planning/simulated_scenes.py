"""Scenes of the simulator for a rig: captured and detected once, estimated by every subset of the cameras.

People walk, stand and reach in the volume, on an open floor without walls: walls hide nothing from cameras inside the
room. Frames are half a second apart, so that a short scene holds many poses. A scene is one job of a process, and its
result depends on its seed alone.

Their results are scores by condition, means over scenes, and paired losses.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

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
from simharness.scoring.frame_scores import FrameScores, score_frames
from simharness.scoring.matching import count_groups
from simharness.scoring.pcp import Part
from simharness.scoring.score_registry import finite_mean
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

    @classmethod
    def inside(cls, scores: FrameScores, inside: Bools, groups: Integers) -> Self:
        """Return the scores of the people inside the volume, (F, P), given the numbers of groups and mixed ones, (2,).

        Without groups no share of them is mixed.
        """
        count, mixed = groups.tolist()
        return cls(
            pcp=100.0 * nan_mean(_share_correct(scores.parts)[inside]),
            recall=100.0 * nan_mean(scores.found[inside].astype(float)),
            mpjpe_mm=1000.0 * nan_mean(scores.error[inside]),
            mixed=100.0 * mixed / count if count else float("nan"),
        )


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
        """Return the result of the scene under all conditions, or the reason why it cannot be built."""
        batch, seed = self.jobs[frames.start]
        settings, takes = batch.settings, _TAKES
        frame = SceneFrame.around(settings.setup.volume.outline)
        if has_objects(settings.setup.clutter):  # it stands where no people of the scene are, so they cannot be moved
            takes, settings = 1, replace(settings, frames=_TAKES * settings.frames)
            frame = replace(frame, half=np.full(2, frame.half.max()))
        rig = frame.rig(settings.rig)
        whole = Condition(settings.whole or tuple(range(len(rig))))
        conditions = tuple(dict.fromkeys((whole, *batch.conditions)))  # the maps are those of all cameras
        try:
            built = build_scene(scenario_of(settings, frame, seed), rig)
        except ValueError as error:
            return str(error)
        parts = [
            _take(settings, frame, spread_over_volume(built, settings, frame, take), conditions, seed * _TAKES + take)
            for take in range(takes)
        ]
        places = np.concatenate([each.places for each in parts])
        inside = settings.setup.volume.contains(places)
        scored = {each: FrameScores.joined(part.scores[each] for part in parts) for each in conditions}
        groups = {each: np.sum([part.groups[each] for part in parts], axis=0) for each in conditions}
        scores = {each: SceneScores.inside(scored[each], inside, groups[each]) for each in conditions}
        return SceneResult(seed, places, inside, _share_correct(scored[whole].parts), scored[whole].error, scores)


class _Take(NamedTuple):
    """One take of a scene: where people are, (F, P, 2), metres, and scores and numbers of groups by condition."""

    places: Floats
    scores: Mapping[Condition, FrameScores]
    groups: Mapping[Condition, Integers]


def _take(
    settings: SceneSettings, frame: SceneFrame, scene: Scene, conditions: Sequence[Condition], seed: int
) -> _Take:
    """Capture and detect one take, and estimate it under all conditions."""
    scenario = scenario_of(settings, frame, seed).model_copy(update={"detector": settings.setup.detector})
    exposures = exposures_of(scenario, frame.rig(settings.rig), scene.time)
    draws = ConditionedTrial(Trial(scenario, scene, exposures, {}, None))
    truth = coco17_to_shelf14(draws.sequence.joints, head=settings.head.mapping)
    pipeline, rule = preset(settings.variant), settings.head
    scored, groups = {}, {}
    for condition in sorted(conditions, key=lambda each: (each.fault == "clock_offset", each.level)):
        faults = FaultsSection.model_validate({condition.fault: condition.level} if condition.fault else {})
        detected = draws.detected(scenario.model_copy(update={"faults": faults}))
        estimates, groups[condition] = _estimates(pipeline, detected, condition.cameras)
        scored[condition] = score_frames(truth, estimates, head=rule.mapping, filled=rule.filled)
    hips = draws.sequence.joints[:, :, (11, 12), :2].mean(axis=2)
    return _Take(frame.to_world(hips), scored, groups)


def _estimates(
    pipeline: Estimator, detected: DetectedSequence, cameras: tuple[int, ...]
) -> tuple[list[Floats], Integers]:
    """Return the joints of F frames by some cameras, F x (n, 17, 3), and the numbers of groups and mixed ones, (2,).

    One camera alone gives no joints in space.
    """
    size, groups = len(detected.frames), np.zeros(2, np.int64)
    if len(cameras) < 2:
        return [np.zeros((0, 17, 3)) for _ in detected.frames], groups
    given = tuple(each.detections for each in detected.frames)
    recording = AnnotatedRecording(detected.rig, np.zeros((size, 0, 14, 3)), given, np.arange(size)).subset(cameras)
    estimates = estimate_frames(pipeline, recording.rig, recording.detections)
    for frame, (detections, estimate) in enumerate(zip(recording.detections, estimates, strict=True)):
        person = detected.frames[frame].truth.person[np.isin(given[frame].view, cameras)]
        counts = count_groups(detections.view, estimate.matching.labels_of(len(detections)), person)
        groups += len(estimate.joints), counts.merged
    return [each.joints for each in estimates], groups


def _share_correct(parts: NDArray[np.int8]) -> Floats:
    """Return the share of correct parts of each person, (F, P), of states (F, P, 10); NaN without a defined one."""
    defined = (parts != Part.UNDEFINED).sum(axis=-1)
    return np.where(defined > 0, (parts == Part.CORRECT).sum(axis=-1) / np.maximum(defined, 1), np.nan)


def nan_mean(values: Floats) -> float:
    """Return the mean of the finite values; NaN without any."""
    mean = finite_mean(values)
    return float("nan") if mean is None else mean
