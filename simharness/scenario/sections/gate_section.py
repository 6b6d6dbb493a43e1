"""[gate]: what ``simharness check`` counts as a regression, and what as an unexpected improvement.

Its tables of limits have the gated scores of the catalogue, :data:`simharness.scoring.catalogue.TOLERANCES`, as keys.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from pydantic import Field, create_model

from simharness.scenario.sections.section import Section, key
from simharness.scoring.catalogue import SCORES, TOLERANCES

BOUND = 2.0
"""Default bound of an improvement, in tolerances."""

_MOST = {"%": 100.0}  # largest limit by the unit of the score
_UNITS = {"%": "percentage points", "mm": "millimetres", "": "in the unit of the score"}


def _limits(name: str, about: str, defaults: Mapping[str, float | None]) -> Any:
    """Return a section with a limit for each gated score of the catalogue."""
    fields: dict[str, Any] = {}
    for each, default in defaults.items():
        score = SCORES[each]
        kind = Annotated[float, Field(ge=0.0, le=_MOST.get(score.unit, 1000.0))]
        about_score = f"{score.title}: {_UNITS.get(score.unit, score.unit)}"
        fields[score.key] = (kind if default is not None else kind | None, Field(default, description=about_score))
    return create_model(name, __base__=Section, __module__=__name__, __doc__=about, **fields)


if TYPE_CHECKING:
    Tolerances: TypeAlias = Section
    Improvements: TypeAlias = Section
else:
    Tolerances = _limits(
        "Tolerances",
        "Largest loss in the mean of a score that is not a regression, however significant it is.",
        TOLERANCES,
    )
    Improvements = _limits(
        "Improvements",
        """Largest gain in the mean of a score that needs no acceptance; by default twice the tolerance.

A larger gain is either an improvement that belongs in the baseline, or a suite that became easier. For a score with a
best value, such as coverage, this is the largest change in either direction.""",
        dict.fromkeys(TOLERANCES),
    )


class GateSection(Section):
    """Rule of ``simharness check``: a change fails it that is significant and larger than allowed."""

    level: float = key(
        0.05, "significance level: chance of a false alarm of a check where the method did not change", gt=0.0, lt=1.0
    )
    slowdown: float = key(
        1.3, "largest factor by which the time of a frame, relative to a reference kernel, may grow", gt=1.0, le=100.0
    )
    slowdown_elsewhere: float = key(
        2.0, "the same on another kind of processor than that of the baseline", gt=1.0, le=100.0
    )
    tolerance: Tolerances = Tolerances()
    improvement: Improvements = Improvements()

    def tolerance_of(self, score: str) -> float:
        """Return the tolerance of a score."""
        return float(getattr(self.tolerance, score))

    def improvement_of(self, score: str) -> float:
        """Return the bound of the improvement of a score."""
        bound = getattr(self.improvement, score)
        return BOUND * self.tolerance_of(score) if bound is None else float(bound)
