"""How long Python takes to import mvpose, and the first call to compile."""

from __future__ import annotations

import statistics
import tempfile
import time
from dataclasses import dataclass

from benchmarks.method.processes import report
from benchmarks.method.report import against, caption, figure, table
from benchmarks.method.scenes import HARD, frames
from mvpose.pipeline import Pipeline

PRESETS = ("fast", "full")
IMPORTS = ("import numpy", "import numba", "import mvpose", "from mvpose import Pipeline")
IMPORT_TARGET, COMPILE_TARGET = 0.5, 20.0  # seconds


@dataclass(frozen=True)
class Start:
    """Seconds of one way to start, and what it should keep, or None."""

    what: str
    seconds: float
    target: float | None = None


def measure(*, quick: bool = False) -> list[Start]:
    """Time imports, and first calls without and with compiled kernels on the disk, each in a fresh process."""
    starts = []
    for statement in IMPORTS:
        code = f"import time; start = time.perf_counter(); {statement}; print(time.perf_counter() - start)"
        report(code)  # brings files into memory
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
    """Print the seconds of a preset's first frames, for a process of its own.

    The frames are hard ones, and several, so that no kernel is left to be compiled later.
    """
    scenes = frames(5, 4, 5, conditions=HARD)
    begin = time.perf_counter()
    pipeline = Pipeline.preset(preset)
    for scene in scenes:
        pipeline.estimate(scene.rig, scene.detections)
    print(time.perf_counter() - begin)


def table_of(starts: list[Start]) -> str:
    """The text."""
    rows = [["seconds, in a fresh process", "", "", "target"]]
    for start in starts:
        rows.append([start.what, figure(start.seconds), *against(start.seconds, start.target)])
    return table(rows, "<>^>", rules=(0, len(IMPORTS))) + caption(
        "First calls: five hard 5×4 frames, in a process of their own and with a cache of their own, empty or not."
    )
