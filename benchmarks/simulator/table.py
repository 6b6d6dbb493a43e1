"""Markdown tables of the time per frame: by stage against the paper, by size against other code, and its growth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from benchmarks.method.curve import COSTS, PRESETS, Point
from benchmarks.method.published import OTHERS, RELEASED, Comparison
from benchmarks.method.report import figure
from benchmarks.method.scenes import STAGES
from benchmarks.simulator.result import SWEPT, Result

_TITLES = {
    "affinity": "affinity of detections",
    "matching": "matching (`fast` clustering, `full` and paper ADMM)",
    "reconstruction": "reconstruction (`fast` triangulation, `full` and paper 3DPS)",
}


def markdown(result: Result) -> str:
    """Format a result as Markdown."""
    return "\n".join(_lines(result)) + "\n"


def _lines(result: Result) -> Iterator[str]:
    yield "# Running time"
    if result.quick:
        yield "\n**Quick: only few frames were timed; do not quote these figures.**"
    software = ", ".join(f"{name} {number}" for name, number in result.versions.items())
    yield f"\n{result.machine.cpu}, {result.machine.cores} cores, of which one is used; no GPU. {software}."
    yield f"\n    {result.command}\n"
    yield (
        f"Duration: {result.seconds:.0f} s. Synthetic people and cameras (`benchmarks/method/scenes.py`); "
        "times in ms per frame."
    )
    paper = next(comparison for comparison in result.published if comparison.paper)
    yield from _stages(result, paper)
    yield from _sizes(result)
    yield from _growth(result)


def _stages(result: Result, comparison: Comparison) -> Iterator[str]:
    """Format the times by stage at the size of the paper's times."""
    ours, paper = comparison.ours, comparison.paper or {}
    network = [crops for crops in result.reid if (crops.views, crops.people) == (ours.views, ours.people)]
    yield f"\n## {ours.views} views of {ours.people} people, by stage\n"
    rows = [["re-ID network", *["not measured"] * len(PRESETS), "in the affinity"]]
    for crops in network:
        name = f"re-ID network, if appearance is used: {crops.crops} crops"
        rows = [[name, *[figure(crops.frame)] * len(PRESETS), "in the affinity"]]
    for stage in STAGES:
        paper_ms = figure(paper[stage])
        paper_cell = f"{paper_ms}, including the re-ID network on a GPU" if stage == "affinity" else paper_ms
        rows.append([_TITLES[stage], *(figure(ours.ms[preset][stage]) for preset in PRESETS), paper_cell])
    without = figure(sum(ms for stage, ms in paper.items() if stage != "affinity"))
    totals = [ours.ms[preset]["total"] for preset in PRESETS]
    rows.append(["whole frame without the network", *map(figure, totals), f"{without} (matching + 3DPS)"])
    for crops in network:
        sums = [*(total + crops.frame for total in totals), sum(paper.values())]
        rows.append(["whole frame with the network", *map(figure, sums)])
    yield from _table(["ms per frame, medians", *(f"`{preset}`" for preset in PRESETS), "paper"], rows)
    yield (
        "\nPaper: Dong et al., CVPR 2019, Shelf, Intel i7 at 3.6 GHz and GeForce 1080 Ti, means. Ours: one core; the "
        "affinity uses geometry only, because these detections carry no descriptors; 3DPS uses keypoints, not heat "
        "maps. Neither includes the 2D pose detector."
    )
    for crops in network:
        yield (
            f"The re-ID network of `mvpose` takes {figure(crops.crop)} ms per crop on one thread of the CPU, including "
            "the cutting of the crop; it differs from the network of the paper."
        )


def _sizes(result: Result) -> Iterator[str]:
    """Format the times of whole frames and of matching, at the sizes for which times of other code are known."""
    yield "\n## Compared with other code\n"
    rows = []
    for comparison in result.published:
        full, fast = comparison.ours.ms["full"], comparison.ours.ms["fast"]
        same = full["matching"] + full["reconstruction"]
        released = comparison.others[RELEASED]
        rows.append(
            [
                f"{comparison.ours.views} × {comparison.ours.people}",
                str(comparison.ours.detections),
                *map(figure, (fast["total"], full["total"], same, released)),
                f"{released / same:.0f} ×",
            ]
        )
    heads = ["detections", "`fast`", "`full`", "`full`, matching + 3DPS", "released code, matching + 3DPS", "slower by"]
    yield from _table(["views × people", *heads], rows)
    yield "\nMatching only:\n"
    rows = [
        [
            f"{comparison.ours.views} × {comparison.ours.people}",
            *(figure(comparison.ours.ms[preset]["matching"]) for preset in PRESETS),
            *(figure(comparison.others[name]) for name in OTHERS if name != RELEASED),
        ]
        for comparison in result.published
    ]
    other_heads = ["released code", "released code, constrained", "EasyMocap (C++), constrained"]
    yield from _table(["views × people", *(f"`{preset}`" for preset in PRESETS), *other_heads], rows)
    yield (
        "\nMedians without networks. The other code was timed once, on one core of a 2-core machine. Constrained: row "
        "and column sums of P are at most 1, as the paper requires; `full` always enforces this."
    )


def _growth(result: Result) -> Iterator[str]:
    """Format the curves and their exponents."""
    heads = [f"`{preset}` {cost}" for preset in PRESETS for cost in COSTS]
    for grows in SWEPT:
        sweep = result.sweep(grows)
        yield f"\n## Growth with {grows}\n"
        rows = [
            [_size(point), *(figure(point.ms[preset][cost]) for preset in PRESETS for cost in COSTS)]
            for point in sweep.points
        ]
        rows.append(["exponent", *(f"{sweep.exponents[preset][cost]:.2f}" for preset in PRESETS for cost in COSTS)])
        yield from _table(["views × people", *heads], rows)
    yield (
        "\nFirst quartiles of the calls, which depend less on other load on the machine than medians. Exponents: "
        "slopes of log time over log size, by least squares on the larger half of the sizes."
    )


def _size(point: Point) -> str:
    return f"{point.views} × {point.people}"


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    yield f"| {' | '.join(heads)} |"
    yield f"|{'|'.join([':--', *['--:'] * (len(heads) - 1)])}|"
    yield from (f"| {' | '.join(row)} |" for row in rows)
