"""[method]: the variants under test, presets of ``mvpose.Pipeline`` and user-defined estimators.

[gate]: what ``simharness check`` counts as a regression, and what as an unexpected improvement.
"""

import difflib
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeAlias

from pydantic import ConfigDict, Field, create_model, model_validator

from simharness.scenario.sections.section import Section
from simharness.scoring.catalogue import SCORES, TOLERANCES

NAME = r"^[a-z0-9][a-z0-9_-]*$"
"""Pattern of the names of scenarios and estimators."""
_PLACE = r"^.+:[A-Za-z_]\w*$"


class EstimatorsSection(Section):
    """User-defined estimators by name: a file or module, and its attribute with a method ``estimate``."""

    model_config = ConfigDict(
        extra="allow",
        json_schema_extra={
            "additionalProperties": {"type": "string", "pattern": _PLACE},
            "propertyNames": {"pattern": NAME},
        },
    )
    __pydantic_extra__: dict[str, str]

    @property
    def places(self) -> dict[str, str]:
        """Place of each estimator, by name: "FILE.py:ATTRIBUTE" or "PACKAGE.MODULE:ATTRIBUTE"."""
        return dict(self.model_extra or {})

    @property
    def files(self) -> tuple[Path, ...]:
        """Files among the places."""
        sources = (place.rpartition(":")[0] for place in self.places.values())
        return tuple(Path(source) for source in sources if source.endswith(".py"))

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name, place in self.places.items():
            if not re.match(NAME, name):
                raise ValueError(f"names of lowercase letters, digits, - and _; {name!r} has other characters")
            if not re.match(_PLACE, place):
                raise ValueError(f"FILE.py:ATTRIBUTE or PACKAGE.MODULE:ATTRIBUTE; {place!r} of {name!r} is neither")
        return self


class MethodSection(Section):
    """Variants of the method that run on the detections."""

    variants: tuple[str, ...] = Field(
        ("full", "no-3dps"),
        min_length=1,
        max_length=100,
        description="presets of mvpose.Pipeline, also with +repair behind them: the rig and the clocks are repaired "
        "from the whole trial first; and names of method.estimators",
    )
    lag: Annotated[float, Field(ge=0.0, le=36_000.0)] = Field(
        0.2,
        description="track and track-fast: time of later frames that an estimate waits for, seconds; 0: none; at least "
        "the duration: the whole recording",
    )
    estimators: EstimatorsSection = Field(
        EstimatorsSection(),
        description='user-defined estimators: name = "FILE.py:ATTRIBUTE" or "PACKAGE.MODULE:ATTRIBUTE"',
    )


def wrong_variants(method: MethodSection) -> Iterator[tuple[str, str]]:
    """Yield the faulty keys of section [method], each with a message."""
    from mvpose.presets import PRESETS, without_repair  # only where a method is checked: it imports the whole method

    estimators = method.estimators.places
    for name in estimators:
        if name in PRESETS:
            yield f"estimators.{name}", "this is the name of a preset of mvpose.Pipeline; choose another name"
    known = [*PRESETS, *estimators]
    for name in method.variants:
        if name not in known and without_repair(name) not in PRESETS:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean {near[0]}? " if near else ""
            yield "variants", f"unknown variant {name!r}; {hint}expected one of {', '.join(known)}"
    if len(set(method.variants)) < len(method.variants):
        yield "variants", f"{', '.join(method.variants)}: a variant is listed twice; remove the repetition"


BOUND = 2.0
"""Default bound of an improvement, in tolerances."""

_MOST = {"%": 100.0}  # largest limit by the unit of the score
_UNITS = {"%": "percentage points", "mm": "millimetres", "": "in the unit of the score"}


def _limits(name: str, about: str, defaults: Mapping[str, float | None]) -> Any:
    """Return a section with a limit for each gated score of the catalogue."""
    fields: dict[str, Any] = {}
    for key, default in defaults.items():
        score = SCORES[key]
        kind = Annotated[float, Field(ge=0.0, le=_MOST.get(score.unit, 1000.0))]
        about_score = f"{score.title}: {_UNITS.get(score.unit, score.unit)}"
        fields[key] = (kind if default is not None else kind | None, Field(default, description=about_score))
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

    level: float = Field(
        0.05, gt=0.0, lt=1.0, description="significance level: chance of a false alarm where the method did not change"
    )
    slowdown: float = Field(
        1.2,
        gt=1.0,
        le=100.0,
        description="largest factor by which the time of a frame, relative to a reference kernel, may grow",
    )
    slowdown_elsewhere: float = Field(
        2.0, gt=1.0, le=100.0, description="the same on another kind of processor than that of the baseline"
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
