"""Recordings of the benchmark: simulated rigs without faults, unsynchronised cameras, and real Shelf."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.doctor.recordings import BenchRecording
from mvpose import Rig
from mvpose.arrays import Floats
from mvpose.commands.progress import Silence, Stages
from mvpose.skeleton import coco17_to_shelf14
from simharness.reality.recording_file import read_recording
from simharness.scenario.load import load
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.simulation import capture_trial, detect_trial

RIGS, CLOCKS, STILL = 20, 20, 5
RATE, DURATION = 25.0, 10.0  # Hz, s
OFFSET = 0.1  # s: most that a clock of the simulated recordings is off
_FIRST_SEED = 5000  # no constant of the doctor was chosen on these


def recordings(shelf: Path | None, *, some: int | None = None) -> Iterator[BenchRecording]:
    """Yield the recordings.

    Args:
        shelf: folder of real Shelf (as of ``simharness evaluate recording shelf FOLDER``); None leaves it out.
        some: most simulated recordings of a kind.
    """
    if shelf is not None:
        yield shelf_recording(shelf)
    for k in range(min(RIGS, some or RIGS)):
        yield simulated(f"rig{k:02d}", _FIRST_SEED + k, *_random_rig(k))
    for k in range(min(CLOCKS, some or CLOCKS)):
        seed = _FIRST_SEED + 100 + k
        offsets = np.random.default_rng(seed).uniform(-OFFSET, OFFSET, 5)
        offsets -= offsets.mean()  # the common part is in no picture
        for name, each in (("clock", offsets), ("sync", np.zeros(5))):
            yield simulated(f"{name}{k:02d}", seed, 'people.activities=["walk"]', offsets=each)
    for k in range(min(STILL, some or STILL)):
        yield simulated(f"still{k}", _FIRST_SEED + 200 + k, "people.count=1", 'people.activities=["stand"]')


def shelf_recording(folder: Path) -> BenchRecording:
    """Read real Shelf: 300 frames, the three actors that are scored."""
    recording = read_recording("shelf", folder)
    return BenchRecording(
        "shelf",
        recording.rig,
        recording.detections,
        recording.truth[:, list(recording.scored)],
        np.zeros(len(recording.rig)),
        1.0 / recording.rate,
    )


def simulated(name: str, seed: int, *overrides: str, offsets: Floats | None = None) -> BenchRecording:
    """Simulate ten seconds of the scenario "quickstart" without clutter, with overrides.

    Args:
        name: name of the recording.
        seed: seed.
        *overrides: changed keys of the scenario.
        offsets: offset of the clock of each camera, (V,), seconds, unknown to the method.
    """
    scenario = load(
        "quickstart",
        overrides=[
            f"duration={DURATION}", f"rate={RATE}", 'rendering.renderer="rays"', "clutter.boxes=0", "clutter.shelves=0",
            *overrides,
        ],
        seed=seed,
    )  # fmt: skip
    trial = build_trial(scenario)
    exposures = trial.exposures
    offsets = np.zeros(len(exposures.believed_rig)) if offsets is None else offsets
    trial = replace(trial, exposures=replace(exposures, time=exposures.time + offsets))
    stages = Stages(Silence())
    detected = detect_trial(capture_trial(trial, stages), stages)
    truth = np.stack([coco17_to_shelf14(each.truth.joints) for each in detected.frames])
    frames = tuple(each.detections for each in detected.frames)
    return BenchRecording(name, _named(exposures.believed_rig), frames, truth, offsets, 1.0 / RATE)


def _named(rig: Rig) -> Rig:
    return Rig([replace(camera, name=camera.name or f"cam{v}") for v, camera in enumerate(rig)])


def _random_rig(index: int) -> tuple[str, ...]:
    """Return the keys of a rig of four to six cameras, every second one with distorting lenses."""
    rng = np.random.default_rng(index)
    keys = [
        f"cameras.count={rng.integers(4, 7)}",
        f"cameras.radius={rng.uniform(3.2, 3.8):.2f}",
        f"cameras.height={rng.uniform(1.4, 2.6):.2f}",
        f"cameras.start={rng.uniform(0, 90):.1f}",
        f"cameras.fov={rng.uniform(70, 90):.1f}",
        "cameras.jitter=0.1",
        "cameras.aim_jitter=0.2",
    ]
    if index % 2:
        keys.append("cameras.distortion=[-0.2, 0.05, 0.001, -0.001, 0.0]")
    return tuple(keys)
