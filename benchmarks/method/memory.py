"""Peak memory of a fresh process at the largest of the sizes."""

from __future__ import annotations

import json
from dataclasses import dataclass

import mvpose
from benchmarks.method.measure import peak_memory, report
from benchmarks.method.report import against, caption, figure, table
from benchmarks.method.scenes import frames

PRESETS = ("fast", "full")
SIZE = (31, 10)
TARGET = 300.0  # MB in all


@dataclass(frozen=True)
class Peak:
    """Peak memory of the process of one preset.

    Attributes:
        preset: name of the preset.
        views: number of cameras.
        people: number of people.
        total: peak resident memory, MB.
        imports: peak resident memory after the imports, MB.
        target: limit of ``total``, MB.
    """

    preset: str
    views: int
    people: int
    total: float
    imports: float
    target: float = TARGET


def measure(*, quick: bool = False) -> list[Peak]:
    """Run some frames in a process for each preset, with kernels that an earlier process compiled."""
    views, people = (5, 4) if quick else SIZE
    peaks = []
    for preset in PRESETS:
        code = f"from benchmarks.method.memory import in_process; in_process({preset!r}, {views}, {people})"
        report(code)  # compiles the kernels, which itself takes memory
        peaks.append(Peak(preset, views, people, **report(code)))
    return peaks


def in_process(preset: str, views: int, people: int) -> None:
    """Run some frames and print the peak memory as JSON, for a child process of :func:`measure`."""
    imports = peak_memory()
    pipeline = mvpose.preset(preset)
    for scene in frames(views, people, 5):
        pipeline.estimate(scene.rig, scene.detections)
    print(json.dumps({"imports": imports, "total": peak_memory()}))


def table_of(peaks: list[Peak]) -> str:
    """Format the peaks as text."""
    rows = [["peak resident memory, MB", "total", "", "target", "imports", "difference"]]
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
    return table(rows, "<>^>>>") + caption("A fresh process with cached kernels, over five frames.")
