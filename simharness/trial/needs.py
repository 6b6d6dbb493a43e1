"""Needs of a trial before it starts: pictures, memory, time and disk, estimated from its scenario.

The constants were measured on one core of a laptop of 2023 with trials of 10 to 1000 frames, 3 to 8 cameras and 2 to 8
people. Memory is within a factor of two of the measured peak (``tests/simharness/trial/test_needs.py``). Time is within
a factor of three on such a machine where kernels are compiled; it leaves out user-defined estimators and networks.
"""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from mvpose.commands.progress import duration
from mvpose.presets import without_repair
from mvpose.skeleton import COCO17
from mvpose.wholebody import skeleton_by_name
from simharness.scenario.checks import camera_count, oversized
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.stages.build_trial import true_rig

_PROCESS = 400e6  # bytes: Python, libraries, compiled kernels, a scene
_FRAME, _FRAME_OF_VARIANT = 50e3, 30e3  # bytes for each frame, and for each frame of a variant
_SIGHT = 2.5e3  # bytes for each sight of a person: truth and detection
_OUTER, _OUTER_SECONDS = 120.0, 10e-6  # bytes and seconds for each joint of feet and hands in each sight of a person
_PIXEL = 20.0  # bytes for each pixel of the one picture that is rendered at a time
_MATCHING = frozenset({"full", "appearance", "geometry", "no-3dps"})  # variants that keep the relaxed matrix (m, m)
_START = 4.0  # seconds: imports and the build of the scene
_SIGHT_SECONDS = 0.27e-3  # visibility, detection and scores
_PIXEL_SECONDS = 25e-9
_STORED_FRAME, _STORED_SIGHT = 2e3, 1e3  # bytes on disk
_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")  # of a container: versions 2, 1


@dataclass(frozen=True)
class Needs:
    """Estimated needs of a trial."""

    frames: int
    """Number of frames."""
    views: int
    """Number of cameras."""
    pictures: int
    """Number of pictures, rendered or not."""
    memory: float
    """Greatest memory of the process, bytes."""
    seconds: float
    """Time on one core."""
    disk: float
    """Results on disk, bytes."""


def needs_of(scenario: Scenario) -> Needs:
    """Estimate the needs of a trial in one process.

    Raises:
        ValueError: a rig that cannot be built, or with too many cameras for the number of people and frames.
    """
    views = camera_count(scenario.cameras) or len(true_rig(scenario))
    if too_large := next(oversized(scenario, views=views), None):
        raise ValueError(too_large[1])
    frames, people, variants = scenario.frames, scenario.people.count, scenario.method.variants
    sights = frames * views * people
    name = scenario.detector.skeleton
    outer = 0 if name == COCO17.name else sights * (len(skeleton_by_name(name)) - len(COCO17))
    detections = views * (people + scenario.detector.phantoms.rate)
    width, height = scenario.cameras.size
    pixels = 0 if scenario.rendering.renderer == "rays" else width * height
    relaxed = sum(without_repair(variant) in _MATCHING for variant in variants) * 8 * detections**2
    return Needs(
        frames=frames,
        views=views,
        pictures=frames * views,
        memory=_PROCESS
        + frames * (_FRAME + len(variants) * _FRAME_OF_VARIANT + relaxed)
        + sights * _SIGHT
        + outer * _OUTER
        + pixels * _PIXEL,
        seconds=_START
        + sights * _SIGHT_SECONDS
        + outer * _OUTER_SECONDS
        + frames * views * pixels * _PIXEL_SECONDS
        + frames * sum(_frame_seconds(without_repair(variant), detections) for variant in variants),
        disk=frames * len(variants) * _STORED_FRAME + sights * _STORED_SIGHT,
    )


def require_memory(scenarios: Iterable[Scenario], *, workers: int = 1) -> None:
    """Refuse trials that need more memory than the machine has.

    Args:
        scenarios: scenarios of which ``workers`` run at the same time.
        workers: number of processes.

    Raises:
        ValueError: one line with the need, the memory of the machine, and what to change; see also :func:`needs_of`.
    """
    needs = max((needs_of(each) for each in scenarios), key=lambda each: each.memory, default=None)
    if needs is None or workers * needs.memory <= memory():
        return
    processes = "" if workers == 1 else f"{workers:,} processes of "
    remedy = "lower duration, rate or the number of people" if needs.memory > memory() else "use fewer --workers"
    raise ValueError(
        f"{needs.frames:,} frames of {needs.views} cameras need about {processes}{_bytes(needs.memory)} of memory, "
        f"more than the {_bytes(memory())} of this machine: {remedy}"
    )


def describe(needs: Needs, *, trials: int = 1) -> list[str]:
    """Return the needs in words, one or two lines."""
    lines = [
        f"Needs about {_bytes(needs.memory)} of memory, {duration(needs.seconds)} on one core and {_bytes(needs.disk)} "
        f"on disk: {needs.frames:,} frames, {needs.pictures:,} pictures."
    ]
    if trials > 1:
        lines.append(
            f"All {trials:,} trials: about {duration(trials * needs.seconds)} on one core and "
            f"{_bytes(trials * needs.disk)} on disk."
        )
    return lines


def memory() -> int:
    """Return the memory of the machine, or of the container around this process where that is less, bytes."""
    sizes = [os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")]
    for file in _LIMITS:
        try:
            sizes.append(int(Path(file).read_text(encoding="ascii")))
        except (OSError, ValueError):  # no such limit, or the word "max"
            continue
    return min(sizes)


def _frame_seconds(variant: str, detections: float) -> float:
    """Return the time of a frame of m detections, seconds."""
    if variant in ("fast", "track-fast"):
        return 0.3e-3 + 7e-8 * detections**2
    if variant == "no-matching":
        m = min(detections, 500)
        return 1e-4 * m + 4e-8 * m**3
    return 2e-3 + 6e-5 * detections + 2.4e-9 * detections**3


def _bytes(count: float) -> str:
    for unit, size in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6)):
        if count >= size:
            return f"{count / size:.3g} {unit}"
    return f"{count / 1e3:.0f} kB"
