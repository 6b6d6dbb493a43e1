"""What a frame costs, as a text: by stage beside the paper, by size beside the code of others, and its growth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from benchmarks.method.curve import COSTS, PRESETS, Point
from benchmarks.method.published import OTHERS, RELEASED, Beside
from benchmarks.method.report import figure
from benchmarks.method.tasks import STAGES
from benchmarks.simulator.result import SWEPT, Result

_TITLES = {
    "affinity": "affinity of detections",
    "matching": "matching (`fast` clustering, `full` and paper ADMM)",
    "reconstruction": "reconstruction (`fast` triangulation, `full` and paper 3DPS)",
}


def markdown(result: Result) -> str:
    """A result as a text to read."""
    return "\n".join(_lines(result)) + "\n"


def _lines(result: Result) -> Iterator[str]:
    yield "# Running time"
    if result.quick:
        yield "\n**Quick: few frames were timed, and these figures are not to be quoted.**"
    software = ", ".join(f"{name} {number}" for name, number in result.versions.items())
    yield f"\n{result.machine.cpu}, {result.machine.cores} cores, of which one is used; no GPU. {software}."
    yield f"\n    {result.command}\n"
    yield f"It took {result.seconds:.0f} s. Synthetic people and cameras (`benchmarks/method/scenes.py`); ms a frame."
    paper = next(beside for beside in result.published if beside.paper)
    yield from _stages(result, paper)
    yield from _sizes(result)
    yield from _growth(result)


def _stages(result: Result, beside: Beside) -> Iterator[str]:
    """By stage, at the size of the paper's figures."""
    ours, paper = beside.ours, beside.paper or {}
    network = [crops for crops in result.reid if (crops.views, crops.people) == (ours.views, ours.people)]
    yield f"\n## {ours.views} views of {ours.people} people, by stage\n"
    rows = [["re-ID network", *["not measured"] * len(PRESETS), "in the affinity"]]
    for crops in network:
        told = figure(crops.frame)
        rows = [
            [f"re-ID network, where looks are used: {crops.crops} crops", *[told] * len(PRESETS), "in the affinity"]
        ]
    for stage in STAGES:
        told = figure(paper[stage])
        theirs = f"{told}, re-ID network on a GPU included" if stage == "affinity" else told
        rows.append([_TITLES[stage], *(figure(ours.ms[preset][stage]) for preset in PRESETS), theirs])
    without = figure(sum(ms for stage, ms in paper.items() if stage != "affinity"))
    totals = [ours.ms[preset]["total"] for preset in PRESETS]
    rows.append(["whole frame without the network", *map(figure, totals), f"{without} (matching + 3DPS)"])
    for crops in network:
        sums = [*(total + crops.frame for total in totals), sum(paper.values())]
        rows.append(["whole frame with it", *map(figure, sums)])
    yield from _table(["ms a frame, medians", *(f"`{preset}`" for preset in PRESETS), "paper"], rows)
    yield (
        "\nPaper: Dong et al., CVPR 2019, Shelf, Intel i7 at 3.6 GHz and GeForce 1080 Ti, means. Ours: one core; the "
        "affinity is of geometry alone, since these detections carry no descriptors; 3DPS reads keypoints and not heat "
        "maps. The detector of 2D poses is in neither."
    )
    for crops in network:
        yield (
            f"The network that comes with `mvpose` takes {figure(crops.crop)} ms a crop on one thread of the CPU, "
            "cutting it out included, and is another than the paper's."
        )


def _sizes(result: Result) -> Iterator[str]:
    """Whole frames and matching, at the sizes at which the code of others was timed."""
    yield "\n## Beside the code of others\n"
    rows = []
    for beside in result.published:
        full, fast = beside.ours.ms["full"], beside.ours.ms["fast"]
        same = full["matching"] + full["reconstruction"]
        released = beside.others[RELEASED]
        rows.append(
            [
                f"{beside.ours.views} × {beside.ours.people}",
                str(beside.ours.detections),
                *map(figure, (fast["total"], full["total"], same, released)),
                f"{released / same:.0f} ×",
            ]
        )
    heads = ["detections", "`fast`", "`full`", "of it matching + 3DPS", "released code, the same", "slower by"]
    yield from _table(["views × people", *heads], rows)
    yield "\nMatching alone:\n"
    rows = [
        [
            f"{beside.ours.views} × {beside.ours.people}",
            *(figure(beside.ours.ms[preset]["matching"]) for preset in PRESETS),
            *(figure(beside.others[name]) for name in OTHERS if name != RELEASED),
        ]
        for beside in result.published
    ]
    theirs = ["released code", "released code, constrained", "EasyMocap (C++), constrained"]
    yield from _table(["views × people", *(f"`{preset}`" for preset in PRESETS), *theirs], rows)
    yield (
        "\nMedians, networks excluded. The code of others was timed once, on one core of a 2-core machine. "
        "Constrained: rows and columns of P sum to at most 1, as the paper asks; `full` always keeps that."
    )


def _growth(result: Result) -> Iterator[str]:
    """The curves in numbers, and their exponents."""
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
        "\nFirst quartiles of the calls, which other work on the machine disturbs less than medians. Exponents: slopes "
        "of log time over log size, by least squares on the larger half of the sizes."
    )


def _size(point: Point) -> str:
    return f"{point.views} × {point.people}"


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    yield f"| {' | '.join(heads)} |"
    yield f"|{'|'.join([':--', *['--:'] * (len(heads) - 1)])}|"
    yield from (f"| {' | '.join(row)} |" for row in rows)
