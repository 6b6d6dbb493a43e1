"""Runs trials in processes and keeps their results, one line of JSON each, so that a run can go on later."""

from __future__ import annotations

import json
import multiprocessing
import sys
import time
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.doctor.experiments import TrialKey, measure
from benchmarks.doctor.recordings import Recordings

_state: dict[str, Recordings] = {}  # of a worker process


def run(recordings: Path, keys: Sequence[TrialKey], results: Path, *, workers: int) -> int:
    """Run the trials that have no result yet, append their results, and return how many failed.

    Args:
        recordings: file of the recordings.
        keys: trials.
        results: file of results, one line of JSON for each trial.
        workers: number of processes.
    """
    done = read_results(results) if results.is_file() else {}
    left = [key for key in keys if str(key) not in done]
    failed, start = 0, time.perf_counter()
    results.parent.mkdir(parents=True, exist_ok=True)
    # Processes are started anew: numba and BLAS do not survive a fork.
    pool = multiprocessing.get_context("spawn").Pool(workers, _begin, (recordings,))
    with pool, results.open("a") as file:
        for count, (key, result) in enumerate(pool.imap_unordered(_measured, left), 1):
            failed += "error" in result
            print(json.dumps({"trial": str(key), **result}), file=file, flush=True)
            seconds = time.perf_counter() - start
            print(f"\r{count}/{len(left)} trials, {failed} failed, {seconds:.0f} s", end="", file=sys.stderr)
    if left:
        print(file=sys.stderr)
    return failed


def read_results(file: Path) -> dict[str, dict[str, Any]]:
    """Return the results of trials that did not fail, by trial; of a repeated trial the last."""
    results: dict[str, dict[str, Any]] = {}
    for line in file.read_text().splitlines():
        try:
            result = json.loads(line)
        except json.JSONDecodeError:  # the line on which a run was stopped
            continue
        results[result.pop("trial")] = result
    return {key: result for key, result in results.items() if "error" not in result}


def _begin(recordings: Path) -> None:
    _state["recordings"] = Recordings(recordings)


def _measured(key: TrialKey) -> tuple[TrialKey, dict[str, Any]]:
    try:
        return key, measure(key, _state["recordings"])
    except Exception:
        return key, {"error": traceback.format_exc(limit=-3)}
