"""Tasks to be timed: public functions of mvpose as calls on a frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import mvpose
from benchmarks.method.scenes import Scene
from mvpose.estimate import Estimate, Matching
from mvpose.matching import Method, match
from mvpose.pipeline import Pipeline
from mvpose.rays import viewing_rays

STAGES = ("affinity", "matching", "reconstruction")


@dataclass(frozen=True)
class Case:
    """Scene with its precomputed affinity, (m, m), of the preset ``full``."""

    scene: Scene
    affinity: NDArray[np.float64]


def prepare(scenes: Iterable[Scene]) -> list[Case]:
    """Compute the affinities of scenes."""
    affinity = Pipeline().affinity
    return [
        Case(scene, affinity(scene.rig, scene.detections, viewing_rays(scene.rig, scene.detections)))
        for scene in scenes
    ]


@dataclass(frozen=True)
class Task:
    """Function to time.

    Attributes:
        call: timed function of a case.
        note: function that returns figures of the result to record with the time; not timed.
    """

    call: Callable[[Case], Any]
    note: Callable[[Case, Any], Mapping[str, float]] = lambda case, result: {}


def estimating(preset: str) -> Task:
    """Create the task of a whole preset; it records the milliseconds of its stages."""
    pipeline = mvpose.preset(preset)

    def note(case: Case, estimate: Estimate) -> Mapping[str, float]:
        return {stage: 1e3 * estimate.timings[stage] for stage in STAGES}

    return Task(lambda case: pipeline.estimate(case.scene.rig, case.scene.detections), note)


def matching(method: Method, note: Callable[[Case, Matching], Mapping[str, float]] = lambda case, result: {}) -> Task:
    """Create the task of matching only."""
    return Task(lambda case: match(case.affinity, case.scene.detections.view, method=method), note)


def decomposing() -> Task:
    """Create the task of one eigendecomposition of the size of the frame, the yardstick of matching by ADMM."""
    return Task(lambda case: np.linalg.eigh(case.affinity))
