"""Time of the method relative to a reference kernel, frame by frame.

Every frame is estimated a few times, and the reference kernel (:func:`reference_work`) runs right before each estimate,
so that both meet the same state of the machine. Of the repetitions of a frame the quickest counts. Times are processor
times of this process, in which waiting for a busy machine does not count: at a load of ten processes on two cores, the
wall-clock time of the kernel varied by a factor of 38 (0.8 to 30 ms in 98 % of the calls), its processor time by a
factor of 1.2. What other processes or a graphics card do for an estimator is not measured.

The kernel is a fixed amount of the same kinds of work as the method: compiled loops (products of small matrices,
likelihoods of points in views, small linear systems), and objects, texts and dictionaries of the interpreter, a third
and two thirds of its time. What other processes do to caches slows them differently. Where four to ten processes shared
two cores, the time of unchanged code varied within a factor of up to 1.47 in units of compiled loops alone, 1.28 to
1.52 in units that hold calls of NumPy on small arrays, and 1.20 to 1.33 in these.

A variant with memory gets frames in order, because its time depends on the people whom it follows. If they take
seconds, as the repair of a rig does, they are estimated once.
"""

import json
import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from typing import Any

import numpy as np

from mvpose import Detections, Rig
from mvpose.arrays import Floats
from mvpose.estimators import Estimator, SequenceEstimator
from mvpose.kernels import njit
from simharness.trial.stages.detected_sequence import DetectedSequence
from simharness.trial.stages.estimation import EstimateFrames

REPETITIONS = 3
"""Estimates of a frame of which the quickest counts."""

FRAMES = 5
"""Largest number of frames that are timed, spread evenly over the sequence."""

TRACKED_FRAMES = 20
"""Largest number of frames that are timed of a variant with memory: the first ones."""

LONG = 2.0
"""Time of a sequence of frames that is not repeated, seconds: in so long a time the machine's states average out."""

_SIZE, _PRODUCTS = 40, 10  # size of the matrices, and number of products, as in a matching
_POINTS, _VIEWS = 2000, 5  # candidate positions of a joint, and views
_CALLS = 4  # of objects


def relative_times(
    detected: DetectedSequence,
    pipelines: Mapping[str, Estimator],
    *,
    repetitions: int = REPETITIONS,
    frames: int = FRAMES,
) -> dict[str, float]:
    """Return the time of each variant for a frame, divided by the time of the reference kernel.

    Numerator and denominator are sums over the timed frames, so that every timed frame counts. Of a variant with
    memory, the same number of frames at the start of the sequence are timed together.

    Args:
        detected: the detections of all frames.
        pipelines: variants by name.
        repetitions: estimates of a frame of which the quickest counts.
        frames: largest number of frames that are timed.
    """
    inputs = EstimateFrames(detected.rig, detected.frames, pipelines)
    timed = np.unique(np.linspace(0, len(detected.frames) - 1, frames).round().astype(int))
    first = range(min(len(detected.frames), TRACKED_FRAMES))
    times = {}
    for name, pipeline in pipelines.items():
        if isinstance(pipeline, SequenceEstimator):
            given = [inputs.input_of(frame, name) for frame in first]
            method, reference = _times_in_order(pipeline, detected.rig, given, repetitions)
        else:
            given = [inputs.input_of(int(frame), name) for frame in timed]
            method, reference = _times_of_frames(pipeline, detected.rig, given, repetitions)
        times[name] = float(method / reference)
    return times


def _times_of_frames(
    pipeline: Estimator, rig: Rig, frames: Sequence[Detections], repetitions: int
) -> tuple[float, float]:
    """Return the time of single frames, and that of the reference kernel as many times, seconds."""
    work = reference_work()
    method, reference = np.empty((2, len(frames), repetitions))
    for row, detections in enumerate(frames):
        for repetition in range(repetitions):
            reference[row, repetition] = _seconds(work)
            method[row, repetition] = _seconds(lambda: pipeline.estimate(rig, detections))  # noqa: B023
    return float(method.min(axis=1).sum()), float(reference.min(axis=1).sum())


