"""Real Shelf: every method on the same detections of five cameras, with intervals by blocks of frames.

A finished method is kept, so that an interrupted evaluation goes on with the next one.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.leaderboard.entries import Entry
from benchmarks.leaderboard.figures import ALL, DIFFERENCE, Figure, best_of_ours
from mvpose import preset
from mvpose.arrays import Floats
from mvpose.files.atomic_files import write_atomic
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.evaluation import evaluate
from simharness.scoring.pcp import Part
from simharness.statistics.resampling import block_weights, blocks, interval, resampled
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
    """Return correct and counted parts of each frame and actor (T, A), scores and times of a method, JSON-ready."""
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
    parts = evaluation.variants[entry.name].frames.parts[:, list(recording.scored)]
    annotated = np.isfinite(recording.truth).any(axis=(1, 2, 3))
    result = {
        "time": recording.time[annotated].tolist(),
        "correct": (parts == Part.CORRECT).sum(axis=2).tolist(),
        "counted": (parts != Part.UNDEFINED).sum(axis=2).tolist(),
        "summary": evaluation.summary()["variants"][entry.name],
    }
    write_atomic(file, json.dumps(result).encode())
    return result


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
