"""Scene frames per second without pictures, and growth of the time per frame with people and cameras."""

from __future__ import annotations

import time
from dataclasses import dataclass

from benchmarks.method.measure import collector_off, exponent
from benchmarks.method.report import MET, MISSED, bar, caption, figure, table
from benchmarks.simulator.scenes import scenario
from mvpose.camera import Rig
from simharness.capture.filming import film
from simharness.capture.ray_visibility import RayObserver
from simharness.detector.detect import detect
from simharness.scenario.sections.scenario import Scenario
from simharness.world.rigs.faults import ExposureSchedule
from simharness.world.rigs.layouts import build_rig
from simharness.world.scene.build import Scene, build
from simharness.world.scene.playback import Playback, simulate

TARGET = 1000.0  # scene frames per second with 4 people and 5 cameras
RATE = 25.0  # frames per second
STAGES = ("simulate", "film", "detect")
SWEEPS: dict[str, tuple[tuple[int, int], ...]] = {
    "people": tuple((people, 5) for people in (1, 2, 4, 8, 14, 20)),
    "cameras": tuple((4, cameras) for cameras in (2, 4, 8, 16, 31)),
    "both": ((2, 3), (4, 5), (8, 10), (14, 20), (20, 31)),
}


@dataclass(frozen=True)
class Size:
    """Times at one size.

    Attributes:
        sweep: "target", or the swept quantity: "people", "cameras" or "both".
        people: number of people.
        cameras: number of cameras.
        frames: number of frames of the sequence.
        build: time of the build (bodies, motions, objects, MuJoCo model), milliseconds divided by the frames.
        ms: milliseconds per frame of each stage, least of the rounds.
    """

    sweep: str
    people: int
    cameras: int
    frames: int
    build: float
    ms: dict[str, float]


@dataclass(frozen=True)
class _Staged:
    scenario: Scenario
    scene: Scene
    seconds: float  # time of the build


def measure(*, quick: bool = False) -> list[Size]:
    """Time a long sequence with 4 people and 5 cameras, then shorter sequences along the sweeps."""
    rounds = 2 if quick else 4
    _staged(4, 10)  # loads modules and compiles kernels
    sizes = [_size("target", _staged(4, 50 if quick else 2000), 5, rounds)]
    scenes = {}
    for sweep, points in SWEEPS.items():
        for people, cameras in points[:3] if quick else points:
            if people not in scenes:
                scenes[people] = _staged(people, 10 if quick else 100)
            sizes.append(_size(sweep, scenes[people], cameras, rounds))
    return sizes


def _staged(people: int, frames: int) -> _Staged:
    """Build the scene of the benchmark; a crowd gets a larger room."""
    plain = scenario(people=people, duration=frames / RATE)
    area = max(plain.people.area, people**0.5)
    staged = plain.model_copy(
        update={
            "rate": RATE,
            "room": plain.room.model_copy(update={"size": (2 * area + 4, 2 * area + 4, 3.0)}),
            "people": plain.people.model_copy(update={"area": area}),
            "cameras": plain.cameras.model_copy(update={"radius": area + 1.5}),
        }
    )
    start = time.process_time()
    scene = build(staged, build_rig(staged.cameras))
    RayObserver(Playback(scene))
    return _Staged(staged, scene, time.process_time() - start)


def _size(sweep: str, staged: _Staged, cameras: int, rounds: int) -> Size:
    rig = build_rig(staged.scenario.cameras.model_copy(update={"count": cameras}))
    with collector_off():
        runs = [_run(staged, rig) for _ in range(rounds)]  # the first run compiles and loads, so it is not the least
    frames = len(staged.scene.time)
    return Size(
        sweep=sweep,
        people=len(staged.scene.bodies),
        cameras=cameras,
        frames=frames,
        build=1e3 * staged.seconds / frames,
        ms={stage: min(run[stage] for run in runs) for stage in STAGES},
    )


def _run(staged: _Staged, rig: Rig) -> dict[str, float]:
    """Return milliseconds per frame of every stage."""
    scene, config = staged.scene, staged.scenario
    playback = Playback(scene)
    observer = RayObserver(playback)  # built once for a whole sequence, as in a trial
    marks = [time.process_time()]
    sequence = simulate(scene)
    marks.append(time.process_time())
    views = film(playback, ExposureSchedule.ideal(rig, scene.time), observer)
    marks.append(time.process_time())
    detect(sequence, views, rig, config.detector, seed=config.seed)
    marks.append(time.process_time())
    return {stage: 1e3 * (marks[k + 1] - marks[k]) / len(scene.time) for k, stage in enumerate(STAGES)}


def table_of(sizes: list[Size]) -> str:
    """Format as text: frames per second with the fractions of the stages, then the curves."""
    target, curves = sizes[0], sizes[1:]
    whole = target.build + sum(target.ms.values())
    parts = {"build (once)": target.build, **target.ms}
    first = [[f"{target.people} × {target.cameras}, {target.frames} frames", "ms per frame", "share", ""]]
    first += [[name, figure(ms), f"{100 * ms / whole:.0f} %", ""] for name, ms in parts.items()]
    rate = 1e3 / whole
    first.append(["frames per second", figure(rate), MET if rate >= TARGET else MISSED, f"{TARGET:g}"])

    totals = [sum(size.ms.values()) for size in curves]
    scale = min(totals) / 1.5, max(totals)
    rows, rules = [], []
    for sweep in SWEEPS:
        points = [(size, total) for size, total in zip(curves, totals, strict=True) if size.sweep == sweep]
        rows.append([f"by {sweep}", "ms per frame", *STAGES, "µs per person and view", ""])
        rules.append(len(rows) - 1)
        for size, total in points:
            pairs = size.people * size.cameras
            cells = [figure(total), *(figure(size.ms[stage]) for stage in STAGES), figure(1e3 * total / pairs)]
            rows.append([f"{size.people} × {size.cameras}", *cells, bar(total, *scale, width=16)])
        grows = [size.people * size.cameras for size, _ in points]  # one of the two is constant, or both grow
        rows.append(["exponent", f"{exponent(grows, [total for _, total in points]):.2f}", "", "", "", "", ""])
    return (
        table(first, "<>>>", rules=(0, len(parts)))
        + "\n\n"
        + table(rows, "<>>>>><", rules=rules)
        + caption(
            "People × cameras, without pictures: visibility by rays. The build is done once and divided by the frames; "
            "simulate computes the truth at the times of the frames; film is posing, rays, pixels and boxes; detect is "
            "the simulated detector. Processor time of one process, least of the rounds. Exponents: growth of the time "
            "per frame with people, cameras, or people × cameras, by least squares of logarithms on the larger half of "
            "the sizes; 1 is linear. Bars are logarithmic."
        )
    )
