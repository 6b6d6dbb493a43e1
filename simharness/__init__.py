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

_MODULES = {
    "Blame": "simharness.api",
    "ForeignProgram": "simharness.trial.foreign_program",
    "KeypointError": "simharness.types.truth",
    "Recording": "simharness.types.recording",
    "Scenario": "simharness.scenario.sections.scenario",
    "Sequence": "simharness.types.sequence",
    "TrialResult": "simharness.api",
    "Truth": "simharness.types.truth",
    "Views": "simharness.types.views",
    "Visibility": "simharness.types.views",
    "assert_robust": "simharness.api",
    "blame": "simharness.api",
    "load_scenario": "simharness.api",
    "run_trial": "simharness.api",
    "score": "simharness.api",
    "simulate": "simharness.api",
}

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
