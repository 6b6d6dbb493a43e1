"""How many seeds a suite needs for anything in it to be significant."""

from __future__ import annotations

from simharness.scenario.study_definition import Study
from simharness.statistics.paired_tests import DRAWS


def least_p(seeds: int) -> float:
    """The least p that the one-sided sign-flip test can give: that of seeds which all went the same way."""
    return max(2.0**-seeds, 1 / (1 + DRAWS))


def least_seeds(level: float) -> int | None:
    """The fewest seeds of which a single test can be significant; None where the level is too low for any number."""
    return next((seeds for seeds in range(1, DRAWS.bit_length() + 1) if least_p(seeds) <= level), None)


def require_seeds(study: Study) -> None:
    """Refuse a suite that would pass whatever happened to the method.

    Raises:
        ValueError: it has so few seeds, or so low a level, that no change could be significant.
    """
    level, seeds = study.gate.level, len(study.seeds)
    if least_p(seeds) <= level:
        return
    least = least_seeds(level)
    mend = "a higher level" if least is None else f"at least {least} seeds, or a higher level"
    raise ValueError(
        f"{study.path}: no regression could ever be found: {seeds} seed{'s' * (seeds > 1)} that all get worse have "
        f"p = {least_p(seeds):.2g}, and gate.level is {level:g}; give it {mend}"
    )
