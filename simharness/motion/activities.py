"""One door to all motions: an activity by its name."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from simharness.motion.pairs import PAIRS
from simharness.motion.performance import Activity
from simharness.motion.singles import SINGLES

ACTIVITIES: Mapping[str, Activity] = MappingProxyType({**SINGLES, **PAIRS})
"""By name; "mocap" is not among them, for it is recorded (``simharness.motion.mocap``)."""
