"""Scenes of the simulator for a rig: captured and detected once, estimated by every subset of the cameras.

People walk, stand and reach in the volume, on an open floor without walls: walls hide nothing from cameras inside the
room. Frames are half a second apart, so that a short scene holds many poses. A scene is one job of a process, and its
result depends on its seed alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mvpose import Pipeline, Rig
from mvpose.arrays import Bools, Floats, Integers
from mvpose.pipeline import Estimator
from mvpose.skeleton import coco17_to_shelf14
from simharness.detector.detect import Detected, detect
from simharness.planning.scene_frame import SceneFrame
from simharness.planning.visibility import Obstacle
from simharness.planning.volume import Volume
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.validation.frame_scores import RULES, HeadRule, score_frames
from simharness.runtime.frame_pool import map_jobs
from simharness.scenario.sections.cameras import Faults
from simharness.scenario.sections.detector import Detector
from simharness.scenario.sections.room import Clutter
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.matching import count_groups
from simharness.scoring.pcp import Part
from simharness.statistics.intervals import Interval, mean_interval
from simharness.trial.stages.capture import CaptureFrames
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.rigs.faults import schedule_exposures
from simharness.world.scene.build import Scene, build, compile_model
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.shapes import box_mesh
from simharness.world.scene.objects.solids import Solid
from simharness.world.scene.playback import simulate

ACTIVITIES = ("walk", "wave", "walk", "reach")
"""Activities of the people, in turn: half of them walk."""

_STANDING = ("wave", "reach", "point")  # in a volume too small to walk in
_LEAST_WALK = 0.7  # metres: half the side of the smallest square in which people walk
_ROOM_TO_WALK = 1.2  # square metres for each person: in a denser crowd people stand
_SPACINGS = (0.8, 0.6, 0.45)  # metres between pelvises: the first at which the people fit
_OBSTACLE = (0.6, 0.6, 0.62)  # colour; obstacles are never rendered
_TAKES = 4  # of a scene, with other places of the people and other draws: building a scene takes most of the time
_MARGIN = 2.0  # metres of floor beyond cameras and people


@dataclass(frozen=True)
class Condition:
    """What changes between two estimates of a scene.

    Attributes:
        cameras: indices of the cameras, increasing.
        fault: key of ``[faults]`` that is set: "rotation" (degrees), "translation" (m) or "clock_offset" (s); "": none.
        level: its value.
    """

    cameras: tuple[int, ...]
    fault: str = ""
    level: float = 0.0


@dataclass(frozen=True)
class Scores:
    """Scores of one scene under one condition, of people inside the volume; NaN where nothing was scored.

    Attributes:
        pcp: percent of correct parts.
        recall: percent of people found.
        mpjpe_mm: mean error of the people found, mm.
        mixed: percent of the matched groups of detections that hold two people.
    """

    pcp: float
    recall: float
    mpjpe_mm: float
    mixed: float


@dataclass(frozen=True)
class SceneResult:
    """Result of one scene.

    Attributes:
        seed: its seed.
        places: people on the floor of the world, (F, P, 2), metres.
        inside: who is inside the volume, (F, P).
        parts: share of correct parts of each person by the cameras of the maps, without a fault, (F, P); NaN where
            undefined.
        errors: mean joint error of each person found, (F, P), metres; NaN where missed.
        scores: scores by condition.
    """

    seed: int
    places: Floats
    inside: Bools
    parts: Floats
    errors: Floats
    scores: Mapping[Condition, Scores]


@dataclass(frozen=True)
class SceneSettings:
    """What all scenes have in common.

    Attributes:
        rig: cameras in the world, floor at z = 0.
        volume: where people are.
        people: number of people in the volume.
        detector: profile of the detector.
        clutter: objects that the simulator places around the people, who then use the square around the volume.
        obstacles: boxes at known places of the world.
        activities: activities of the people, in turn.
        frames: frames of a take; a scene has four takes, or one with clutter.
        rate: frames per second.
        variant: variant of the method.
        head: rule for the head joints of PCP.
        whole: indices of the cameras of the maps; all by default.
    """

    rig: Rig
    volume: Volume
    people: int
    detector: Detector
    clutter: Clutter = field(default_factory=Clutter)
    obstacles: tuple[Obstacle, ...] = ()
    activities: tuple[str, ...] = ACTIVITIES
    frames: int = 8
    rate: float = 2.0
    variant: str = "full"
    head: HeadRule = RULES[0]
    whole: tuple[int, ...] = ()


@dataclass(frozen=True)
class SceneBatch:
    """Scenes of the same settings.

    Attributes:
        settings: what the scenes have in common.
        conditions: subsets of cameras and faults; the same scene and the same draws for all.
        seeds: seeds of the scenes.
    """

    settings: SceneSettings
    conditions: tuple[Condition, ...]
    seeds: tuple[int, ...]


def simulate_scenes(
    batches: Sequence[SceneBatch],
    *,
    workers: int = 1,
    progress: Callable[[int], None] = lambda scenes: None,
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


def interval_of(results: Sequence[SceneResult], condition: Condition, score: str) -> Interval:
    """Return the mean of a score over the scenes with its 95 % interval.

    Args:
        results: one for each seed.
        condition: the condition.
        score: name of a field of :class:`Scores`.
    """
    values = [getattr(each.scores[condition], score) for each in results]
    # A mixed group is one of hundreds in a scene, not an event that lasts for all of it.
    return mean_interval(values, unit="%" if score in ("pcp", "recall") else "mm")


def loss_of(results: Sequence[SceneResult], condition: Condition, base: Condition, score: str = "pcp") -> Interval:
    """Return the mean loss of a score from ``base`` to ``condition``, paired by scene, with its 95 % interval."""
    pairs = ((each.scores[base], each.scores[condition]) for each in results)
    return mean_interval([getattr(one, score) - getattr(other, score) for one, other in pairs])


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
    frame = SceneFrame.around(settings.volume.outline)
    takes = _TAKES
    if _has_objects(settings.clutter):  # it stands where the people of the scene are not, so they cannot be moved
        takes, settings = 1, replace(settings, frames=_TAKES * settings.frames)
        frame = replace(frame, half=np.full(2, frame.half.max()))
    rig = frame.rig(settings.rig)
    whole = Condition(settings.whole or tuple(range(len(rig))))
    conditions = tuple(dict.fromkeys((whole, *conditions)))  # the maps are those of all cameras
    scenario = _scenario(settings, frame, seed)
    try:
        built = _build(scenario, rig)
    except ValueError as error:
        return str(error)
    parts = [
        _take(settings, frame, _in_volume(built, settings, frame, take), conditions, seed * _TAKES + take)
        for take in range(takes)
    ]
    places = np.concatenate([each.places for each in parts])
    inside = settings.volume.contains(places)
    scored = {each: _Scored.joined([part.scored[each] for part in parts]) for each in conditions}
    shown = scored[whole]
    return SceneResult(
        seed, places, inside, shown.correct, shown.error, {key: each.scores(inside) for key, each in scored.items()}
    )


class _Scored(NamedTuple):
    """Scores of F frames under one condition.

    Attributes:
        correct: share of correct parts of each person, (F, P); NaN where undefined.
        error: mean joint error of each person found, (F, P), metres.
        found: who is found, (F, P).
        groups: number of matched groups, (F,).
        mixed: number of them that hold two people, (F,).
    """

    correct: Floats
    error: Floats
    found: Bools
    groups: Integers
    mixed: Integers

    @classmethod
    def joined(cls, parts: Sequence[_Scored]) -> _Scored:
        """Return the scores of the frames of several parts."""
        return cls(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def scores(self, inside: Bools) -> Scores:
        """Return the scores of the people inside the volume, (F, P)."""
        groups = int(self.groups.sum())
        return Scores(
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
    rig = frame.rig(settings.rig)
    scenario = _scenario(settings, frame, 0)
    sequence = simulate(scene)
    truth = coco17_to_shelf14(sequence.joints, head=settings.head.mapping)
    pipeline, rule = Pipeline.preset(settings.variant), RULES.index(settings.head)
    scored: dict[Condition, _Scored] = {}
    for clock in dict.fromkeys(_clock_fault(each) for each in conditions):
        exposures = schedule_exposures(rig, clock, scene.time, seed=seed)
        views = CaptureFrames(scenario, scene, exposures, frozenset())(range(scenario.frames))
        detected = detect(sequence, views, rig, settings.detector, seed=seed)
        for condition in (each for each in conditions if _clock_fault(each) == clock):
            believed = schedule_exposures(rig, _calibration_fault(condition), scene.time, seed=seed).believed_rig
            estimates, groups, mixed = _estimates(pipeline, believed, detected, condition.cameras)
            scores = score_frames(truth, estimates)
            found = scores.found[rule]
            error = np.where(found, _mean(scores.errors[rule]), np.nan)
            scored[condition] = _Scored(_share_correct(scores.parts[rule]), error, found, groups, mixed)
    hips = sequence.joints[:, :, (11, 12), :2].mean(axis=2)
    return _Take(frame.to_world(hips), scored)


def _estimates(
    pipeline: Estimator, rig: Rig, detected: Sequence[Detected], cameras: tuple[int, ...]
) -> tuple[list[Floats], Integers, Integers]:
    """Return the joints of F frames by some cameras, F x (n, 17, 3), and the numbers of groups and mixed ones, (F,).

    One camera alone gives no joints in space.
    """
    joints = [np.zeros((0, 17, 3)) for _ in detected]
    groups, mixed = np.zeros(len(detected), np.int64), np.zeros(len(detected), np.int64)
    if len(cameras) < 2:
        return joints, groups, mixed
    recording = AnnotatedRecording(
        rig, np.zeros((len(detected), 0, 14, 3)), tuple(each.detections for each in detected), np.arange(len(detected))
    ).subset(cameras)
    for frame, detections in enumerate(recording.detections):
        estimate = pipeline.estimate(recording.rig, detections)
        joints[frame] = estimate.joints
        person = detected[frame].truth.person[np.isin(detected[frame].detections.view, cameras)]
        counts = count_groups(detections.view, estimate.matching.labels_of(len(detections)), person)
        groups[frame], mixed[frame] = len(estimate.joints), counts.merged
    return joints, groups, mixed


def _scenario(settings: SceneSettings, frame: SceneFrame, seed: int) -> Scenario:
    half = float(np.sqrt(frame.half.prod()))
    reach = 2 * max(half, float(np.abs(frame.rig(settings.rig).centers[:, :2]).max())) + 2 * _MARGIN
    roomy = half >= _LEAST_WALK and 4 * half**2 >= _ROOM_TO_WALK * settings.people
    activities = settings.activities if roomy else _STANDING
    content: dict[str, Any] = {
        "name": "rehearsal",
        "seed": seed,
        "duration": settings.frames / settings.rate,
        "rate": settings.rate,
        "room": {"size": (reach, reach, 3.0), "walls": False},
        "people": {
            "count": settings.people,
            "area": half,
            "activities": activities,
            "spacing": _SPACINGS[0],
        },
        "clutter": settings.clutter,
        "rendering": {"renderer": "rays"},
    }
    return Scenario.model_validate(content)


def _build(scenario: Scenario, rig: Rig) -> Scene:
    """Build a scene with the largest of the distances between people at which they fit.

    Raises:
        ValueError: people do not fit at any, or clutter does not.
    """
    for spacing in (each for each in _SPACINGS if _may_fit(scenario, each)):
        people = scenario.people.model_copy(update={"spacing": spacing})
        try:
            return build(scenario.model_copy(update={"people": people}), rig)
        except ValueError as error:
            if "do not fit" not in str(error):
                raise
    raise ValueError(
        f"{scenario.people.count} people do not fit into the volume, {_SPACINGS[-1]:g} m apart: use fewer people or a "
        "larger volume"
    )


def _may_fit(scenario: Scenario, spacing: float) -> bool:
    """Return whether discs of this diameter around all people have the room for it, in the densest packing."""
    side = 2 * scenario.people.area + spacing
    return scenario.people.count * spacing**2 * np.sqrt(3) / 2 <= side**2


def _in_volume(scene: Scene, settings: SceneSettings, frame: SceneFrame, take: int) -> Scene:
    """Return a scene whose people are spread over the rectangle of the volume, with the obstacles.

    The simulator keeps people in a square. It is turned by a right angle for each take, so that people who stand are at
    several places, and stretched to the rectangle of the same area.
    """
    turn = Rotation.from_euler("z", 90.0 * take, degrees=True)
    stretch = frame.half / np.sqrt(frame.half.prod())
    motions = tuple(replace(each, root=_moved(each.root, turn, stretch)) for each in scene.motions)
    scene = replace(scene, motions=motions)
    if not settings.obstacles:
        return scene
    obstacles = tuple(_solid(each, frame, number) for number, each in enumerate(settings.obstacles))
    solids = (*scene.solids, *obstacles)
    return replace(scene, solids=solids, model=compile_model([Kinematics(body) for body in scene.bodies], solids))


def _moved(root: Floats, turn: Rotation, stretch: Floats) -> Floats:
    """Return poses of pelvises (T, 7) turned about the vertical axis, their places then stretched along x and y."""
    places = root[:, :3] @ turn.as_matrix().T
    places[:, :2] *= stretch
    turned = (turn * Rotation.from_quat(root[:, [4, 5, 6, 3]])).as_quat()  # SciPy has w last
    return np.concatenate([places, turned[:, [3, 0, 1, 2]]], axis=1)


def _has_objects(clutter: Clutter) -> bool:
    """Return whether there are objects."""
    return any(clutter.model_dump().values())


def _solid(obstacle: Obstacle, frame: SceneFrame, number: int) -> Solid:
    """Return an obstacle of the world as a solid of the scene."""
    x, y = frame.to_scene(obstacle.center[:2]).tolist()
    half = (float(obstacle.size[0]) / 2, float(obstacle.size[1]) / 2, float(obstacle.size[2]) / 2)
    box = Box((x, y, float(obstacle.center[2])), half, obstacle.yaw - frame.bearing)
    return Solid("clutter", f"obstacle{number}", box_mesh([box], [_OBSTACLE]), (box,), box)


def _clock_fault(condition: Condition) -> Faults:
    """Return the faults that change what the cameras record."""
    return Faults(clock_offset=condition.level) if condition.fault == "clock_offset" else Faults()


def _calibration_fault(condition: Condition) -> Faults:
    """Return the faults that change the calibration that the method is given."""
    if condition.fault in ("rotation", "translation"):
        return Faults.model_validate({condition.fault: condition.level})
    return Faults()


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
