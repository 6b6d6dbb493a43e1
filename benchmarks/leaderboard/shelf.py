"""Real Shelf: every method on the same detections, with all cameras and with fewer, and intervals by blocks of frames.

A finished method is kept, so that an interrupted evaluation goes on with the next one.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.leaderboard.entries import Entry
from benchmarks.leaderboard.figures import ALL, DIFFERENCE, Figure, best_of_ours
from mvpose import preset
from mvpose.arrays import Bools, Floats
from mvpose.estimators import Estimator
from mvpose.files.atomic_files import write_atomic
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.evaluation import evaluate
from simharness.scoring.frame_scores import FrameScores, score_frames
from simharness.scoring.pcp import Part
from simharness.statistics.resampling import block_weights, blocks, interval, resampled
from simharness.trial.conditioned_trial import estimate_frames
from simharness.trial.identity import code, estimator_code
from simharness.trial.stages.estimators import user_estimator

NAME = "shelf"
"""Name of the recording."""


def evaluated(
    recording: AnnotatedRecording, entries: Sequence[Entry], folder: Path, advance: Callable[[int], None]
) -> list[Figure]:
    """Return the figures of methods on a recording.

    Args:
        recording: the recording.
        entries: methods.
        folder: where finished methods are kept.
        advance: called with 1 after each method.
    """
    folder.mkdir(parents=True, exist_ok=True)
    results = {}
    for entry in entries:
        results[entry.name] = _result(recording, entry, folder)
        advance(1)
    return recording_figures(results, entries)


def _result(recording: AnnotatedRecording, entry: Entry, folder: Path) -> dict[str, Any]:
    """Return the results of a method, JSON-ready.

    ``time`` (T,), seconds; ``correct`` and ``counted``, parts of each frame and actor (T, A), with all cameras; the
    same in ``fewer`` by number of cameras, as sums over all sets of that many; and ``summary`` with all cameras.
    """
    digests = code()
    identity = [recording.name, len(recording), digests.method, digests.scores]
    identity.append("" if entry.ours else estimator_code(entry.place))
    name = hashlib.sha256(json.dumps(identity).encode()).hexdigest()[:16]
    file = folder / f"{entry.name}-{name}.json"
    if file.is_file():
        kept: dict[str, Any] = json.loads(file.read_text())
        return kept
    estimator = preset(entry.name) if entry.ours else user_estimator(entry.name, entry.place)
    evaluation = evaluate(recording, {entry.name: estimator})
    annotated = np.asarray(np.isfinite(recording.truth).any(axis=(1, 2, 3)))
    cameras = range(len(recording.rig))
    result = {
        "time": recording.time[annotated].tolist(),
        **_counts([evaluation.variants[entry.name].frames], recording.scored),
        "fewer": {
            str(count): _counts(
                [_scored(recording.subset(views), estimator, annotated) for views in combinations(cameras, count)],
                recording.scored,
            )
            for count in range(len(cameras) - 1, 1, -1)
        },
        "summary": evaluation.summary()["variants"][entry.name],
    }
    write_atomic(file, json.dumps(result).encode())
    return result


def _scored(recording: AnnotatedRecording, estimator: Estimator, annotated: Bools) -> FrameScores:
    """Return the scores of a method in the annotated frames (F,); missing joints of the face are filled from others."""
    estimates = estimate_frames(estimator, recording.rig, recording.timed_detections)
    joints = [each.joints for each, known in zip(estimates, annotated, strict=True) if known]
    return score_frames(recording.truth[annotated], joints, filled=True)


def _counts(scores: Sequence[FrameScores], actors: Sequence[int]) -> dict[str, Any]:
    """Return correct and counted parts of each frame and actor, (T, A), as sums over recordings of the same frames."""
    parts = np.stack([each.parts[:, list(actors)] for each in scores])
    return {
        "correct": (parts == Part.CORRECT).sum(axis=(0, 3)).tolist(),
        "counted": (parts != Part.UNDEFINED).sum(axis=(0, 3)).tolist(),
    }


def recording_figures(results: dict[str, dict[str, Any]], entries: Sequence[Entry]) -> list[Figure]:
    """Return the figures of methods from their results on one recording.

    Intervals are those of a block bootstrap over time; all methods have the same resamples, so that differences are
    paired.
    """
    some = next(iter(results.values()))
    weights, count = block_weights(some["time"]), blocks(some["time"])
    whole = np.ones((1, len(some["time"])))
    found, samples = [], {}
    for name, result in results.items():
        samples[name] = pcp(result, weights)
        low, high = (float(end) for end in interval(samples[name].mean(axis=1), blocks=count))
        found.append(Figure(name, ALL, "pcp", float(pcp(result, whole).mean()), low, high, count))
        ends = interval(samples[name], blocks=count)
        for actor, value in enumerate(pcp(result, whole)[0]):
            of_actor = (float(value), float(ends[0][actor]), float(ends[1][actor]))
            found.append(Figure(name, f"actor {actor + 1}", "pcp", *of_actor, count))
        for cameras, fewer in result["fewer"].items():
            low, high = (float(end) for end in interval(pcp(fewer, weights).mean(axis=1), blocks=count))
            found.append(Figure(name, f"{cameras} cameras", "pcp", float(pcp(fewer, whole).mean()), low, high, count))
        found += _others(name, result["summary"], count)
    best = best_of_ours(found, entries)
    for name, result in results.items():
        if name != best:
            low, high = (float(end) for end in interval((samples[name] - samples[best]).mean(axis=1), blocks=count))
            value = float((pcp(result, whole) - pcp(results[best], whole)).mean())
            found.append(Figure(name, ALL, DIFFERENCE, value, low, high, count))
    return found


def pcp(result: dict[str, Any], weights: Floats) -> Floats:
    """Return the PCP of each actor in resamples, (R, A), percent, from their weights (R, T)."""
    correct, counted = (resampled(np.array(result[key], float), weights) for key in ("correct", "counted"))
    return 100.0 * np.divide(correct, counted, out=np.full_like(correct, np.nan), where=counted > 0)


def _others(name: str, summary: dict[str, Any], count: int) -> list[Figure]:
    """Return scores without intervals: the protocol counts people who are not annotated as ghosts."""
    values = {
        "precision": 100.0 * (summary["precision"] or 0.0),
        "recall": 100.0 * (summary["recall"] or 0.0),
        "mpjpe_mm": summary["mpjpe_mm"]["mean"],
        "ghosts": summary["ghosts_per_frame"],
        "time_ms": summary["timings_ms"]["total"]["median"],
    }
    return [
        Figure(name, ALL, key, math.nan if value is None else float(value), math.nan, math.nan, count)
        for key, value in values.items()
    ]
