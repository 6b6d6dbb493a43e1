"""One door to all motions: an activity by its name."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from simharness.motion.alone.singles import SINGLES
from simharness.motion.performance import Activity
from simharness.motion.together.pairs import PAIRS

ACTIVITIES: Mapping[str, Activity] = MappingProxyType({**SINGLES, **PAIRS})
"""By name; "mocap" is not among them, for it is recorded (``simharness.motion.mocap``)."""
