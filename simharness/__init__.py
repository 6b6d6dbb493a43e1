"""Simulated people before simulated cameras, the truth about every joint, and scores of the method under test."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from simharness.scenario.sections.scenario import Scenario
    from simharness.types.sequence import Sequence
    from simharness.types.truth import KeypointError, Truth
    from simharness.types.views import Views, Visibility

_HOMES = {
    "KeypointError": "simharness.types.truth",
    "Scenario": "simharness.scenario.sections.scenario",
    "Sequence": "simharness.types.sequence",
    "Truth": "simharness.types.truth",
    "Views": "simharness.types.views",
    "Visibility": "simharness.types.views",
}

__all__ = ["KeypointError", "Scenario", "Sequence", "Truth", "Views", "Visibility"]


def __getattr__(name: str) -> Any:
    """Import the public types when they are first asked for: `simharness --help` need not load numba."""
    if name not in _HOMES:
        raise AttributeError(f"module 'simharness' has no attribute {name!r}; it has {', '.join(__all__)}")
    return getattr(import_module(_HOMES[name]), name)
