"""Milliseconds a picture, pictures a second on two processes, posing and skinning."""

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
from simharness.types.mesh import Mesh
from simharness.world.rigs.layouts import build_rig
from simharness.world.scene.build import build
from simharness.world.scene.playback import Playback

SIZES = {(640, 480): 9.0, (1032, 776): 20.0}  # pixels, and milliseconds that a picture may take
TOGETHER = 180.0  # pictures a second on two processes, 640 x 480
SKINNING = 0.3  # milliseconds a person, posing and skinning
_PROCESSES = 2
_BLOCK = 64  # frames


@dataclass(frozen=True)
class Figure:
    """One figure.

    Attributes:
        name: of what.
        value: the median.
        best: the least of times, the greatest of rates: what the machine does where nobody disturbs it.
        target: that the median should keep; None where nothing is asked.
        more: whether more is better.
    """

    name: str
    value: float
    best: float
    target: float | None = None
    more: bool = False


def measure(*, quick: bool = False) -> list[Figure]:
    """Time the rasteriser and what it draws."""
    frames, rounds = (3, 2) if quick else (12, 6)
    staged = scenario()
    scene = build(staged, build_rig(staged.cameras))
    playback = Playback(scene)
    states = [playback.at(moment) for moment in np.linspace(0.0, staged.duration, frames)]
    shown = [meshes_at(scene, state) for state in states]
    figures = [Figure("triangles", *2 * (float(sum(len(mesh.faces) for mesh in shown[0])),))]
    for size, target in SIZES.items():
        rig = list(build_rig(scenario(size=size).cameras))
        for color in (True, False):
            times = _pictures(rig, shown, rounds, color)
            name = f"{size[0]} x {size[1]}, {'RGB, depth, ids' if color else 'depth, ids'}: ms a picture"
            figures.append(_times(name, times, target if color else None))
    figures.append(_together(list(build_rig(staged.cameras)), shown, rounds))

    people = len(scene.bodies)
    posing, skinning = [], []
    moments = np.linspace(0.0, staged.duration, _BLOCK)
    with collector_off():
        for _ in range(rounds):
            start = time.perf_counter()
            posed = list(playback.over(moments))  # as films do: motions are read for a block of frames at a time
            middle = time.perf_counter()
            for state in posed:
                for body, bones in zip(scene.bodies, state.bones, strict=True):
                    body.skin(bones)
            posing.append((middle - start) / (people * _BLOCK))
            skinning.append((time.perf_counter() - middle) / (people * _BLOCK))
    figures.append(_times("posing: ms a person", np.array(posing)))
    figures.append(_times("skinning: ms a person", np.array(skinning)))
    figures.append(_times("both", np.add(posing, skinning), SKINNING))
    return figures


def _pictures(rig: Sequence[Camera], shown: Sequence[Sequence[Mesh]], rounds: int, color: bool) -> NDArray[np.float64]:
    """Seconds a picture of every frame, a frame's shadows and normals shared by its views; rounds x frames."""
    renderer, times = RasterRenderer(), []
    renderer.render(rig[0], shown[0], color=color)
    with collector_off():
        for _ in range(rounds):
            for meshes in shown:
                start = time.perf_counter()
                for camera in rig:
                    renderer.render(camera, meshes, color=color)
                times.append((time.perf_counter() - start) / len(rig))
    return np.array(times)


def _together(rig: Sequence[Camera], shown: Sequence[Sequence[Mesh]], rounds: int) -> Figure:
    """Pictures a second of processes that start together; each round ends with the slowest."""
    spawn = multiprocessing.get_context("spawn")
    barrier = spawn.Barrier(_PROCESSES)
    with spawn.Pool(_PROCESSES, _begin, (barrier, rig, shown)) as pool:
        rates = []
        for k in range(rounds + 1):  # the first loads the kernels
            spans = np.array(pool.map(_share, range(_PROCESSES), chunksize=1))
            if k:
                rates.append(_PROCESSES * len(rig) * len(shown) / (spans[:, 1].max() - spans[:, 0].min()))
    name = f"640 x 480, RGB, depth, ids: pictures/s on {_PROCESSES} processes"
    return Figure(name, float(np.median(rates)), float(max(rates)), TOGETHER, more=True)


def _begin(barrier: Barrier, rig: Sequence[Camera], shown: Sequence[Sequence[Mesh]]) -> None:
    globals()["_work"] = barrier, rig, shown, RasterRenderer()


def _share(_: int) -> tuple[float, float]:
    """When this process began and ended, by the clock that all share."""
    barrier, rig, shown, renderer = globals()["_work"]
    barrier.wait()
    start = time.monotonic()
    for meshes in shown:
        for camera in rig:
            renderer.render(camera, meshes)
    return start, time.monotonic()


def _times(name: str, seconds: NDArray[np.float64], target: float | None = None) -> Figure:
    return Figure(name, 1e3 * float(np.median(seconds)), 1e3 * float(np.min(seconds)), target)


def table_of(figures: list[Figure]) -> str:
    """The text."""
    rows = [["", "median", "best", "", "target"]]
    for row in figures:
        met = row.target is None or (row.value >= row.target if row.more else row.value <= row.target)
        asked = ("", "") if row.target is None else (MET if met else MISSED, f"{row.target:g}")
        rows.append([row.name, figure(row.value), figure(row.best), *asked])
    return table(rows, "<>>^>") + caption(
        "Four people and clutter, five views of every frame: a picture bears a fifth of what a frame's views share "
        "(normals, the map of shadows). One process and one core but where it says two. The best is what the machine "
        "does where nothing else runs on it."
    )
