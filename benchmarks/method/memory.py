"""The most memory that a fresh process holds, at the largest of the sizes."""

from __future__ import annotations

import json
from dataclasses import dataclass

from benchmarks.method.processes import peak_memory, report
from benchmarks.method.report import against, caption, figure, table
from benchmarks.method.scenes import frames
from mvpose.pipeline import Pipeline

PRESETS = ("fast", "full")
SIZE = (31, 10)
TARGET = 300.0  # MB in all


@dataclass(frozen=True)
class Peak:
    """One preset's process: resident memory in MB, at its peak and at the peak of the imports, and the target."""

    preset: str
    views: int
    people: int
    total: float
    imports: float
    target: float = TARGET


def measure(*, quick: bool = False) -> list[Peak]:
    """Run some frames in a process for each preset, its kernels compiled by one before it."""
    views, people = (5, 4) if quick else SIZE
    peaks = []
    for preset in PRESETS:
        code = f"from benchmarks.method.memory import in_process; in_process({preset!r}, {views}, {people})"
        report(code)  # compiles, which takes memory of its own
        peaks.append(Peak(preset, views, people, **report(code)))
    return peaks


def in_process(preset: str, views: int, people: int) -> None:
    """Print what :func:`measure` wants of a process of its own."""
    imports = peak_memory()
    pipeline = Pipeline.preset(preset)
    for scene in frames(views, people, 5):
        pipeline.estimate(scene.rig, scene.detections)
    print(json.dumps({"imports": imports, "total": peak_memory()}))


def table_of(peaks: list[Peak]) -> str:
    """The text."""
    rows = [["peak resident memory, MB", "in all", "", "target", "imports", "above them"]]
    for peak in peaks:
        rows.append(
            [
                f"{peak.preset}, {peak.views}×{peak.people}",
                figure(peak.total),
                *against(peak.total, peak.target),
                figure(peak.imports),
                figure(peak.total - peak.imports),
            ]
        )
    return table(rows, "<>^>>>") + caption("Of a fresh process whose kernels are cached, over five frames.")
