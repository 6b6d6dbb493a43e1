"""Time of every stage at three sizes, compared with the targets and the released code."""

from __future__ import annotations

import time
from dataclasses import dataclass

from threadpoolctl import threadpool_limits

from benchmarks.method.measure import Sample, interleaved
from benchmarks.method.published import RELEASED, others_at
from benchmarks.method.report import against, caption, figure, table
from benchmarks.method.scenes import STAGES, decomposing, estimating, frames, matching, prepare

SIZES = ((5, 4), (10, 10), (31, 10))

# Milliseconds on one core.
TARGETS: dict[tuple[int, int], dict[str, float]] = {
    (5, 4): {"fast": 0.05, "fast p99": 0.15, "admm": 0.4, "3dps": 0.3},
    (10, 10): {"fast": 0.6, "fast p99": 1.0, "admm": 8.0, "3dps": 2.0},
    (31, 10): {"fast": 4.0, "fast p99": 8.0, "admm": 70.0, "admm in eigh": 10.0, "3dps": 15.0},
}


@dataclass(frozen=True)
class Size:
    """Times at one size in milliseconds, medians unless stated otherwise.

    Attributes:
        views: number of cameras.
        people: number of people.
        detections: median number of detections per frame.
        calls: number of timed calls by task.
        cores: processor time over wall time of ``fast`` and ``full``; above 1 if threads were used.
        times: times by name.
        iterations: median number of iterations of ADMM.
        targets: target times by name.
        released: time of matching and 3DPS of the released code.
    """

    views: int
    people: int
    detections: int
    calls: dict[str, int]
    cores: float
    times: dict[str, float]
    iterations: float
    targets: dict[str, float]
    released: float


def measure(*, quick: bool = False) -> list[Size]:
    """Time ``fast``, ``full`` and matching by ADMM at the three sizes."""
    return [_size(views, people, quick) for views, people in (SIZES[:1] if quick else SIZES)]


def _size(views: int, people: int, quick: bool) -> Size:
    cases = prepare(frames(views, people, 4 if quick else 20))
    calls, seconds = (8, 5.0) if quick else (600, 12.0)
    wall, busy = time.perf_counter(), time.process_time()
    whole = interleaved({name: estimating(name) for name in ("fast", "full")}, cases, calls=calls, seconds=seconds)
    cores = (time.process_time() - busy) / (time.perf_counter() - wall)
    admm = matching("admm", lambda case, result: {"iterations": result.iterations})
    with threadpool_limits(1):  # as in the pipeline, for both tasks
        alone = interleaved({"admm": admm, "eigh": decomposing()}, cases, calls=calls, seconds=seconds / 2)
    return Size(
        views=views,
        people=people,
        detections=sorted(len(case.scene.detections) for case in cases)[len(cases) // 2],
        calls={name: len(sample.wall) for name, sample in (whole | alone).items()},
        cores=cores,
        times={
            **_times("fast", whole["fast"]),
            **_times("full", whole["full"]),
            "3dps": whole["full"].noted("reconstruction"),
            "admm": alone["admm"].quantile(0.5),
            "eigh": alone["eigh"].quantile(0.5),
            "admm in eigh": alone["admm"].quantile(0.5) / alone["eigh"].quantile(0.5),
        },
        iterations=alone["admm"].noted("iterations"),
        targets=TARGETS[views, people],
        released=others_at((views, people))[RELEASED],
    )


def _times(name: str, sample: Sample) -> dict[str, float]:
    stages = {f"{name} {stage}": sample.noted(stage) for stage in STAGES}
    return {name: sample.quantile(0.5), f"{name} p99": sample.quantile(0.99), **stages}


_ROWS = (
    ("fast                      median", "fast"),
    ("                          p99", "fast p99"),
    ("  affinity", "fast affinity"),
    ("  clustering", "fast matching"),
    ("  robust triangulation", "fast reconstruction"),
    ("full                      median", "full"),
    ("                          p99", "full p99"),
    ("  affinity", "full affinity"),
    ("  ADMM matching", "full matching"),
    ("  3DPS, all people", "3dps"),
    ("ADMM alone                median", "admm"),
    ("  as multiples of eigh", "admm in eigh"),
    ("  one numpy.linalg.eigh", "eigh"),
)


def table_of(sizes: list[Size]) -> str:
    """Format the sizes as text."""
    rows = [["ms per frame, one core"], [""]]
    for size in sizes:
        rows[0] += [f"{size.views}×{size.people}", "", "target"]
        rows[1] += [f"m = {size.detections}", "", ""]
    for label, name in _ROWS:
        rows.append([label])
        for size in sizes:
            value, target = size.times[name], size.targets.get(name)
            rows[-1] += [figure(value), *against(value, target)]
    for label, values in (
        ("  iterations", [f"{size.iterations:.0f}" for size in sizes]),
        ("released code, matching + 3DPS", [figure(size.released) for size in sizes]),
        (
            "  full is faster by",
            [f"{size.released / (size.times['full matching'] + size.times['3dps']):.0f} x" for size in sizes],
        ),
    ):
        rows.append([label] + [cell for value in values for cell in (value, "", "")])
    calls = ", ".join(
        "/".join(str(size.calls[name]) for size in sizes) + f" of {name}" for name in ("fast", "full", "admm")
    )
    cores = "/".join(f"{size.cores:.2f}" for size in sizes)
    return table(rows, "<" + ">^>" * len(sizes), rules=(1, 6, 11, 15)) + caption(
        f"m detections; 4 px noise, 10 % of joints and 5 % of people missed. Calls timed: {calls}. Cores used: "
        f"{cores}; below 1, the machine had other load; above 1, threads were used. Stages are medians of "
        "Estimate.timings; whole frames are timed outside the call. eigh has the size of the frame and runs on one "
        "thread, as does ADMM alone. The released code was timed once, on one core of a similar machine, without its "
        "networks; faster by: matching and 3DPS only."
    )
