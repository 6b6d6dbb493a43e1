"""Time per picture, pictures per second on two processes, and time of posing and skinning."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.synchronize import Barrier

import numpy as np
from numpy.typing import NDArray

from benchmarks.method.measure import collector_off
from benchmarks.method.report import MET, MISSED, caption, figure, table
from benchmarks.simulator.scenes import scenario
from mvpose.camera import Camera
from simharness.capture.picture import meshes_at
from simharness.capture.rendering.raster import RasterRenderer
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh
from simharness.world.rigs.layouts import build_rig
from simharness.world.scene.build import build
from simharness.world.scene.playback import Playback

SIZES = {(640, 480): 5.0, (1032, 776): 12.0, (1920, 1080): 30.0}  # pixels, and target milliseconds per picture
PARALLEL_RATE = 350.0  # target pictures per second on two processes, 640 x 480
SKINNING = 0.3  # target milliseconds per person for posing and skinning
_PROCESSES = 2
_BLOCK = 64  # frames


@dataclass(frozen=True)
class Measurement:
    """Measured quantity.

    Attributes:
        name: name and unit of the quantity.
        value: median.
        best: least time or greatest rate, which is the value without other load on the machine.
        target: target of the median, or None.
        more: whether more is better.
    """

    name: str
    value: float
    best: float
    target: float | None = None
    more: bool = False


def measure(*, quick: bool = False) -> list[Measurement]:
    """Time the rasteriser, posing and skinning."""
    frames, rounds = (1, 1) if quick else (12, 6)
    staged = scenario()
    scene = build(staged, build_rig(staged.cameras))
    playback = Playback(scene)
    states = [playback.at(moment) for moment in np.linspace(0.0, staged.duration, frames)]
    shown = [meshes_at(scene, state) for state in states]
    figures = [Measurement("triangles", *2 * (float(sum(len(mesh.faces) for mesh in shown[0])),))]
    for size, target in SIZES.items():
        rig = list(build_rig(scenario(size=size).cameras))
        for color in (True, False):
            times = _pictures(rig, shown, rounds, color, scene.lighting)
            name = f"{size[0]} x {size[1]}, {'RGB, depth, ids' if color else 'depth, ids'}: ms per picture"
            figures.append(_times(name, times, target if color else None))
    figures.append(_parallel_rate(list(build_rig(staged.cameras)), shown, rounds, scene.lighting))

    people = len(scene.bodies)
    posing, skinning = [], []
    moments = np.linspace(0.0, staged.duration, _BLOCK)
    with collector_off():
        for _ in range(rounds):
            start = time.perf_counter()
            posed = list(playback.over(moments))  # as films do, which read motions in blocks of frames
            middle = time.perf_counter()
            for state in posed:
                for body, bones in zip(scene.bodies, state.bones, strict=True):
                    body.skin(bones)
            posing.append((middle - start) / (people * _BLOCK))
            skinning.append((time.perf_counter() - middle) / (people * _BLOCK))
    figures.append(_times("posing: ms per person", np.array(posing)))
    figures.append(_times("skinning: ms per person", np.array(skinning)))
    figures.append(_times("both", np.add(posing, skinning), SKINNING))
    return figures


def _pictures(
    rig: Sequence[Camera], shown: Sequence[Sequence[Mesh]], rounds: int, color: bool, lighting: Lighting
) -> NDArray[np.float64]:
    """Return seconds per picture for rounds x frames; the views of a frame share its shadows and normals."""
    renderer, times = RasterRenderer(), []
    renderer.render(rig[0], shown[0], color=color, lighting=lighting)
    with collector_off():
        for _ in range(rounds):
            for meshes in shown:
                start = time.perf_counter()
                for camera in rig:
                    renderer.render(camera, meshes, color=color, lighting=lighting)
                times.append((time.perf_counter() - start) / len(rig))
    return np.array(times)


def _parallel_rate(
    rig: Sequence[Camera], shown: Sequence[Sequence[Mesh]], rounds: int, lighting: Lighting
) -> Measurement:
    """Measure pictures per second of processes that start together; a round ends with the slowest process."""
    spawn = multiprocessing.get_context("spawn")
    barrier = spawn.Barrier(_PROCESSES)
    with spawn.Pool(_PROCESSES, _initialise, (barrier, rig, shown, lighting)) as pool:
        rates = []
        for k in range(rounds + 1):  # the first round loads the kernels
            spans = np.array(pool.map(_render_all, range(_PROCESSES), chunksize=1))
            if k:
                rates.append(_PROCESSES * len(rig) * len(shown) / (spans[:, 1].max() - spans[:, 0].min()))
    name = f"640 x 480, RGB, depth, ids: pictures/s on {_PROCESSES} processes"
    return Measurement(name, float(np.median(rates)), float(max(rates)), PARALLEL_RATE, more=True)


def _initialise(barrier: Barrier, rig: Sequence[Camera], shown: Sequence[Sequence[Mesh]], lighting: Lighting) -> None:
    globals()["_work"] = barrier, rig, shown, lighting, RasterRenderer()


def _render_all(_: int) -> tuple[float, float]:
    """Render all pictures and return the start and end time of this process, by a clock shared by all processes."""
    barrier, rig, shown, lighting, renderer = globals()["_work"]
    barrier.wait()
    start = time.monotonic()
    for meshes in shown:
        for camera in rig:
            renderer.render(camera, meshes, lighting=lighting)
    return start, time.monotonic()


def _times(name: str, seconds: NDArray[np.float64], target: float | None = None) -> Measurement:
    return Measurement(name, 1e3 * float(np.median(seconds)), 1e3 * float(np.min(seconds)), target)


def table_of(figures: list[Measurement]) -> str:
    """Format the figures as text."""
    rows = [["", "median", "best", "", "target"]]
    for row in figures:
        met = row.target is None or (row.value >= row.target if row.more else row.value <= row.target)
        target = ("", "") if row.target is None else (MET if met else MISSED, f"{row.target:g}")
        rows.append([row.name, figure(row.value), figure(row.best), *target])
    return table(rows, "<>>^>") + caption(
        "Four people and clutter, five views of every frame: a picture includes a fifth of the work that the views of "
        "a frame share (normals, shadow map). One process on one core unless stated otherwise. Best: figure without "
        "other load on the machine."
    )
