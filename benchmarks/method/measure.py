"""Measurement of wall times, interleaved and in fresh processes: quantiles, exponents of growth, peak memory."""

from __future__ import annotations

import gc
import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.method.scenes import Case, Task
from mvpose.arrays import Floats

_LEAST_CALLS = 3


@dataclass(frozen=True)
class Machine:
    """Machine on which the figures were measured."""

    cpu: str
    cores: int


def machine() -> Machine:
    """Return the machine of this process."""
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [
            line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if line.startswith("model name")
        ]
        cpu = names[0] if names else cpu
    return Machine(cpu, os.cpu_count() or 1)


def versions() -> dict[str, str]:
    """Return the versions of Python and of the installed packages on which times depend, by name."""
    found = {"python": platform.python_version()}
    for package in ("numpy", "scipy", "numba", "onnxruntime"):
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


@dataclass(frozen=True)
class Sample:
    """Times of n calls of one task.

    Attributes:
        wall: wall time of each call, seconds, (n,).
        notes: figures that the task recorded for each call, by name, each (n,).
    """

    wall: Floats
    notes: dict[str, Floats]

    def quantile(self, share: float) -> float:
        """Return a quantile of the wall time, milliseconds."""
        return 1e3 * float(np.quantile(self.wall, share))

    def noted(self, name: str, share: float = 0.5) -> float:
        """Return a quantile, by default the median, of a recorded figure, in its unit."""
        return float(np.quantile(self.notes[name], share))


def interleaved(
    tasks: Mapping[str, Task], cases: Sequence[Case], *, calls: int, seconds: float = np.inf
) -> dict[str, Sample]:
    """Time tasks on cases, after one untimed call of each task on the first two cases.

    Each round runs every task on all cases in turn, so that a slowdown of the machine affects all tasks equally. The
    garbage collector is off during the measurement.

    Args:
        tasks: tasks by name.
        cases: frames on which each task is called.
        calls: number of calls after which a task stops, rounded up to whole rounds.
        seconds: total time of its calls after which a task stops, but not before the third call.
    """
    for task in tasks.values():
        for case in cases[:2]:
            task.call(case)
    running, walls = dict(tasks), {name: list[float]() for name in tasks}
    notes: dict[str, list[Mapping[str, float]]] = {name: [] for name in tasks}
    with collector_off():
        while running:
            for name, task in list(running.items()):
                for case in cases:
                    start = time.perf_counter()
                    result = task.call(case)
                    walls[name].append(time.perf_counter() - start)
                    notes[name].append(task.note(case, result))
                    out_of_time = len(walls[name]) >= _LEAST_CALLS and sum(walls[name]) > seconds
                    if out_of_time:
                        break
                if out_of_time or len(walls[name]) >= calls:
                    del running[name]
    return {
        name: Sample(
            np.array(walls[name]), {key: np.array([note[key] for note in notes[name]]) for key in notes[name][0]}
        )
        for name in tasks
    }


@contextmanager
def collector_off() -> Iterator[None]:
    """Collect garbage now, and turn the garbage collector off within the block."""
    was_on = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def exponent(sizes: ArrayLike, costs: ArrayLike) -> float:
    """Return the exponent of the growth of cost with size: the least-squares slope of log cost over log size.

    Only the larger half of the points (rounded up) is used, because small sizes measure the overhead of a call.

    Raises:
        ValueError: fewer than two different sizes in the larger half, or a value that is not positive.
    """
    sizes, costs = np.asarray(sizes, float), np.asarray(costs, float)
    if not ((sizes > 0).all() and (costs > 0).all()):
        raise ValueError(
            f"sizes and costs must be positive to fit an exponent, got {sizes.tolist()} and {costs.tolist()}"
        )
    larger = np.argsort(sizes, kind="stable")[len(sizes) // 2 :]
    x, y = np.log(sizes[larger]), np.log(costs[larger])
    x = x - x.mean() if len(x) else x
    if not (x @ x) > 0:
        raise ValueError(f"an exponent needs two different sizes in the larger half of {sizes.tolist()}")
    return float(x @ (y - y.mean()) / (x @ x))


def report(code: str, *, environment: Mapping[str, str] | None = None) -> Any:
    """Run code in a fresh Python process and return its output, parsed as JSON.

    The process writes byte code even if this one does not (``PYTHONDONTWRITEBYTECODE``), so that a second process
    starts as quickly as it does for a user.

    Raises:
        RuntimeError: the code failed; the message has the end of its error output.
    """
    inherited = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    root = str(Path(__file__).parents[2])  # folder of mvpose, also if it is not installed
    inherited["PYTHONPATH"] = os.pathsep.join(filter(None, (root, inherited.get("PYTHONPATH"))))
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**inherited, **(environment or {})},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"a process of the benchmark failed: {done.stderr.strip()[-2000:]}")
    return json.loads(done.stdout)


def peak_memory() -> float:
    """Return the peak resident memory of this process, MB (10^6 bytes).

    On Linux it is read from /proc, because ``getrusage`` there includes the memory of the parent at the start.
    """
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return float(line.split()[1]) * 1024 / 1e6
    import resource  # not on Windows

    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6
