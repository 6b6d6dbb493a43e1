"""Results of simulated scenes: scores by condition, means over scenes, paired losses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mvpose.arrays import Bools, Floats
from simharness.statistics.intervals import Interval, mean_interval


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
class SceneScores:
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
    scores: Mapping[Condition, SceneScores]


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
