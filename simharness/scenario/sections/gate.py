"""[gate]: what ``simharness check`` counts as a regression."""

from __future__ import annotations

from pydantic import Field

from simharness.scenario.sections.section import Amount, Section


class Tolerance(Section):
    """Largest loss in the mean of a score that is not a regression, however significant it is."""

    pcp: Amount = Field(1.0, description="percentage points")
    recall: Amount = Field(1.0, description="percentage points")
    precision: Amount = Field(1.0, description="percentage points")
    mpjpe_mm: Amount = Field(2.0, description="millimetres")
    match_f1: Amount = Field(1.0, description="percentage points")
    ghosts: Amount = Field(0.05, description="ghosts per frame")


class Gate(Section):
    """Rule of ``simharness check``: a regression is a loss that is significant and larger than its tolerance."""

    level: float = Field(
        0.05, gt=0.0, lt=1.0, description="significance level: chance of a false alarm where the method did not change"
    )
    slowdown: float = Field(
        1.5,
        gt=1.0,
        description="largest factor by which the time of a frame, relative to a reference kernel, may grow",
    )
    tolerance: Tolerance = Tolerance()
