"""Simulated people before simulated cameras, the truth about every joint, and scores of the method under test."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from simharness.detector.truth import KeypointError, Truth
    from simharness.rendering.views import Views
    from simharness.rendering.visibility import Visibility
    from simharness.scenario.models import Scenario
    from simharness.scene.sequence import Sequence

_HOMES = {
    "KeypointError": "simharness.detector.truth",
    "Scenario": "simharness.scenario.models",
    "Sequence": "simharness.scene.sequence",
    "Truth": "simharness.detector.truth",
    "Views": "simharness.rendering.views",
    "Visibility": "simharness.rendering.visibility",
}

__all__ = ["KeypointError", "Scenario", "Sequence", "Truth", "Views", "Visibility"]


def __getattr__(name: str) -> Any:
    """Import the public types when they are first asked for: `simharness --help` need not load numba."""
    if name not in _HOMES:
        raise AttributeError(f"module 'simharness' has no attribute {name!r}; it has {', '.join(__all__)}")
    return getattr(import_module(_HOMES[name]), name)
