"""Simulated people, cameras and 2D detectors with exact ground truth, and scores of the method under test."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from simharness.api import Blame, TrialResult, assert_robust, blame, load_scenario, run_trial, score, simulate
    from simharness.scenario.sections.scenario import Scenario
    from simharness.trial.foreign_program import ForeignProgram
    from simharness.types.recording import Recording
    from simharness.types.sequence import Sequence
    from simharness.types.truth import KeypointError, Truth
    from simharness.types.views import Views, Visibility

_NAMES = {
    "api": ("Blame", "TrialResult", "assert_robust", "blame", "load_scenario", "run_trial", "score", "simulate"),
    "scenario.sections.scenario": ("Scenario",),
    "trial.foreign_program": ("ForeignProgram",),
    "types.recording": ("Recording",),
    "types.sequence": ("Sequence",),
    "types.truth": ("KeypointError", "Truth"),
    "types.views": ("Views", "Visibility"),
}
_MODULES = {name: f"simharness.{module}" for module, names in _NAMES.items() for name in names}

__all__ = [
    "Blame",
    "ForeignProgram",
    "KeypointError",
    "Recording",
    "Scenario",
    "Sequence",
    "TrialResult",
    "Truth",
    "Views",
    "Visibility",
    "assert_robust",
    "blame",
    "load_scenario",
    "run_trial",
    "score",
    "simulate",
]


def __getattr__(name: str) -> Any:
    """Import public names at their first use, so that `simharness --help` does not load numba."""
    if name not in _MODULES:
        raise AttributeError(f"module 'simharness' has no attribute {name!r}; it has {', '.join(__all__)}")
    return getattr(import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
