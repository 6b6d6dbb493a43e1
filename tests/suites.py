"""Small suite for tests of the gate; its scenes are simulated once in a session.

Its allowed slow-down is larger than the default, because other processes may use the machine while tests run.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from simharness.trial import run_trial as trial

QUICKSTART = Path(__file__).parents[1] / "scenarios" / "quickstart.toml"

SMALL = f"""
extends = {json.dumps(str(QUICKSTART))}
name = "small"
seed = 0
seeds = 12
variants = ["fast"]
duration = 0.8
rate = 5.0
rendering.renderer = "rays"

[cameras]
count = 4

[clutter]
boxes = 2
shelves = 0

[gate]
slowdown = 4.0

[cases.phantoms]
people.count = 3
detector.phantoms.rate = 1.0

[cases.crowd]
people.count = 5
"""

_made: dict = {}


def remember_scenes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Simulate and detect a scenario once: the gate measures the method, which is built and run every time."""
    simulate = trial._simulate

    def remembered(scenario, *arguments):
        key = scenario.model_dump_json()
        if key not in _made:
            _made[key] = simulate(scenario, *arguments)[:2]
        return *_made[key], trial.build_variants(scenario)

    monkeypatch.setattr(trial, "_simulate", remembered)
