"""What is timed: the public faces of mvpose as calls on a frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.method.scenes import Scene
from mvpose.estimate import Estimate, Matching
from mvpose.matching import Method, match
from mvpose.pipeline import Pipeline
from mvpose.rays import viewing_rays

STAGES = ("affinity", "matching", "reconstruction")


@dataclass(frozen=True)
class Case:
    """A scene, and the affinity (m, m) that ``full`` matches it by, made beforehand."""

    scene: Scene
    affinity: NDArray[np.float64]


def prepare(scenes: Iterable[Scene]) -> list[Case]:
    """Make the affinities."""
    affinity = Pipeline().affinity
    return [
        Case(scene, affinity(scene.rig, scene.detections, viewing_rays(scene.rig, scene.detections)))
        for scene in scenes
    ]


@dataclass(frozen=True)
class Task:
    """Something to time.

    Attributes:
        call: it, on a case.
        note: figures of its result to keep beside the time; not timed itself.
    """

    call: Callable[[Case], Any]
    note: Callable[[Case, Any], Mapping[str, float]] = lambda case, result: {}


def estimating(preset: str) -> Task:
    """The whole of a preset; notes the milliseconds of its stages."""
    pipeline = Pipeline.preset(preset)

    def note(case: Case, estimate: Estimate) -> Mapping[str, float]:
        return {stage: 1e3 * estimate.timings[stage] for stage in STAGES}

    return Task(lambda case: pipeline.estimate(case.scene.rig, case.scene.detections), note)


def matching(method: Method, note: Callable[[Case, Matching], Mapping[str, float]] = lambda case, result: {}) -> Task:
    """Matching alone."""
    return Task(lambda case: match(case.affinity, case.scene.detections.view, method=method), note)


def decomposing() -> Task:
    """One eigen-decomposition of the size of the frame, which the matching by ADMM is measured by."""
    return Task(lambda case: np.linalg.eigh(case.affinity))
