"""What two people do together."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from simharness.motion.performance import Activity

PAIRS: Mapping[str, Activity] = MappingProxyType({})
"""By name."""
