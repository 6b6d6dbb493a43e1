"""What one person does alone."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import Any

from simharness.motion.gestures import GESTURES, gesture
from simharness.motion.motion import Motion
from simharness.motion.paths import Loop, Spot
from simharness.motion.performance import Activity, solo
from simharness.motion.walking import walk


def _gesture(name: str, *performer: Any, pace: float, **how: Any) -> Motion:
    return gesture(name, *performer, **how)


SINGLES: Mapping[str, Activity] = MappingProxyType(
    {
        activity.name: activity
        for activity in (
            Activity("walk", 1, Loop, 0.0, solo(walk)),
            *(Activity(name, 1, Spot, 0.0, solo(partial(_gesture, name))) for name in GESTURES),
        )
    }
)
"""By name."""
