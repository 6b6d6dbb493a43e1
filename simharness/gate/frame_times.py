"""Time of the method relative to a reference kernel, frame by frame.

Every frame is estimated a few times, and the reference kernel (:mod:`simharness.gate.reference_kernel`) runs right
before each estimate, so that both meet the same state of the machine. Of the repetitions of a frame the quickest
counts. Times are processor times of this process, in which waiting for a busy machine does not count: at a load of ten
processes on two cores, the wall-clock time of the kernel varied by a factor of 38 (0.8 to 30 ms in 98 % of the calls),
its processor time by a factor of 1.2. What other processes or a graphics card do for an estimator is not measured.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from simharness.gate.reference_kernel import reference_work
from simharness.trial.stages.estimation import EstimateFrames

if TYPE_CHECKING:
    from mvpose.pipeline import Estimator
    from simharness.trial.stages.detected_sequence import DetectedSequence

REPETITIONS = 3
"""Estimates of a frame of which the quickest counts."""

FRAMES = 5
"""Largest number of frames that are timed, spread evenly over the sequence."""


def relative_times(
    detected: DetectedSequence,
    pipelines: Mapping[str, Estimator],
    *,
    repetitions: int = REPETITIONS,
    frames: int = FRAMES,
) -> dict[str, float]:
    """Return the time of each variant for a frame, divided by the time of the reference kernel.

    Numerator and denominator are sums over the timed frames, so that every timed frame counts.

    Args:
        detected: the detections of all frames.
        pipelines: variants by name.
        repetitions: estimates of a frame of which the quickest counts.
        frames: largest number of frames that are timed.
    """
    inputs = EstimateFrames(detected.rig, detected.frames, pipelines)
    timed = np.unique(np.linspace(0, len(detected.frames) - 1, frames).round().astype(int))
    work = reference_work()
    method = {name: np.full((len(timed), repetitions), np.inf) for name in pipelines}
    reference = np.full((len(timed), repetitions * len(pipelines)), np.inf)
    for row, frame in enumerate(timed):
        for place, (name, pipeline) in enumerate(pipelines.items()):
            detections = inputs.input_of(int(frame), name)
            for repetition in range(repetitions):
                reference[row, place * repetitions + repetition] = _seconds(work)
                method[name][row, repetition] = _seconds(lambda: pipeline.estimate(detected.rig, detections))  # noqa: B023
    total = reference.min(axis=1).sum()
    return {name: float(times.min(axis=1).sum() / total) for name, times in method.items()}


def _seconds(work: Callable[[], object]) -> float:
    start = time.process_time_ns()
    work()
    return 1e-9 * (time.process_time_ns() - start)
