"""Minimum number of seeds with which a suite can find a regression."""

from __future__ import annotations

from simharness.scenario.load import Study
from simharness.statistics.paired_tests import DRAWS


def least_two_sided_p(seeds: int) -> float:
    """Return the least p-value of the two-sided test of a mean: of seeds that all change alike."""
    return max(2.0 ** (1 - seeds), 1 / (1 + DRAWS))


def least_corrected_p(seeds: int, *, cases: int) -> float:
    """Return the least p-value of a comparison: of one score in which all seeds change alike, and of no other change.

    The whole suite and the single cases share the level.
    """
    return (1 + (cases > 1)) * least_two_sided_p(seeds)


def least_seeds(level: float, *, cases: int) -> int | None:
    """Return the smallest number of seeds with which a single test can be significant; None if no number is enough."""
    counts = range(1, DRAWS.bit_length() + 1)
    return next((seeds for seeds in counts if least_corrected_p(seeds, cases=cases) <= level), None)


def require_seeds(study: Study) -> None:
    """Check that a suite has enough seeds to find a regression.

    Raises:
        ValueError: the seeds are so few, or the level so low, that no change could be significant.
    """
    level, seeds, cases = study.gate.level, len(study.seeds), len(study.settings)
    p = least_corrected_p(seeds, cases=cases)
    if p <= level:
        return
    least = least_seeds(level, cases=cases)
    mend = "a higher level" if least is None else f"at least {least} seeds, or a higher level"
    raise ValueError(
        f"{study.path}: no regression can be found: {seeds} seed{'s' * (seeds > 1)} that all get worse have "
        f"p = {p:.2g}, and gate.level is {level:g}; give it {mend}"
    )
