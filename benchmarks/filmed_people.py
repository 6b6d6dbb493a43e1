"""Simulated recordings of people who move in front of a rig that is drawn at random."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

import simharness
from simharness.types.recording import Recording


def filmed_people(
    seed: int,
    rng: np.random.Generator,
    *,
    seconds: float,
    rate: float,
    activities: Sequence[str],
    views: int,
    layout: str,
    boxes: int,
) -> Recording:
    """Simulate a recording by the default detector, without pictures.

    Args:
        seed: seed of the scene.
        rng: from which the rig's radius, height and first direction are drawn.
        seconds: length of the recording.
        rate: frames a second.
        activities: what each person does.
        views: number of cameras.
        layout: of the cameras: ``"ring"``, ``"corners"`` or ``"arc"``.
        boxes: number of boxes that hide people.
    """
    changes = [
        f"seed={seed}",
        f"duration={seconds:.2f}",
        f"rate={rate:.1f}",
        f"people.count={len(activities)}",
        f"people.activities={json.dumps(list(activities))}",
        f"cameras.count={views}",
        f'cameras.layout="{layout}"',
        f"cameras.radius={rng.uniform(3.2, 4.5):.2f}",
        f"cameras.height={rng.uniform(1.2, 2.6):.2f}",
        "cameras.jitter=0.15",
        "cameras.aim_jitter=0.15",
        f"cameras.start={rng.uniform(0, 90):.1f}",
        "cameras.spread=150.0",
        'rendering.renderer="rays"',
        f"clutter.boxes={boxes}",
        "clutter.shelves=0",
        "room.size=[11.0,11.0,3.0]",
        "room.walls=false",
    ]
    return simharness.simulate(simharness.load_scenario("quickstart", overrides=changes))
