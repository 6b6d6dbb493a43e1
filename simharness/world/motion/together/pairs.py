"""What two people do together."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from simharness.world.motion.paths import Spot
from simharness.world.motion.performance import Activity
from simharness.world.motion.together.greeting import shake_hands
from simharness.world.motion.together.handing import hand_over
from simharness.world.motion.together.hugging import hug
from simharness.world.motion.together.table import table

PAIRS: Mapping[str, Activity] = MappingProxyType(
    {
        activity.name: activity
        for activity in (
            Activity("shake_hands", 2, Spot, 0.5, shake_hands),
            Activity("hug", 2, Spot, 0.4, hug),
            Activity("hand_over", 2, Spot, 0.5, hand_over),
            Activity("table", 2, Spot, 0.7, table),
        )
    }
)
"""By name."""
