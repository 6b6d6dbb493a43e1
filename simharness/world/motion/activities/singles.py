"""What one person does alone."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import Any

from simharness.world.motion.activities.carrying import carry
from simharness.world.motion.activities.crouching import crouch, kneel, squat
from simharness.world.motion.activities.dancing import dance
from simharness.world.motion.activities.gestures import GESTURES, gesture
from simharness.world.motion.activities.lying import lie
from simharness.world.motion.activities.reaching import reach
from simharness.world.motion.activities.running import run
from simharness.world.motion.activities.sitting import sit
from simharness.world.motion.activities.stepping import step, turn
from simharness.world.motion.activities.walking import walk
from simharness.world.motion.motion import Motion
from simharness.world.motion.paths import Loop, Spot
from simharness.world.motion.performance import Activity, solo


def _gesture(name: str, *performer: Any, pace: float, **how: Any) -> Motion:
    return gesture(name, *performer, **how)


SINGLES: Mapping[str, Activity] = MappingProxyType(
    {
        activity.name: activity
        for activity in (
            Activity("walk", 1, Loop, 0.0, solo(walk)),
            *(Activity(name, 1, Spot, 0.0, solo(partial(_gesture, name))) for name in GESTURES),
            Activity("squat", 1, Spot, 0.2, solo(squat)),
            Activity("crouch", 1, Spot, 0.4, solo(crouch)),
            Activity("kneel", 1, Spot, 0.5, solo(kneel)),
            Activity("turn", 1, Spot, 0.0, solo(turn)),
            Activity("step", 1, Spot, 0.3, step),
            Activity("run", 1, Loop, 0.0, solo(run), froude=(0.6, 0.95)),
            Activity("reach", 1, Spot, 0.2, solo(reach)),
            Activity("carry", 1, Spot, 0.5, carry),
            Activity("dance", 1, Spot, 0.2, solo(dance)),
            Activity("lie", 1, Spot, 1.0, solo(lie)),
            Activity("sit", 1, Spot, 0.5, sit),
        )
    }
)
"""By name."""
