"""Wall times of tasks: interleaved, medians and tails, growth against size."""

from __future__ import annotations

import gc
import os
import platform
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.method.tasks import Case, Task
from mvpose.arrays import Floats

_LEAST_CALLS = 3


@dataclass(frozen=True)
class Machine:
    """What the figures were measured on."""

    cpu: str
    cores: int


def machine() -> Machine:
    """The machine of this process."""
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [
            line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if line.startswith("model name")
        ]
        cpu = names[0] if names else cpu
    return Machine(cpu, os.cpu_count() or 1)


def versions() -> dict[str, str]:
    """Python's version and those of the packages that times depend on and that are installed, by name."""
    found = {"python": platform.python_version()}
    for package in ("numpy", "scipy", "numba", "onnxruntime"):
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


@dataclass(frozen=True)
class Sample:
    """The n timed calls of one task.

    Attributes:
        wall: seconds by a clock outside the call, (n,).
        notes: what each call said of itself, by name, each (n,).
    """

    wall: Floats
    notes: dict[str, Floats]

    def quantile(self, share: float) -> float:
        """Milliseconds that this share of the calls keeps."""
        return 1e3 * float(np.quantile(self.wall, share))

    def noted(self, name: str, share: float = 0.5) -> float:
        """The same of what the calls noted under a name, in its unit; the median unless told otherwise."""
        return float(np.quantile(self.notes[name], share))


def interleaved(
    tasks: Mapping[str, Task], cases: Sequence[Case], *, calls: int, seconds: float = np.inf
) -> dict[str, Sample]:
    """Time tasks on cases, after one untimed call of each on the first two.

    Each round takes every task through all cases in turn, so that a machine that slows down slows all alike. The
    garbage collector is off meanwhile.

    Args:
        tasks: what to time, by name.
        cases: the frames.
        calls: a task stops after as many, rounded up to whole rounds;
        seconds: or when its calls have taken this long, but not before the third.
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
                    late = len(walls[name]) >= _LEAST_CALLS and sum(walls[name]) > seconds
                    if late:
                        break
                if late or len(walls[name]) >= calls:
                    del running[name]
    return {
        name: Sample(
            np.array(walls[name]), {key: np.array([note[key] for note in notes[name]]) for key in notes[name][0]}
        )
        for name in tasks
    }


@contextmanager
def collector_off() -> Iterator[None]:
    """Collect garbage now and not within the block."""
    was_on = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def exponent(sizes: ArrayLike, costs: ArrayLike) -> float:
    """Growth of cost with size: the slope of log cost over log size, by least squares.

    Only the larger half of the points counts (rounded up): small sizes measure the overhead of a call.

    Raises:
        ValueError: fewer than two different sizes among those, or a value that is not positive.
    """
    sizes, costs = np.asarray(sizes, float), np.asarray(costs, float)
    if not ((sizes > 0).all() and (costs > 0).all()):
        raise ValueError("sizes and costs must be positive to fit an exponent")
    larger = np.argsort(sizes, kind="stable")[len(sizes) // 2 :]
    x, y = np.log(sizes[larger]), np.log(costs[larger])
    x = x - x.mean() if len(x) else x
    if not (x @ x) > 0:
        raise ValueError(f"an exponent needs two different sizes in the larger half of {sizes.tolist()}")
    return float(x @ (y - y.mean()) / (x @ x))
