"""[gate]: what ``simharness check`` counts as a regression."""

from __future__ import annotations

from pydantic import Field

from simharness.scenario.sections.section import Percent, Section


class Tolerance(Section):
    """Largest loss in the mean of a score that is not a regression, however significant it is."""

    pcp: Percent = Field(1.0, description="percentage points")
    recall: Percent = Field(1.0, description="percentage points")
    precision: Percent = Field(1.0, description="percentage points")
    mpjpe_mm: float = Field(2.0, ge=0.0, le=1000.0, description="millimetres")
    match_f1: Percent = Field(1.0, description="percentage points")
    ghosts: float = Field(0.05, ge=0.0, le=1000.0, description="ghosts per frame")


class Gate(Section):
    """Rule of ``simharness check``: a regression is a loss that is significant and larger than its tolerance."""

    level: float = Field(
        0.05, gt=0.0, lt=1.0, description="significance level: chance of a false alarm where the method did not change"
    )
    slowdown: float = Field(
        1.5,
        gt=1.0,
        le=100.0,
        description="largest factor by which the time of a frame, relative to a reference kernel, may grow",
    )
    tolerance: Tolerance = Tolerance()
