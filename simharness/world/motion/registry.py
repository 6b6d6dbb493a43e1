"""One door to all motions: an activity by its name."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from simharness.world.motion.activities.singles import SINGLES
from simharness.world.motion.interactions.pairs import PAIRS
from simharness.world.motion.performance import Activity

ACTIVITIES: Mapping[str, Activity] = MappingProxyType({**SINGLES, **PAIRS})
"""By name; "mocap" is not among them, for it is recorded (``simharness.world.motion.mocap``)."""
