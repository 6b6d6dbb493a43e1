"""Scene frames a second without pictures, and how the cost of a frame grows with people and cameras."""

from __future__ import annotations

import time
from dataclasses import dataclass

from benchmarks.method.measure import collector_off, exponent
from benchmarks.method.report import MET, MISSED, bar, caption, figure, table
from benchmarks.simulator.scenes import scenario
from mvpose.camera import Rig
from simharness.capture.film import film
from simharness.capture.ray_visibility import RayObserver
from simharness.detector.detect import detect
from simharness.scenario.sections.scenario import Scenario
from simharness.world.rigs.exposure_schedule import ExposureSchedule
from simharness.world.rigs.layouts import build_rig
from simharness.world.scene.build import Scene, build
from simharness.world.scene.playback import Playback, simulate

TARGET = 250.0  # scene frames a second of 4 people before 5 cameras
RATE = 25.0  # frames per second
STAGES = ("simulate", "film", "detect")
SWEEPS: dict[str, tuple[tuple[int, int], ...]] = {
    "people": tuple((people, 5) for people in (1, 2, 4, 8, 14, 20)),
    "cameras": tuple((4, cameras) for cameras in (2, 4, 8, 16, 31)),
    "both": ((2, 3), (4, 5), (8, 10), (14, 20), (20, 31)),
}


@dataclass(frozen=True)
class Size:
    """One size.

    Attributes:
        sweep: "target", or what grows: "people", "cameras" or "both".
        people: in the room.
        cameras: around it.
        frames: of the sequence.
        build: milliseconds a frame for what is done once (bodies, motions, things, the MuJoCo model), spread over them.
        ms: milliseconds a frame of each stage, the least of the rounds.
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
    seconds: float  # that it took to build


def measure(*, quick: bool = False) -> list[Size]:
    """Time a long sequence of 4 people before 5 cameras, then shorter ones along the sweeps."""
    rounds = 2 if quick else 4
    _staged(4, 10)  # loads and compiles
    sizes = [_size("target", _staged(4, 50 if quick else 2000), 5, rounds)]
    scenes = {}
    for sweep, points in SWEEPS.items():
        for people, cameras in points[:3] if quick else points:
            if people not in scenes:
                scenes[people] = _staged(people, 10 if quick else 100)
            sizes.append(_size(sweep, scenes[people], cameras, rounds))
    return sizes


def _staged(people: int, frames: int) -> _Staged:
    """The bench's scene; a crowd gets a larger room."""
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
        runs = [_run(staged, rig) for _ in range(rounds)]  # the first one compiles and loads, and is not the least
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
    """Milliseconds a frame of every stage."""
    scene, config = staged.scene, staged.scenario
    playback = Playback(scene)
    observer = RayObserver(playback)  # laid out once for a whole sequence, too
    marks = [time.process_time()]
    sequence = simulate(scene)
    marks.append(time.process_time())
    views = film(playback, ExposureSchedule.ideal(rig, scene.time), observer)
    marks.append(time.process_time())
    detect(sequence, views, rig, config.detector, seed=config.seed)
    marks.append(time.process_time())
    return {stage: 1e3 * (marks[k + 1] - marks[k]) / len(scene.time) for k, stage in enumerate(STAGES)}


def table_of(sizes: list[Size]) -> str:
    """The text: frames a second and the shares of the stages, then the curves."""
    target, curves = sizes[0], sizes[1:]
    whole = target.build + sum(target.ms.values())
    parts = {"build (once)": target.build, **target.ms}
    first = [[f"{target.people} × {target.cameras}, {target.frames} frames", "ms a frame", "share", ""]]
    first += [[name, figure(ms), f"{100 * ms / whole:.0f} %", ""] for name, ms in parts.items()]
    rate = 1e3 / whole
    first.append(["frames a second", figure(rate), MET if rate >= TARGET else MISSED, f"{TARGET:g}"])

    totals = [sum(size.ms.values()) for size in curves]
    scale = min(totals) / 1.5, max(totals)
    rows, rules = [], []
    for sweep in SWEEPS:
        mine = [(size, total) for size, total in zip(curves, totals, strict=True) if size.sweep == sweep]
        rows.append([f"by {sweep}", "ms a frame", *STAGES, "µs a person and view", ""])
        rules.append(len(rows) - 1)
        for size, total in mine:
            pairs = size.people * size.cameras
            cells = [figure(total), *(figure(size.ms[stage]) for stage in STAGES), figure(1e3 * total / pairs)]
            rows.append([f"{size.people} × {size.cameras}", *cells, bar(total, *scale, width=16)])
        grows = [size.people * size.cameras for size, _ in mine]  # one of the two stays the same, or both grow
        rows.append(["exponent", f"{exponent(grows, [total for _, total in mine]):.2f}", "", "", "", "", ""])
    return (
        table(first, "<>>>", rules=(0, len(parts)))
        + "\n\n"
        + table(rows, "<>>>>><", rules=rules)
        + caption(
            "People × cameras, without pictures: visibility by rays. Building is done once and spread over the frames; "
            "simulate is the truth at the frames' times, film is posing again, rays, pixels and boxes, detect is the "
            "simulated detector. Processor time of one process, least of the rounds. Exponents: growth of a frame's "
            "cost with people, cameras, or people × cameras, by least squares of logarithms on the larger half of the "
            "sizes; 1 is linear. Bars are logarithmic."
        )
    )