def _times_in_order(
    pipeline: SequenceEstimator, rig: Rig, frames: Sequence[Detections], repetitions: int
) -> tuple[float, float]:
    """Return the time of a sequence of frames, and that of the reference kernel once for each, seconds."""
    work = reference_work()
    method, reference = np.full(repetitions, np.inf), np.full((len(frames), repetitions), np.inf)
    for repetition in range(repetitions):
        feed = _beside_reference(frames, work, reference[:, repetition])
        total = _seconds(lambda: list(pipeline.track(rig, feed)))  # noqa: B023
        method[repetition] = total - reference[:, repetition].sum()
        if method[repetition] > LONG:
            break
    return float(method.min()), float(reference.min(axis=1).sum())


def _beside_reference(
    frames: Sequence[Detections], work: Callable[[], object], seconds: Floats
) -> Iterator[Detections]:
    """Yield frames, and write the time of the reference kernel before each, (T,)."""
    for index, detections in enumerate(frames):
        seconds[index] = _seconds(work)
        yield detections


def _seconds(work: Callable[[], object]) -> float:
    start = time.process_time_ns()
    work()
    return 1e-9 * (time.process_time_ns() - start)


def reference_work() -> Callable[[], float]:
    """Return a function that does the work of one call of the kernel, compiled and run once."""
    rng = np.random.default_rng(0)
    matrix = rng.random((_SIZE, _SIZE)) / _SIZE
    points, rays = rng.random((_POINTS, 3)), rng.random((_VIEWS, 6))
    _work(matrix, points, rays)
    people = {f"person {k}": {"place": [k, 2.5 * k, str(k)], "seen": {"by": None}} for k in range(12)}
    return lambda: float(_work(matrix, points, rays)) + sum(_objects(people) for _ in range(_CALLS))


def _objects(people: dict[str, Any]) -> int:
    """Do work that is not compiled, in many parts of the interpreter: write, parse, copy, search, sort and format."""
    text = json.dumps(people)
    copied = deepcopy(json.loads(text))
    ordered = sorted(copied, key=lambda name: (len(name), name))
    texts = [f"{copied[name]['place'][1]:.2f}" for name in ordered]
    return len(re.findall(r'"place": \[(\d+)', text)) + len(texts)


@njit(cache=True)
def _work(matrix: Floats, points: Floats, rays: Floats) -> float:
    """Do the work of one call; return a number that depends on all of it, so that no part is optimised away."""
    size = len(matrix)
    power, product = matrix.copy(), np.empty_like(matrix)
    for _ in range(_PRODUCTS):
        for i in range(size):
            for j in range(size):
                total = 0.0
                for k in range(size):
                    total += power[i, k] * matrix[k, j]
                product[i, j] = min(max(total, 0.0), 1.0)
        power, product = product, power
    best = -np.inf
    normal, side = np.zeros((3, 3)), np.zeros(3)
    for point in points:
        score = 0.0
        for ray in rays:
            x = ray[1] * (point[2] - ray[5]) - ray[2] * (point[1] - ray[4])
            y = ray[2] * (point[0] - ray[3]) - ray[0] * (point[2] - ray[5])
            z = ray[0] * (point[1] - ray[4]) - ray[1] * (point[0] - ray[3])
            miss = x * x + y * y + z * z
            score += np.log(0.05 + np.exp(-8.0 * miss) / (1.0 + np.sqrt(miss)))
        best = max(best, score)
        for i in range(3):
            side[i] += score * point[i]
            for j in range(3):
                normal[i, j] += point[i] * point[j]
    for k in range(3):  # elimination; the matrix is positive definite
        for i in range(k + 1, 3):
            share = normal[i, k] / normal[k, k]
            side[i] -= share * side[k]
            for j in range(3):
                normal[i, j] -= share * normal[k, j]
    return float(best + side[2] / normal[2, 2] + power[0, 0])
