"""What two people do together."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from simharness.world.motion.interactions.handover import hand_over
from simharness.world.motion.interactions.handshake import shake_hands
from simharness.world.motion.interactions.hug import hug
from simharness.world.motion.interactions.table import table
from simharness.world.motion.paths import Spot
from simharness.world.motion.performance import Activity

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
