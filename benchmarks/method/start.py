"""Time of the import of mvpose, and of a first call that compiles the kernels."""

from __future__ import annotations

import statistics
import tempfile
import time
from dataclasses import dataclass

import mvpose
from benchmarks.method.measure import report
from benchmarks.method.report import against, caption, figure, table
from benchmarks.method.scenes import HARD, frames

PRESETS = ("fast", "full")
IMPORTS = ("import numpy", "import numba", "import mvpose", "from mvpose import Pipeline")
IMPORT_TARGET, COMPILE_TARGET = 0.5, 20.0  # seconds


@dataclass(frozen=True)
class Start:
    """Time of one kind of start.

    Attributes:
        what: description of the start.
        seconds: time in seconds.
        target: greatest time allowed, seconds, or None.
    """

    what: str
    seconds: float
    target: float | None = None


def measure(*, quick: bool = False) -> list[Start]:
    """Time imports, and first calls without and with a cache of compiled kernels, each in a fresh process."""
    starts = []
    for statement in IMPORTS:
        code = f"import time; start = time.perf_counter(); {statement}; print(time.perf_counter() - start)"
        report(code)  # loads the files into the page cache
        seconds = statistics.median(report(code) for _ in range(1 if quick else 7))
        starts.append(Start(statement, seconds, IMPORT_TARGET if "mvpose" in statement else None))
    for preset in PRESETS:
        with tempfile.TemporaryDirectory() as cache:
            for when, target in (("first call after install", COMPILE_TARGET), ("first call later", None)):
                code = f"from benchmarks.method.start import in_process; in_process({preset!r})"
                seconds = report(code, environment={"NUMBA_CACHE_DIR": cache})
                starts.append(Start(f"{when}: {preset}", seconds, target))
    return starts


def in_process(preset: str) -> None:
    """Print the time of the first frames of a preset in seconds, for a child process of :func:`measure`.

    Several hard frames are used, so that all kernels are compiled.
    """
    scenes = frames(5, 4, 5, conditions=HARD)
    begin = time.perf_counter()
    pipeline = mvpose.preset(preset)
    for scene in scenes:
        pipeline.estimate(scene.rig, scene.detections)
    print(time.perf_counter() - begin)


def table_of(starts: list[Start]) -> str:
    """Format the starts as text."""
    rows = [["seconds, in a fresh process", "", "", "target"]]
    for start in starts:
        rows.append([start.what, figure(start.seconds), *against(start.seconds, start.target)])
    return table(rows, "<>^>", rules=(0, len(IMPORTS))) + caption(
        "First calls: five hard 5×4 frames, in a fresh process with a separate cache, empty or filled."
    )
