"""Minimum number of seeds with which a suite can find a regression."""

from __future__ import annotations

from simharness.scenario.study_definition import Study
from simharness.statistics.paired_tests import DRAWS, least_p


def least_seeds(level: float) -> int | None:
    """Return the smallest number of seeds with which a single test can be significant; None if no number is enough."""
    return next((seeds for seeds in range(1, DRAWS.bit_length() + 1) if least_p(seeds) <= level), None)


def require_seeds(study: Study) -> None:
    """Check that a suite has enough seeds to find a regression.

    Raises:
        ValueError: the seeds are so few, or the level so low, that no change could be significant.
    """
    level, seeds = study.gate.level, len(study.seeds)
    if least_p(seeds) <= level:
        return
    least = least_seeds(level)
    mend = "a higher level" if least is None else f"at least {least} seeds, or a higher level"
    raise ValueError(
        f"{study.path}: no regression can be found: {seeds} seed{'s' * (seeds > 1)} that all get worse have "
        f"p = {least_p(seeds):.2g}, and gate.level is {level:g}; give it {mend}"
    )
